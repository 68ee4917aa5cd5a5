"""The laboratory does what it says: delay, loss, cuts, boots. Real namespaces; skipped where there can be none."""

import asyncio
import sys
from pathlib import Path

import pytest

from tests.lab.fabric import Fabric, address_of
from tests.lab.lab import Lab, Machine, laboratory, missing

pytestmark = pytest.mark.real_time
needs_lab = pytest.mark.skipif(bool(missing()), reason=missing())
ECHO = """
import socket, sys
door = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
door.bind((sys.argv[1], 7000))
print("ready", flush=True)
while True:
    words, sender = door.recvfrom(2000)
    door.sendto(words, sender)
"""
CALL = """
import socket, sys, time
door = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
door.settimeout(float(sys.argv[3]))
for number in range(int(sys.argv[2])):
    began = time.monotonic()
    door.sendto(str(number).encode(), (sys.argv[1], 7000))
    try:
        while door.recv(2000) != str(number).encode():
            pass
    except (TimeoutError, OSError):
        continue
    print(time.monotonic() - began)
"""


async def echo(machine: Machine) -> None:
    process = await machine.spawn(sys.executable, "-c", ECHO, machine.ip, stdout=asyncio.subprocess.PIPE)
    assert process.stdout is not None
    assert await process.stdout.readline() == b"ready\n"


async def call(one: Machine, other: Machine, times: int = 5, timeout: float = 3.0) -> list[float]:
    """Seconds of the round trips that came back."""
    process = await one.spawn(
        sys.executable, "-c", CALL, other.ip, str(times), str(timeout), stdout=asyncio.subprocess.PIPE
    )
    told, _ = await process.communicate()
    return [float(line) for line in told.split()]


@needs_lab
async def test_paths_delay_lose_and_are_cut(tmp_path: Path) -> None:
    async with laboratory(tmp_path, seed=1) as lab:
        one, two, three = lab.machines.values()
        await echo(two)
        await echo(three)
        assert len(await call(one, two)) == 5

        await lab.path(1, 2, delay=0.04, jitter=0.01)
        assert min(await call(one, two)) >= 0.06
        assert len(await call(one, three)) == 5

        await lab.path(1, 2, delay=0.0, jitter=0.0, loss=0.5)
        before = await lab.order(order="counts")
        back = await call(one, two, times=40, timeout=0.05)
        after = await lab.order(order="counts")
        assert 0 < len(back) < 35
        assert after["1-2"]["lost"] > before["1-2"]["lost"]

        await lab.path(1, 2, loss=0.0)
        await lab.cut(1, 2)
        assert await call(one, two, times=2, timeout=0.1) == []
        assert len(await call(one, three)) == 5
        await lab.heal(1, 2)
        assert len(await call(one, two)) == 5

        await lab.isolate(3)
        assert await call(one, three, times=2, timeout=0.1) == []
        await lab.isolate(3, is_cut=False)
        assert len(await call(one, three)) == 5


@needs_lab
async def test_a_machine_that_crashes_takes_all_with_it_and_boots_as_another(tmp_path: Path) -> None:
    async with laboratory(tmp_path, machines=(1, 2), seed=1) as lab:
        one, two = lab.machines.values()
        boot = await boot_id(two)
        assert boot != await boot_id(one)
        await echo(two)
        (process,) = [each for each in two.processes if each.returncode is None]
        await two.crash()
        assert process.returncode is not None
        assert await call(one, two, times=2, timeout=0.1) == []
        await two.boot()
        assert await boot_id(two) != boot
        await echo(two)
        assert len(await call(one, two)) == 5


@needs_lab
async def test_what_listens_on_loopback_is_not_seen_from_other_machines(tmp_path: Path) -> None:
    async with laboratory(tmp_path, machines=(1, 2), seed=1) as lab:
        one, two = lab.machines.values()
        process = await two.spawn(sys.executable, "-c", ECHO, "127.0.0.1", stdout=asyncio.subprocess.PIPE)
        assert process.stdout is not None
        await process.stdout.readline()
        assert await call(one, two, times=2, timeout=0.1) == []


async def boot_id(machine: Machine) -> bytes:
    process = await machine.spawn(
        "cat", "/proc/sys/kernel/random/boot_id", stdout=asyncio.subprocess.PIPE
    )  # fmt: skip
    return (await process.communicate())[0]


def frame(to: int, since: int, text: bytes) -> bytes:
    return address_of(to) + address_of(since) + text


def test_jitter_keeps_the_order_of_each_path() -> None:
    fabric = Fabric(seed=3)
    fabric.machines |= {1, 2}
    fabric.path(1, 2).delay, fabric.path(1, 2).jitter = 0.05, 0.05
    for number in range(100):
        fabric.take(1, frame(2, 1, bytes([number])), number * 0.001)
    assert not list(fabric.due(0.0))
    came = [each[-1] for _, each in fabric.due(1.0)]
    assert came == list(range(100))


def test_a_cut_takes_what_is_under_way_in_its_direction_only() -> None:
    fabric = Fabric(seed=3)
    fabric.machines |= {1, 2}
    fabric.path(1, 2).delay = fabric.path(2, 1).delay = 0.1
    fabric.take(1, frame(2, 1, b"there"), 0.0)
    fabric.take(2, frame(1, 2, b"back"), 0.0)
    fabric.path(1, 2).is_cut = True
    assert [(to, each[12:]) for to, each in fabric.due(1.0)] == [(1, b"back")]
    assert fabric.counts[1, 2].cut == 1


def test_frames_for_all_reach_all_others_and_strange_ones_nobody() -> None:
    fabric = Fabric(seed=3)
    fabric.machines |= {1, 2, 3}
    fabric.take(1, b"\xff" * 6 + address_of(1) + b"who", 0.0)
    fabric.take(1, b"\x02\x00\x00\x00\x01\x02" + address_of(1) + b"lost", 0.0)
    assert sorted(to for to, _ in fabric.due(0.0)) == [2, 3]


def test_what_the_laboratory_lacks_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    assert "root" in missing()
    assert isinstance(Lab, type)

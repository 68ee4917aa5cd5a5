"""`engage doctor` on several machines: what it says of paths that are cut, of routers, keys and frozen processes."""

import asyncio
import json
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.lab.lab import Lab, Machine, laboratory, missing
from tests.lab.test_reach import LONG, SPREAD, engage, start, until

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(bool(missing()), reason=missing())]
NOTICED = 60.0
"""Seconds within which all have noticed that a path is cut, or a process frozen. Until then they may not answer."""


async def doctor(machine: Machine, *options: str) -> tuple[int, dict[str, Any]]:
    """Examine from there; returns the exit code, and what was told."""
    process = await engage(machine, "doctor", "--json", *options)
    told, _ = await asyncio.wait_for(process.communicate(), LONG)
    (line,) = [line for line in told.decode().splitlines() if line.startswith("{")]
    assert process.returncode is not None
    return process.returncode, json.loads(line)


def unseen(report: dict[str, Any]) -> set[tuple[str, str]]:
    """Who does not see whom."""
    return {(cell["viewer"], cell["other"]) for cell in report["matrix"] if cell["sees"] == "no"}


def wrong(report: dict[str, Any]) -> dict[str, str]:
    return {each["where"]: each["what"] for each in report["findings"] if each["severity"] == "wrong"}


async def test_it_says_of_a_router_alone_that_no_robot_is_there_and_of_none_that_nobody_opens(tmp_path: Path) -> None:
    async with laboratory(tmp_path, machines=(1, 2), seed=1) as lab:
        address = f"tcp/{lab.machines[1].ip}:7447"
        code, report = await doctor(lab.machines[2], "--connect", address)
        assert code == 1
        assert wrong(report) == {address: "nobody opens: no process listens there"}
        await until(await engage(lab.machines[1], "router", "--listen", address), "router is ready")
        code, report = await doctor(lab.machines[2], "--connect", address)
        assert code == 1
        assert wrong(report) == {"robot": "no service of this robot is on the bus"}
        await lab.cut(1, 2)
        code, report = await doctor(lab.machines[2], "--connect", address)
        assert code == 1
        assert wrong(report) == {address: "nobody opens: no answer within 2 s"}


async def test_a_whole_robot_over_a_router_and_one_that_is_frozen(tmp_path: Path) -> None:
    async with laboratory(tmp_path, seed=1) as lab:
        address = f"tcp/{lab.machines[1].ip}:7447"
        await until(await engage(lab.machines[1], "router", "--listen", address), "router is ready")
        await lab.path(1, 3, delay=0.01)
        started = await start(lab, "--connect", address)
        await until(await engage(lab.machines[3], "run", "collaboration", "--connect", address), "ready")
        code, report = await doctor(lab.machines[3], "--connect", address)
        assert code == 0, report["findings"]
        assert unseen(report) == set()
        hosts = {each["name"]: each["status"]["process"]["host"] for each in report["facts"]["known"]}
        assert {(name, f"lab{machine}") for machine, names in SPREAD.items() for name in names} <= set(hosts.items())
        trips = {(cell["viewer"], cell["other"]): cell.get("trip") for cell in report["matrix"]}
        assert trips["control", "realizer"] is None  # one machine, one clock
        assert trips["control", "simulation"] >= 0.02
        assert trips["here", "control"] >= 0.02
        await lab.machines[2].kill(started["recognition"], signal.SIGSTOP)
        code, report = await doctor(lab.machines[3], "--connect", address)
        assert (code, wrong(report).keys()) == (1, {"recognition"})
        async with asyncio.timeout(NOTICED):
            while (
                not wrong(report).get("recognition", "").startswith("nobody sees this service: it has ended, stands")
            ):
                code, report = await doctor(lab.machines[3], "--connect", address)
        assert (code, wrong(report).keys()) == (1, {"recognition"})


async def test_the_matrix_shows_a_path_between_two_that_is_cut_in_one_direction(tmp_path: Path) -> None:
    async with laboratory(tmp_path, seed=1) as lab:
        await start_peers(lab)
        options = ("--connect", f"tcp/{lab.machines[1].ip}:7447", "--mode", "peer")
        code, report = await doctor(lab.machines[1], *options)
        assert (code, unseen(report)) == (0, set()), report["findings"]
        await lab.order(order="path", since=2, to=3, is_cut=True)
        there, here = set(SPREAD[2]), set(SPREAD[3])
        apart = {(a, b) for a in there for b in here} | {(b, a) for a in there for b in here}
        async with asyncio.timeout(NOTICED):
            while unseen(report) != apart:
                code, report = await doctor(lab.machines[1], *options)
        assert code == 1
        (what, *_) = [each["what"] for each in report["findings"] if each["where"] == "recognition"]
        assert what == (
            "it is there, but not seen by simulation: it listens on tcp/10.77.0.2, and the path there is cut"
        )

        code, report = await doctor(lab.machines[3], *options)  # from behind the cut
        assert code == 1
        assert {("here", name) for name in there} <= unseen(report)


async def start_peers(lab: Lab) -> None:
    """Start the services as peers that connect to one another directly, control on machine 1 first."""
    for number, names in SPREAD.items():
        for name in names:
            machine = lab.machines[number]
            port = 7447 if name == "control" else 0
            meeting = () if name == "control" else ("--connect", f"tcp/{lab.machines[1].ip}:7447")
            listen = ("--listen", f"tcp/{machine.ip}:{port}")
            await until(await engage(machine, "run", name, *listen, *meeting), f"{name} is ready")


async def test_with_keys_it_tells_of_certificates_and_why_no_link_comes(tmp_path: Path) -> None:
    keys, strange = str(tmp_path / "keys"), str(tmp_path / "strange")
    async with laboratory(tmp_path, seed=1) as lab:
        one, two, _ = lab.machines.values()
        for folder in (keys, strange):
            made = await engage(one, "keys", "init", folder, "--host", one.ip, "--days", "10")
            assert await asyncio.wait_for(made.wait(), LONG) == 0
        address = f"tls/{one.ip}:7447"
        await until(await engage(one, "router", "--listen", address, "--keys", keys), "router is ready")
        await start(lab, "--connect", address, "--keys", keys)
        for holder in ("viewer", "recognition"):
            code, report = await doctor(two, "--connect", address, "--keys", f"{keys}/{holder}")
            assert code == 0, report["findings"]
            assert unseen(report) == set()
            (door,) = report["facts"]["doors"]
            assert 9 * 86400 < door["until"] - report["facts"]["at"] < 10 * 86400
            soon = {
                each["where"] for each in report["findings"] if each["what"] == "the certificate expires in 10 days"
            }
            assert {address, "robot/control/control", f"{holder_of(holder)}"} <= soon
        code, report = await doctor(two, "--connect", address, "--keys", f"{strange}/viewer")
        assert code == 1
        assert "its certificate is not good" in wrong(report)[address]


def holder_of(name: str) -> str:
    return f"robot/{'observer' if name == 'viewer' else name}/{name}"

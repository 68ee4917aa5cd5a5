"""Services on three machines find one another, or say whom they cannot see. Real processes and sockets."""

import asyncio
import sys
from pathlib import Path

import pytest

from tests.lab.lab import Lab, Machine, Process, laboratory, missing

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(bool(missing()), reason=missing())]
BML = """<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b1">
<speech id="s1"><text>here I am</text></speech><head id="h1" lexeme="NOD" start="s1:end"/></bml>"""
SPREAD = {1: ("control", "realizer"), 2: ("generation", "recognition"), 3: ("simulation",)}
LONG = 40.0


async def engage(machine: Machine, *arguments: str) -> Process:
    """Run a command of ours on a machine; all it prints is in one stream."""
    return await machine.spawn(
        sys.executable, "-m", "engage_hri", *arguments,
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
    )  # fmt: skip


async def until(process: Process, words: str) -> str:
    """Read what a process prints until these words come; returns all of it."""
    assert process.stdout is not None
    read = ""
    async with asyncio.timeout(LONG):
        while words not in read:
            line = await process.stdout.readline()
            assert line, f"{words!r} did not come: {read}"
            read += line.decode()
    return read


async def start(lab: Lab, *options: str) -> dict[str, Process]:
    """Run the services, spread over three machines, and wait until each is ready."""
    started = {
        name: await engage(lab.machines[number], "run", name, *options)
        for number, names in SPREAD.items()
        for name in names
    }
    await asyncio.gather(*(until(process, f"{name} is ready") for name, process in started.items()))
    return started


async def test_three_machines_with_a_router_in_any_order(tmp_path: Path) -> None:
    block = tmp_path / "block.xml"
    block.write_text(BML)
    async with laboratory(tmp_path, seed=1) as lab:
        address = f"tcp/{lab.machines[1].ip}:7447"
        waiting = await engage(lab.machines[3], "watch", "--connect", address)
        await until(waiting, "no router answers at tcp/10.77.0.1:7447; waiting")
        early = await engage(lab.machines[3], "play", str(block), "--connect", address)
        told, _ = await asyncio.wait_for(early.communicate(), LONG)
        assert early.returncode == 75, told.decode()
        assert "no router answers at tcp/10.77.0.1:7447" in told.decode()
        router = await engage(lab.machines[1], "router", "--listen", f"tcp/{lab.machines[1].ip}:7447")
        await start(lab, "--connect", address)
        await until(router, "robot: realizer is here")
        play = await engage(lab.machines[3], "play", str(block), "--connect", address)
        told, _ = await asyncio.wait_for(play.communicate(), LONG)
        assert play.returncode == 0, told.decode()
        assert "block b1: done" in told.decode()
        await until(waiting, "b1")


async def test_three_machines_that_connect_to_one_service_that_listens(tmp_path: Path) -> None:
    block = tmp_path / "block.xml"
    block.write_text(BML)
    async with laboratory(tmp_path, seed=1) as lab:
        address = f"tcp/{lab.machines[1].ip}:7447"
        control = await engage(lab.machines[1], "run", "control", "--listen", address)
        await until(control, "control is ready")
        for name, number in (("realizer", 1), ("generation", 2), ("recognition", 2), ("simulation", 3)):
            await until(await engage(lab.machines[number], "run", name, "--connect", address), f"{name} is ready")
        play = await engage(lab.machines[3], "play", str(block), "--connect", address)
        told, _ = await asyncio.wait_for(play.communicate(), LONG)
        assert play.returncode == 0, told.decode()


async def test_a_peer_that_nobody_can_reach_is_named_with_the_reason(tmp_path: Path) -> None:
    async with laboratory(tmp_path, machines=(1, 2), seed=1) as lab:
        one, two = lab.machines.values()
        address = f"tcp/{one.ip}:7447"
        await until(await engage(one, "run", "control", "--listen", address), "control is ready")
        realizer = await engage(one, "run", "realizer", "--connect", address, "--mode", "peer")
        await until(realizer, "realizer is ready")
        generation = await engage(two, "run", "generation", "--connect", address, "--mode", "peer")
        told = await until(generation, "nobody here sees recognition")
        assert "realizer cannot be seen from here, though control can see it: it listens on 127.0.0.1 only" in told

"""`engage up --in-one`: all services in one process; it does what the processes do, and one that crashes ends all."""

import asyncio
from functools import partial
from pathlib import Path

import pytest
from rich.console import Console

from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.robot.up import TASK, in_one
from engage_hri.services.runtime.service import Ready
from tests.bus.places import free_endpoint
from tests.cli.command import GOOD_BLOCK, closed, start
from tests.cli.test_processes import PATIENCE, children, line, stopped, strangers


@pytest.mark.real_time
async def test_it_performs_what_is_played_in_one_process_and_ends_with_ctrl_c(tmp_path: Path) -> None:
    (tmp_path / "block.xml").write_text(GOOD_BLOCK)
    endpoint = free_endpoint()
    where = ("--robot", "one", "--connect", endpoint)
    up = await start("up", "--in-one", "--robot", "one", "--listen", endpoint)
    try:
        await line(up, "all services are up", log=False)
        told = []
        for command in (("play", *where, tmp_path / "block.xml"), ("up", *where), ("run", "control", *where)):
            process = await start(*command)
            async with asyncio.timeout(PATIENCE):
                out, err = await process.communicate()
            told.append((process.returncode, out.decode() + err.decode()))

        assert [code for code, _ in told] == [0, 75, 75]
        assert "block hello: done" in told[0][1]
        assert all("robot 'one' has this on the bus already" in text for _, text in told[1:])
        assert children(up.pid) == []
        assert await strangers(up.pid) == []
    finally:
        code = await stopped(up)

    assert code == 0


@pytest.mark.real_time
async def test_with_keys_each_service_in_the_process_has_its_own(tmp_path: Path) -> None:
    router, services, alice = await closed(tmp_path)
    (tmp_path / "block.xml").write_text(GOOD_BLOCK)
    up = await start("up", "--in-one", *services)
    try:
        await line(up, "all services are up", log=False)
        play = await start("play", *alice, tmp_path / "block.xml")
        async with asyncio.timeout(PATIENCE):
            out, _ = await play.communicate()

        assert play.returncode == 0
        assert b"block hello: done" in out
        assert children(up.pid) == []
    finally:
        codes = [await stopped(each) for each in (up, router)]

    assert codes == [0, 0]


@pytest.mark.real_time
async def test_the_keys_of_one_holder_are_not_those_of_the_services(tmp_path: Path) -> None:
    router, _, alice = await closed(tmp_path)
    up = await start("up", "--in-one", *alice)
    try:
        async with asyncio.timeout(PATIENCE):
            _, err = await up.communicate()
    finally:
        await stopped(router)

    assert up.returncode == 2
    assert "up: the keys are those of 'alice', not of 'up'" in err.decode()


async def lives(bus: Bus, ready: Ready, *, seconds: float, fails: bool = False) -> None:
    ready()
    await asyncio.sleep(seconds)
    if fails:
        raise KeyError("lost")


async def test_the_task_is_over_when_its_service_ends() -> None:
    services = {"control": partial(lives, seconds=100.0), TASK: partial(lives, seconds=7.0)}
    loop = asyncio.get_running_loop()
    async with MemoryHub() as hub, in_one(services, dict.fromkeys(services, hub), Console(quiet=True)) as over:
        await over.wait()

        assert loop.time() == pytest.approx(7.0, abs=0.5)


async def test_a_service_that_crashes_ends_all() -> None:
    services = {"control": partial(lives, seconds=100.0), "realizer": partial(lives, seconds=7.0, fails=True)}
    with pytest.raises(ExceptionGroup) as raised:
        async with MemoryHub() as hub, in_one(services, dict.fromkeys(services, hub), Console(quiet=True)) as over:
            await over.wait()

    assert raised.group_contains(KeyError, match="lost", depth=1)

"""`engage steer` beside a realizer of its own process, over real sockets. The test itself is the body."""

import asyncio
import re
from asyncio.subprocess import Process
from pathlib import Path
from types import ModuleType

import pytest

from engage_hri.schemas.behaviors import Gesture
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.robot import connect
from engage_hri.services.commandline.bodies import fault
from engage_hri.services.commandline.shell.process import UNREADY
from engage_hri.services.commandline.talk import play, steer
from tests.bus.places import free_endpoint
from tests.cli.command import GOOD_BLOCK, Engage, start
from tests.cli.test_processes import PATIENCE, line, stopped
from tests.realizer.fake_body import FakeBody

pytestmark = pytest.mark.real_time
BEAT = Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND")


async def said(process: Process) -> tuple[int, str, str]:
    out, err = await asyncio.wait_for(process.communicate(), PATIENCE)
    assert process.returncode is not None
    return process.returncode, out.decode().strip(), err.decode().strip()


@pytest.mark.parametrize("module", [fault, play, steer], ids=lambda module: module.__name__)
@pytest.mark.parametrize(
    ("mode", "reason"), [("auto", "no process answers at {}"), ("client", "no router answers at {}")]
)
def test_who_asks_a_running_robot_once_names_what_cannot_be_reached_and_may_try_again(
    engage: Engage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: ModuleType, mode: str, reason: str
) -> None:
    monkeypatch.setattr(module, "PATIENCE", 0.1)
    endpoint, file = free_endpoint(), tmp_path / "block.xml"
    file.write_text(GOOD_BLOCK)
    name = module.__name__.rpartition(".")[2]
    asked: dict[str, list[object]] = {"fault": ["list"], "play": [file], "steer": ["hold"]}

    told = engage(name, *asked[name], "--connect", endpoint, "--mode", mode)

    assert (told.code, told.out) == (UNREADY, "")
    (line,) = told.err.splitlines()
    assert line.startswith(reason.format(endpoint))


async def test_a_robot_is_held_goes_on_and_is_stopped_from_the_command_line() -> None:
    endpoint = free_endpoint()
    where = ("--robot", "steered", "--connect", endpoint)
    async with await open_hub("steered", listen=[endpoint]) as hub, connect(hub=hub) as robot:
        body = asyncio.create_task(FakeBody().serve(hub.join("control"), lambda: None))
        realizer = await start("run", "realizer", *where)
        try:
            await line(realizer, "realizer is ready")
            assert await said(await start("steer", "hold", *where)) == (
                0, "held: nothing is being performed; so is what comes, until `engage steer continue`", ""
            )  # fmt: skip
            with robot.feedback() as feedback:
                performing = asyncio.create_task(robot.realize("b", [BEAT]))
                assert await feedback.next(PATIENCE) is not None
            assert await said(await start("steer", "continue", "b", *where)) == (
                2, "",
                "b: still held, because the whole robot is "
                "(let the robot go on: `engage steer continue`, or `resume()`)",
            )  # fmt: skip
            code, _, error = await said(await start("steer", "hold", "b", "wave", *where))
            assert (code, error) == (
                2,
                "b: wave: it is not being performed: block 'b' has no behavior 'wave' (known: beat)",
            )
            assert not performing.done()  # the robot is held still
            assert await said(await start("steer", "continue", *where)) == (0, "continued: b", "")
            assert (await asyncio.wait_for(performing, PATIENCE)).status == "done"
        finally:
            await stopped(realizer)
            body.cancel()
            await asyncio.gather(body, return_exceptions=True)


async def test_who_plays_is_told_what_is_held_and_that_it_was_stopped(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    where = ("--robot", "steered", "--connect", endpoint)
    (tmp_path / "b.xml").write_text('<bml id="b"><wait id="w" duration="60" start="0"/></bml>')
    async with await open_hub("steered", listen=[endpoint]) as hub, connect(hub=hub) as robot:
        body = asyncio.create_task(FakeBody().serve(hub.join("control"), lambda: None))
        realizer = await start("run", "realizer", *where)
        try:
            await line(realizer, "realizer is ready")
            assert await robot.hold() == ()  # before it comes
            play = await start("play", tmp_path / "b.xml", *where, "--verbose")
            held = await line(play, "held: everything", log=False)
            assert re.search(r"held: everything, for \S+ s already and for at most \S+ s", held)
            await robot.resume()
            begun = [await line(play, "", log=False) for _ in range(2)]  # in any order
            assert any("no longer held: everything" in each for each in begun)
            assert any("b:w:start" in each for each in begun)
            await robot.hold("b", "w")
            assert "held: b: w, for at most 60.00 s" in await line(play, "held", log=False)
            await robot.stop("b")
            code, out, error = await said(play)
        finally:
            await stopped(realizer)
            body.cancel()
            await asyncio.gather(body, return_exceptions=True)

    assert "no longer held: b: w" in out
    assert (code, error) == (3, f"{tmp_path / 'b.xml'}: b was interrupted: stopped on request")


async def test_a_behavior_without_a_block_is_refused() -> None:
    code, _, error = await said(await start("steer", "stop", "", "wave"))

    assert (code, error) == (2, "wave: a behavior without its block")

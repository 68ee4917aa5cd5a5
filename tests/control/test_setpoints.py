"""Robots that take set points, and commands that are coroutines."""

import asyncio

import pytest

from engage_hri import SetPointBody
from engage_hri.schemas.behaviors import Gaze
from engage_hri.schemas.faults import Fault
from engage_hri.services.control.contract.body import Body, BodyFailed
from engage_hri.services.control.testing import WORLD, BodyContract, Stage, performed
from tests.control.test_docs import SET_POINTS, driver
from tests.random_cases import trials
from tests.test_examples import EXAMPLES, example

LOOK = Gaze(id="look", target="near-right")


def robot() -> SetPointBody:
    body = example("set_point_robot").SetPointRobot()
    assert isinstance(body, SetPointBody)
    return body


class TestSetPoints(BodyContract):
    seeds = trials()
    tolerance = 0.1

    def make(self) -> Body:
        return robot()


class Awaited(driver().PanTilt):  # type: ignore[misc]
    """Its SDK takes a while for each command, and is not to be asked for two at once."""

    settling = 0.07

    def __init__(self) -> None:
        super().__init__()
        self.under_way = 0
        self.sent: list[float] = []

    async def go(self, goal: dict[str, float], seconds: float) -> None:
        self.under_way += 1
        assert self.under_way == 1
        await asyncio.sleep(0.02)
        self.under_way -= 1
        self.sent.append(goal["pan"])
        super().go(goal, seconds)


class TestAwaited(BodyContract):
    seeds = trials()
    tolerance = 0.15

    def make(self) -> Body:
        return Awaited()


def test_the_example_is_short_and_the_page_shows_it():
    text = (EXAMPLES / "set_point_robot.py").read_text(encoding="utf-8")
    assert len([line for line in text.splitlines() if line.strip()]) <= 25
    shown, left_out, rest = SET_POINTS.partition("    ...")
    assert shown in text.replace(text[text.index("    name,") : text.index("    async def open")], "")
    assert left_out
    assert "class" not in rest


async def test_of_commands_that_come_while_one_is_under_way_the_last_one_is_sent() -> None:
    body = Awaited()
    async with body.connected():
        body.see(WORLD)
        for target in ("near-right", "far-left", "human"):
            Stage(body, Gaze(id=target, target=target))
            await asyncio.sleep(0.005)
        await asyncio.sleep(1.0)
        await Stage.end_all()

    first, then = (body.aim(Gaze(id="a", target=target), WORLD)["pan"] for target in ("near-right", "human"))
    assert body.sent[:2] == [first, then]


async def test_a_command_that_the_sdk_refuses_later_fails_the_behavior() -> None:
    class Unplugged(Awaited):
        async def go(self, goal: dict[str, float], seconds: float) -> None:
            await asyncio.sleep(0.05)
            raise BodyFailed(Fault(reason="no answer from the port"))

    body = Unplugged()
    async with body.connected():
        body.see(WORLD)
        with pytest.raises(BodyFailed, match="no answer from the port"):
            await performed(body, LOOK)


@pytest.mark.parametrize("error", [BodyFailed(Fault(reason="the bus is off")), ZeroDivisionError("the bus is off")])
async def test_a_set_point_that_is_not_taken_fails_the_behavior(error: Exception) -> None:
    body = robot()
    async with body.connected():
        body.see(WORLD)
        body.send = lambda angles: (_ for _ in ()).throw(error)  # type: ignore[method-assign]
        with pytest.raises(type(error), match="the bus is off"):
            await performed(body, LOOK)


async def test_a_robot_that_stands_is_sent_no_set_points() -> None:
    body, sent = robot(), list[float]()
    taken = body.send
    body.send = lambda angles: (sent.append(angles["pan"]), taken(angles))[1]  # type: ignore[method-assign]
    async with body.connected():
        body.see(WORLD)
        await performed(body, LOOK)
        assert sent[-1] == pytest.approx(0.0, abs=1e-9)  # at home again

        count = len(sent)
        await asyncio.sleep(10.0)
        assert len(sent) == count

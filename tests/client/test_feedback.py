"""Feedback through the client: from now on, or with what was told just before."""

import asyncio

from engage_hri.schemas.blocks import BlockProgress
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.runtime.service import Ready, running
from tests.realizer.fake_body import FakeBody

GREETING = '<bml id="greeting"><gesture id="wave" lexeme="WAVE"/><wait id="pause" duration="20"/></bml>'


async def greeted(robot: Robot) -> str:
    """Hold what has begun, as docs/commands.md does, and stop it."""
    with robot.feedback() as feedback:
        performing = asyncio.create_task(robot.realize(GREETING))
        while (told := await feedback.next()) is not None and told.block != "greeting":
            pass
    await robot.hold("greeting", "wave")
    await robot.stop("greeting")
    return (await performing).status


async def test_who_follows_feedback_is_told_nothing_of_what_was_before(hub: MemoryHub) -> None:
    async def realizer(bus: Bus, ready: Ready) -> None:
        await realize(bus, ready, RealizerConfig())

    async with running(hub, {"control": FakeBody().serve, "realizer": realizer}), connect(hub=hub) as robot:
        assert [await greeted(robot) for _ in range(3)] == ["interrupted"] * 3
        with robot.feedback() as new, robot.feedback(past=True) as all:
            assert await new.next(0.5) is None
            first = await all.next(0.5)

    assert isinstance(first, BlockProgress)
    assert (first.block, first.progress) == ("greeting", "start")

"""What is told of holds: on the bus, from the beginning and to who comes late; and when one lasts too long."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture, Speech, Wait
from engage_hri.schemas.blocks import Block, BlockOutcome, Held
from engage_hri.services.realizer.config import RealizerConfig
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import Stage, block, stage
from tests.realizer.test_holding import BEAT, STORY, steered

LONG = Wait(id="w", duration=30.0)


class Told(list[tuple[float, list[tuple[str, str, float, float]]]]):
    """Everything told of holds: when, and of each its block, its behavior, since when and until when."""

    @property
    def names(self) -> list[list[tuple[str, str]]]:
        return [[each[:2] for each in holds] for _, holds in self]


@asynccontextmanager
async def listening(seen: Stage) -> AsyncIterator[Told]:
    told, bus = Told(), seen.hub.join("listener")

    async def listen() -> None:
        async for received in inbox:
            message = received.message
            assert isinstance(message, Held)
            holds = [(each.block, each.behavior, each.since.seconds, each.until.seconds) for each in message.holds]
            told.append((message.at.seconds, holds))

    with bus.subscribe(keys.HELD) as inbox:
        task = asyncio.create_task(listen())
        try:
            yield told
            await asyncio.sleep(0.1)
        finally:
            task.cancel()
            await asyncio.wait([task])


async def test_each_change_of_what_is_held_is_told_with_its_times() -> None:
    async with stage(config=RealizerConfig(longest_hold=20.0)) as seen, listening(seen) as told:
        performing = seen.ask(block((BEAT, LONG)))
        await asyncio.sleep(1.0)
        await steered(seen, "hold", "b", "w")
        await asyncio.sleep(1.0)
        await steered(seen, "hold", "b", "w")  # it is held already
        await steered(seen, "hold")
        await asyncio.sleep(1.0)
        await steered(seen, "continue", "b")  # the robot is held still
        await asyncio.sleep(1.0)
        await steered(seen, "continue")
        await performing.outcome

    assert told == [
        (0.0, []),
        (1.0, [("b", "w", 1.0, 21.0)]),
        (2.0, [("b", "w", 1.0, 21.0), ("", "", 2.0, 22.0)]),
        (3.0, [("", "", 2.0, 22.0)]),
        (4.0, []),
    ]


async def test_who_comes_late_is_told_what_is_held() -> None:
    async with stage() as seen:
        await steered(seen, "hold")
        await asyncio.sleep(10.0)
        async with listening(seen) as told:
            await asyncio.sleep(1.0)

    assert told.names == [[("", "")]]


@pytest.mark.parametrize("way", ["stopped", "it has failed"])
async def test_a_hold_ends_with_what_it_holds(way: str) -> None:
    fails = FakeBody({"beat": Script(fail="stroke_end")})
    async with stage(None if way == "stopped" else fails) as seen, listening(seen) as told:
        performing = seen.ask(block((BEAT, Wait(id="w", duration=2.0))))
        await asyncio.sleep(0.5)
        if way == "stopped":
            await steered(seen, "hold", "b")
            await steered(seen, "stop", "b")
        else:
            await asyncio.sleep(0.8)  # on its way to where it fails
            await steered(seen, "hold", "b", "beat")
        await performing.outcome

    assert told.names == [[], [("b", "" if way == "stopped" else "beat")], []]


# -- held for too long -----------------------------------------------------------------------------------------------

REASON = "held for 7 s, the longest time (`realizer.longest_hold`)"


async def test_a_robot_that_performs_nothing_is_told_to_be_held_no_longer() -> None:
    async with stage(config=RealizerConfig(longest_hold=7.0)) as seen, listening(seen) as told:
        await asyncio.sleep(1.0)
        await steered(seen, "hold")
        await asyncio.sleep(20.0)
        assert (await seen.perform(block((BEAT,)))).status == "done"

    (warning,) = seen.warnings()
    assert (warning.kind, warning.block, warning.behavior) == ("INTERRUPTED", None, "")
    assert warning.message == f"the robot was {REASON}: what comes is performed again"
    assert warning.at is not None
    assert warning.at.seconds == pytest.approx(8.0)
    assert told[-1] == (pytest.approx(8.0), [])


@pytest.mark.parametrize("name", ["", "b"])
async def test_a_block_that_was_held_for_too_long_ends_with_one_warning(name: str) -> None:
    async with stage(config=RealizerConfig(longest_hold=7.0)) as seen:
        performing = seen.ask(block((BEAT, LONG)))
        await asyncio.sleep(1.0)
        await steered(seen, "hold", name)
        outcome = await performing.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "interrupted"
    assert outcome.fault is not None
    assert outcome.fault.reason == REASON
    (warning,) = seen.warnings()
    assert (warning.kind, warning.block) == ("INTERRUPTED", name or None)
    assert REASON in warning.message


async def test_a_block_that_waits_for_its_turn_and_was_held_for_too_long_is_told_of() -> None:
    waiting = Block(id="c", behaviors=(BEAT,), composition="APPEND")
    async with stage(config=RealizerConfig(longest_hold=7.0)) as seen:
        first, second = seen.ask(block((LONG,))), seen.ask(waiting)
        await asyncio.sleep(1.0)
        await steered(seen, "hold", "c")
        outcome = await second.outcome
        await first.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "interrupted"
    assert [(each.kind, each.block, each.message) for each in seen.warnings()] == [("INTERRUPTED", "c", REASON)]


@pytest.mark.parametrize(("behavior", "since", "said"), [(BEAT, 0.2, ""), (STORY, 1.5, ", after 'one'")])
async def test_a_behavior_that_was_held_for_too_long_is_told_once_with_the_reason(
    behavior: Gesture | Speech, since: float, said: str
) -> None:
    async with stage(config=RealizerConfig(longest_hold=7.0)) as seen:
        performing = seen.ask(block((behavior, LONG)))
        await asyncio.sleep(since)
        await steered(seen, "hold", "b", behavior.id)
        await performing.outcome

    warnings = [(each.kind, each.behavior, each.message) for each in seen.warnings()]
    assert warnings == [("INTERRUPTED", behavior.id, f"{REASON}{said}")]

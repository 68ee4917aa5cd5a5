"""Fixed times between instants: the longest counts, they stop while a behavior is held, and a new plan keeps them."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Gesture, Head, Wait
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.planning import timed
from tests.realizer.stage import after, block, stage
from tests.realizer.test_holding import steered

NOD = Head(id="n", lexeme="NOD")
SHORT, LONG = Wait(id="v", duration=1.0), Wait(id="w", duration=2.0)


@pytest.mark.parametrize(("short", "long", "start"), [("+3", "", 4.0), ("", "+3", 5.0), ("+1.5", "+0.25", 2.5)])
async def test_who_comes_after_two_comes_when_the_last_of_the_two_times_is_over(
    short: str, long: str, start: float
) -> None:
    example = block(
        (SHORT, timed(LONG, start="0"), NOD), after(f"v:end{short}", "n:start"), after(f"w:end{long}", "n:start")
    )
    async with stage() as seen:
        await seen.perform(example)

    assert seen.times()["n:start"] == start


@pytest.mark.parametrize("held", ["", "n"])
async def test_a_time_that_has_begun_goes_on_where_it_was_stopped(held: str) -> None:
    """Of three seconds one is over; the block, or who is to begin after them, is held for ten."""
    async with stage() as seen:
        performing = seen.ask(block((SHORT, NOD), after("v:end+3", "n:start")))
        await asyncio.sleep(2.0)
        await steered(seen, "hold", "b", held)
        await asyncio.sleep(10.0)
        await steered(seen, "continue", "b", held)
        await performing.outcome

    assert seen.times()["n:start"] == pytest.approx(14.0)
    assert seen.warnings() == []


async def test_a_time_that_was_over_before_a_hold_is_not_prolonged_by_it_in_the_next_plan() -> None:
    """The gesture began at 2 s, was held from 3 s to 4 s, and what is to come is planned again at 6 s."""
    beat = timed(Gesture(id="beat", lexeme="BEAT", mode="RIGHT_HAND"), start="v:end+1")
    later = timed(LONG, start="beat:start+20")
    async with stage(FakeBody({"n": Script(fail="ready")})) as seen:
        performing = seen.ask(block((SHORT, beat, later, timed(NOD, start="5.75"))))
        await asyncio.sleep(3.0)
        await steered(seen, "hold", "b", "beat")
        await asyncio.sleep(1.0)
        await steered(seen, "continue", "b", "beat")
        await performing.outcome

    assert [each.behavior for each in seen.warnings()] == ["n"]
    assert seen.times()["beat:start"] == 2.0
    assert seen.times()["w:start"] == pytest.approx(22.0)

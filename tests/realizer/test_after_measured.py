"""What `after` asks for: to wait until the other point was measured, before the point if one cannot wait there."""

import pytest

from engage_hri.schemas.behaviors import Gesture, Speech, Wait
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import after, block, stage, together
from tests.realizer.test_sharing import instants

BEAT = Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND")
"""From stroke_start, where it can wait, half a second to its stroke."""
SLOW = Speech(id="x", text="slow")
"""A second by its estimate."""
WORDS = Speech(id="s", text="there")


@pytest.mark.parametrize("slow", [1.0, 3.0, 4.5])
async def test_a_stroke_after_words_of_its_block_is_not_made_while_these_are_still_said(slow: float) -> None:
    async with stage(FakeBody({"x": Script(slow=slow)})) as seen:
        assert (await seen.perform(block((SLOW, BEAT), after("x:end", "g:stroke")))).status == "done"

    assert seen.times()["x:end"] == slow
    assert seen.times()["g:stroke"] >= slow


@pytest.mark.parametrize("slow", [1.0, 3.0, 4.5])
async def test_also_if_who_can_wait_shares_the_instant_of_the_stroke(slow: float) -> None:
    """The words wait at their start, but the stroke cannot wait for them there: so it waits before."""
    shared = block((SLOW, BEAT, WORDS), after("x:end", "g:stroke"), together("g:stroke", "s:start"))
    async with stage(FakeBody({"x": Script(slow=slow)})) as seen:
        assert (await seen.perform(shared)).status == "done"

    times = seen.times()
    assert times["g:stroke"] == times["s:start"] >= slow == times["x:end"]


@pytest.mark.parametrize("slow", [1.0, 3.0, 4.5])
async def test_a_stroke_after_words_of_another_block_is_not_made_while_these_are_still_said(slow: float) -> None:
    async with stage(FakeBody({"x": Script(slow=slow)})) as seen:
        first = seen.ask(block((SLOW, Wait(id="w", duration=8.0)), id="one"))
        await seen.seen("x:start", "one")
        assert (await seen.perform(block((BEAT,), after("one:x:end", "g:stroke"), id="two"))).status == "done"
        await first.outcome

    times = instants(seen)
    assert times["one:x:end"] == slow
    assert times["two:g:stroke"] >= slow

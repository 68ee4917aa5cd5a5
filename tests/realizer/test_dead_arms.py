"""Arms that stand still for ever: each is given up in its own time, whatever else is late for the same reason."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Gesture, Speech
from engage_hri.schemas.blocks import WarningFeedback
from engage_hri.services.control.config import Stall, Variability
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.decisions import STALL_FACTOR
from tests.realizer.planning import timed
from tests.realizer.stage import block, together
from tests.realizer.test_simulated_body import robot

RIGHT = Gesture(id="r", lexeme="BEAT", mode="RIGHT_HAND")
LEFT = Gesture(id="l", lexeme="BEAT", mode="LEFT_HAND")
CONFIG = RealizerConfig()
LIMIT = CONFIG.stall + (STALL_FACTOR + 2.0) * 0.6
"""Most seconds after the time it was to come until an arm is given up.

No phase of a beat takes 0.6 s, nor is it asked to take more than twice as long.
"""
SETTLED = 3.0
"""Seconds in which an arm that was given up is home."""


@pytest.mark.parametrize("before", ["stroke_start", "stroke", "stroke_end", "relax", "end"])
@pytest.mark.parametrize("end", [2.2, 2.5, 3.5])
async def test_an_arm_that_is_to_end_at_a_fixed_time(before: str, end: float) -> None:
    """It is told to be slower so as to meet the time, but not for being late itself."""
    async with robot(Variability(stall=(Stall(part="right_arm", before=before),))) as seen:
        async with asyncio.timeout(60.0):
            outcome = await seen.ask(block((timed(RIGHT, end=str(end)),))).outcome
        taken = asyncio.get_running_loop().time()
    assert seen.kinds() == ["LATE", "EXECUTION_FAILURE"]
    assert outcome.dropped == ("r",)
    assert taken <= end + LIMIT + SETTLED


@pytest.mark.parametrize("before", ["stroke_start", "stroke", "stroke_end", "relax"])
async def test_two_that_are_tied_to_each_other(before: str) -> None:
    """That one is late for the other is no reason to wait for both for ever."""
    stalls = tuple(Stall(part=part, before=before) for part in ("right_arm", "left_arm"))
    tied = [together(f"r:{sync}", f"l:{sync}") for sync in ("stroke_start", "stroke", "stroke_end", "relax")]
    async with robot(Variability(stall=stalls)) as seen:
        async with asyncio.timeout(60.0):
            outcome = await seen.ask(block((RIGHT, LEFT), *tied)).outcome
        taken = asyncio.get_running_loop().time()
    assert sorted(seen.kinds()) == ["EXECUTION_FAILURE", "EXECUTION_FAILURE", "LATE", "LATE"]
    assert sorted(outcome.dropped) == ["l", "r"]
    assert taken <= 2.5 + 2 * LIMIT + SETTLED


async def test_an_arm_that_comes_after_all_is_told_with_the_constraint_and_by_how_much() -> None:
    """That it is overdue was told before; by how much it came too late nobody knew then."""
    words = Speech(id="s", text="this one here, please")
    beat = timed(Gesture(id="r", lexeme="BEAT", mode="RIGHT_HAND", line=7), stroke="s:end")
    stall = Stall(part="right_arm", before="stroke", seconds=1.5)
    async with robot(Variability(stall=(stall,))) as seen:
        await seen.perform(block((words, beat)))

    late = [each.message for each in seen.feedback if isinstance(each, WarningFeedback)]
    times = seen.times()
    skew = times["r:stroke"].at.seconds - times["s:end"].at.seconds
    assert skew > 1.0
    assert len(late) == 2
    assert "overdue" in late[0]
    assert late[1].endswith(f"stroke came {skew:.2f} s later than it should be: r:stroke = s:end")


@pytest.mark.parametrize("seconds", [0.8, 1.5, None])
async def test_the_next_words_follow_the_words_before_and_not_the_arm_that_is_tied_to_their_end(
    seconds: float | None,
) -> None:
    """The transition fires with the arm, but the voice is free after its last word: nothing ties the rest to it."""
    words = (Speech(id="s", text="this one here, please"), Speech(id="t", text="and that one"))
    beat = timed(RIGHT, stroke="s:end")
    stall = Stall(part="right_arm", before="stroke", seconds=seconds)
    async with robot(Variability(stall=(stall,))) as seen:
        async with asyncio.timeout(60.0):
            await seen.ask(block((words[0], beat, words[1]))).outcome

    times = {name: each.at.seconds for name, each in seen.times().items()}
    assert times["t:start"] == pytest.approx(times["s:end"], abs=0.05)
    assert seconds is None or times["r:stroke"] > times["t:start"] + 0.5


async def test_who_is_tied_to_that_arm_waits_for_it() -> None:
    words = Speech(id="s", text="this one here, please")
    tied = timed(Speech(id="t", text="and that one"), start="r:stroke")
    stall = Stall(part="right_arm", before="stroke", seconds=1.5)
    async with robot(Variability(stall=(stall,))) as seen:
        await seen.perform(block((words, timed(RIGHT, stroke="s:end"), tied)))

    times = {name: each.at.seconds for name, each in seen.times().items()}
    assert times["t:start"] >= times["r:stroke"] > times["s:end"] + 1.0

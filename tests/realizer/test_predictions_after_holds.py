"""Predictions after a hold: as soon as what was held goes on, and not while it is held."""

import asyncio

import pytest

from engage_hri.schemas.behaviors import Head, Speech, Wait
from engage_hri.schemas.blocks import PredictionFeedback, SyncPointProgress
from engage_hri.services.control.config import Variability
from tests.realizer.planning import timed
from tests.realizer.stage import Stage, after, block, stage
from tests.realizer.steering import steered
from tests.realizer.test_holding import BEAT, STORY
from tests.realizer.test_simulated_body import robot

LONG = Wait(id="w", duration=5.0)


def predictions(seen: Stage, name: str = "b") -> list[dict[str, float]]:
    told = [each for each in seen.feedback if isinstance(each, PredictionFeedback) and each.block == name]
    return [{f"{point.behavior}:{point.sync}": point.time for point in each.points} for each in told]


@pytest.mark.parametrize("held", [("", ""), ("b", ""), ("b", "w")])
async def test_when_what_was_held_goes_on_its_points_are_predicted_anew_and_not_before(held: tuple[str, str]) -> None:
    async with stage() as seen:
        performing = seen.ask(block((LONG,)))
        await asyncio.sleep(1.0)
        await steered(seen, "hold", *held)
        await asyncio.sleep(1.5)
        assert predictions(seen) == [{"w:start": 0.0, "w:end": 5.0}]
        await steered(seen, "continue", *held)
        await asyncio.sleep(0.1)
        assert predictions(seen)[1:] == [{"w:end": pytest.approx(6.5)}]
        await performing.outcome

    assert len(predictions(seen)) == 2
    (end,) = [each for each in seen.feedback if isinstance(each, SyncPointProgress) and each.sync == "end"]
    assert end.time == pytest.approx(6.5)
    assert end.predicted == pytest.approx(6.5)


async def test_what_comes_after_it_is_predicted_anew_in_other_blocks_too() -> None:
    there = Speech(id="t", text="so")
    async with stage() as seen:
        made = block((LONG, BEAT), after("w:end", "beat:start"))
        asked = [seen.ask(made), seen.ask(block((timed(there, start="b:beat:end"),), id="c"))]
        await asyncio.sleep(1.0)
        await steered(seen, "hold", "b", "w")
        await asyncio.sleep(3.0)
        before = len(predictions(seen)), len(predictions(seen, "c"))
        await steered(seen, "continue", "b", "w")
        await asyncio.sleep(0.1)
        assert (len(predictions(seen)), len(predictions(seen, "c"))) == (before[0] + 1, before[1] + 1)
        assert predictions(seen)[-1]["beat:end"] == pytest.approx(5.0 + 3.0 + 2.25)
        assert predictions(seen, "c")[-1]["t:start"] == pytest.approx(5.0 + 3.0 + 2.25)
        await asyncio.gather(*(each.outcome for each in asked))

    assert seen.times()["beat:end"] == pytest.approx(10.25)


async def test_who_was_held_and_is_late_by_nothing_is_not_predicted_again() -> None:
    """The gesture was on its way for as long as it was held, and has not stood anywhere."""
    async with stage() as seen:
        performing = seen.ask(block((BEAT, STORY)))
        await asyncio.sleep(0.05)
        await steered(seen, "hold", "b", "beat")
        await asyncio.sleep(0.4)
        await steered(seen, "continue", "b", "beat")
        await performing.outcome

    assert len(predictions(seen)) == 1


async def test_the_end_of_words_is_predicted_right_after_each_hold() -> None:
    """Each hold comes within a word, which is said to its end: the voice stands for less than the hold."""
    words = Speech(id="s", text="Good morning to all of you and welcome to this conversation.")
    nod = timed(Head(id="n", lexeme="NOD"), stroke="s:end")
    async with robot(Variability()) as seen:
        pending = seen.ask(block((words, nod)))
        for _ in range(3):
            await asyncio.sleep(0.55)
            await steered(seen, "hold", "b", "s")
            await asyncio.sleep(1.0)
            await steered(seen, "continue", "b", "s")
        await pending.outcome

    times = seen.times()
    assert times["s:end"].at.seconds == pytest.approx(times["n:stroke"].at.seconds, abs=0.001)
    assert times["s:end"].time == pytest.approx(times["s:end"].predicted, abs=0.001)

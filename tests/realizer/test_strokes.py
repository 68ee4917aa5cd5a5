"""`stroke:n` of a repeated movement: measured where the body tells of it, else in equal parts."""

import pytest

from engage_hri.schemas.behavior_types import SYNC_POINTS
from engage_hri.schemas.behaviors import Head, Wait
from engage_hri.schemas.blocks import BlockOutcome
from engage_hri.services.control.config import Slow, Variability
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import after, block, stage
from tests.realizer.test_simulated_body import robot

NODS = Head(id="n", lexeme="NOD", repetition=3)
MARK = Wait(id="w", duration=0.0)


@pytest.mark.parametrize(
    ("stroke", "seconds"), [("n:stroke", 0.52), ("n:stroke:1", 0.52), ("n:stroke:2", 1.16), ("n:stroke:3", 1.8)]
)
@pytest.mark.parametrize("slow", [1.0, 2.0])
async def test_the_stroke_of_the_simulated_body_is_when_the_head_is_there(stroke: str, seconds: float, slow: float):
    """Slow: nobody could have known by prediction."""
    async with robot(Variability(slow=(Slow(part="head", factor=slow),))) as seen:
        await seen.perform(block((NODS, MARK), after(stroke, "w:start")))

    assert seen.times()["w:start"].time == pytest.approx(slow * seconds)


async def test_feedback_tells_each_default_point_once_and_no_repetition():
    async with robot(Variability()) as seen:
        await seen.perform(block((NODS, MARK), after("n:stroke:2", "w:start")))

    told = [each.sync for each in seen.times().values() if each.behavior == "n"]
    assert told == list(SYNC_POINTS)
    assert seen.kinds() == []


async def test_a_hold_behind_the_last_stroke_is_asked_for_in_default_points():
    """The authority reaches as far as the strokes before the hold; bodies are told of points that all have."""
    async with robot(Variability()) as seen:
        outcome = await seen.perform(block((NODS, Wait(id="w", duration=5.0)), after("w:end", "n:stroke_end")))

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "done"
    assert seen.times()["n:stroke_end"].time == pytest.approx(5.0, abs=0.01)


async def test_what_the_body_does_not_tell_is_an_equal_part_after_the_measured_stroke():
    slow = FakeBody({"n": Script(slow=2.0)})
    async with stage(slow) as seen:
        await seen.perform(block((NODS, MARK), after("n:stroke:3", "w:start")))

    assert seen.times()["n:stroke"] == 1.0
    assert seen.times()["w:start"] == pytest.approx(1.0 + 0.25 * 2 / 3)

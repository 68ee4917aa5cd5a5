"""Another plan after a hold: it knows what the hold has stopped, so what it does not concern comes as without it."""

import asyncio
from collections.abc import Sequence

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, FaceLexeme, Gesture, Speech, Wait
from engage_hri.schemas.blocks import Block, BlockOutcome, PredictionFeedback
from engage_hri.services.realizer.config import RealizerConfig
from tests.realizer.fake_body import FakeBody
from tests.realizer.planning import timed
from tests.realizer.stage import Stage, before, block, stage, together
from tests.realizer.steering import interrupt, steered

LONG = Wait(id="w", duration=10.0)
WORDS = Speech(id="w", text="one two three four five six seven eight nine ten")
OTHER = Wait(id="z", duration=30.0)
"""A behavior that nothing has to do with, and that is interrupted: then all else is planned again."""
BEAT = Gesture(id="g", lexeme="BEAT", mode="LEFT_HAND")
SMILE, FROWN = FaceLexeme(id="y", lexeme="SMILE"), FaceLexeme(id="u", lexeme="OPEN_MOUTH")
LATER, SOONER = Speech(id="y", text="two"), Speech(id="u", text="one")


class Story:
    """What was performed: times of points by `block:behavior:sync`, outcomes, warnings but of interruptions."""

    def __init__(self, seen: Stage, began: float, outcomes: Sequence[BlockOutcome]) -> None:
        self.times = {
            f"{each.block}:{each.behavior}:{each.sync}": each.at.seconds - began
            for outcome in outcomes
            for each in seen.progress(outcome.id.removeprefix("r-"))
            if each.behavior != OTHER.id
        }
        self.dropped = {name for each in outcomes for name in each.dropped}
        self.warnings = [each.message for each in seen.warnings() if each.kind != "INTERRUPTED"]


async def performed(
    first: Block,
    *,
    held: tuple[str, str] = ("", ""),
    since: float = 1.0,
    until: float = 5.0,
    replanned: float | None = None,
    then: Block | None = None,
) -> Story:
    """What comes of a block that is held, and then planned again. then: a block that comes at that time, too."""
    async with stage(FakeBody(pauses=True), config=RealizerConfig(longest_hold=1000.0)) as seen:
        began, asked = asyncio.get_running_loop().time(), [seen.ask(first)]
        await asyncio.sleep(since)
        await steered(seen, "hold", *held)
        await asyncio.sleep(until - since)
        await steered(seen, "continue", *held)
        if replanned is not None:
            await asyncio.sleep(replanned - until)
            if OTHER.id in {each.id for each in first.behaviors}:
                await interrupt(seen.requests, first.id, OTHER.id).outcome
        if then is not None:
            asked.append(seen.ask(then))
        ended = [await each.outcome for each in asked]
    return Story(seen, began, [each for each in ended if isinstance(each, BlockOutcome)])


@pytest.mark.parametrize("held", [("", ""), ("b", ""), ("b", "w")])
@pytest.mark.parametrize(("running", "offset"), [(LONG, -0.5), (WORDS, 1.0)])
@pytest.mark.parametrize("sync", ["start", "stroke"])
async def test_what_was_under_way_has_stood_still_for_the_next_plan_too(
    running: BlockBehavior, offset: float, sync: str, held: tuple[str, str]
) -> None:
    tied = block((running, timed(BEAT, **{sync: f"w:end{offset:+}"}), OTHER))
    without, again = (
        await performed(tied, held=held, since=0.3),
        await performed(tied, held=held, since=0.3, replanned=5.2),
    )

    assert again.times[f"b:g:{sync}"] == pytest.approx(again.times["b:w:end"] + offset, abs=0.1)
    assert again.times == {point: pytest.approx(at, abs=0.01) for point, at in without.times.items()}
    assert again.warnings == []


@pytest.mark.parametrize(("running", "offset"), [(LONG, -0.5), (WORDS, 1.0)])
async def test_who_comes_later_is_told_the_same_of_what_has_stood_still(
    running: BlockBehavior, offset: float
) -> None:
    tied = block((timed(BEAT, start=f"b:w:end{offset:+}"),), id="c")
    story = await performed(block((running,)), since=0.3, replanned=5.2, then=tied)

    assert story.times["c:g:start"] == pytest.approx(story.times["b:w:end"] + offset, abs=0.1)
    assert story.warnings == []


@pytest.mark.parametrize("held", [("", ""), ("b", "")])
@pytest.mark.parametrize(("later", "sooner"), [(SMILE, FROWN), (LATER, SOONER)])
async def test_times_that_have_yet_to_come_are_later_by_the_hold_and_nothing_changes_places(
    later: BlockBehavior, sooner: BlockBehavior, held: tuple[str, str]
) -> None:
    made = block((timed(later, start="3"), timed(sooner, start="1"), OTHER))
    story = await performed(made, since=0.2, until=5.2, held=held, replanned=5.4)

    assert story.dropped == set()
    assert story.warnings == []
    assert story.times["b:u:start"] == pytest.approx(6.0)
    assert story.times["b:y:start"] == pytest.approx(8.0)


@pytest.mark.parametrize("held", [("", ""), ("b", ""), ("b", "w")])
async def test_an_upper_bound_that_a_hold_has_made_impossible_costs_nothing(held: tuple[str, str]) -> None:
    for made in (
        block((timed(LONG, start="1"), OTHER), before("12", "w:end")),
        block((timed(LONG, start="2", end="12"), OTHER)),
        block((LONG, OTHER), together("w:end", "10")),
    ):
        without, again = await performed(made, held=held), await performed(made, held=held, replanned=5.2)
        assert again.times == {point: pytest.approx(at, abs=0.01) for point, at in without.times.items()}
        assert again.dropped == set()
        assert again.warnings == without.warnings


async def test_predictions_do_not_jump_back_when_it_is_planned_again() -> None:
    async with stage() as seen:
        asked = seen.ask(block((LONG, OTHER, timed(BEAT, start="w:end"))))
        await asyncio.sleep(1.0)
        await steered(seen, "hold")
        await asyncio.sleep(4.0)
        await steered(seen, "continue")
        await asyncio.sleep(0.2)
        await interrupt(seen.requests, "b", OTHER.id).outcome
        await asked.outcome

    told = [each for each in seen.feedback if isinstance(each, PredictionFeedback)]
    ends = [point.time for each in told for point in each.points if (point.behavior, point.sync) == ("w", "end")]
    assert ends[1:] == [pytest.approx(14.0)] * len(ends[1:])

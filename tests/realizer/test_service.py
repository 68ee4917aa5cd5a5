"""The realizer as others meet it: refusals, several blocks at once, composition, feedback."""

import asyncio
import gc

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, GazeShift, Mark, Pointing, Speech, Timing, Wait
from engage_hri.schemas.blocks import BlockProgress, PerformBlock, PredictionFeedback
from engage_hri.services.realizer.perform.performance import BlockPerformance
from engage_hri.services.realizer.together import planning
from engage_hri.services.requests.ends import RequestRefused
from tests.bus.faulty import Faults, FaultyHub
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import after, block, stage, together

STORY = Speech(id="s", text="one two", marks=(Mark("m", 3),))


async def test_a_refused_block_moves_nothing_and_the_next_is_performed() -> None:
    async with stage() as seen:
        with pytest.raises(RequestRefused, match="bad: constraint-1: unknown behavior 'nobody'"):
            await seen.ask(block((STORY,), together("s:start", "nobody:start"), id="bad")).outcome
        commands = list(seen.body.commands)
        outcome = await seen.perform(block((STORY,), id="good"))

    assert commands == []
    assert [(each.block, each.kind) for each in seen.warnings()] == [("bad", "PARSING_FAILURE")]
    assert outcome.status == "done"


async def test_a_block_too_big_to_be_planned_in_time_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "MOST", 3)
    async with stage() as seen:
        wait = Wait(id="w", duration=1.0, timing=(Timing("start", "s:end"),))
        with pytest.raises(RequestRefused, match="big: 4 behaviors, marks and sync references; at most 3"):
            await seen.ask(block((STORY, wait), id="big")).outcome
        outcome = await seen.perform(block((STORY,)))

    assert outcome.status == "done"


async def test_an_empty_block_starts_and_ends() -> None:
    async with stage() as seen:
        outcome = await seen.perform(block(()))

    assert outcome.status == "done"
    progress = [each.progress for each in seen.feedback if isinstance(each, BlockProgress)]
    assert progress == ["start", "end"]


async def test_blocks_run_at_the_same_time_by_default() -> None:
    async with stage() as seen:
        first, second = seen.ask(block((STORY,), id="one")), seen.ask(block((Wait(id="w", duration=1.0),), id="two"))
        await asyncio.gather(first.outcome, second.outcome)

    assert seen.times("one")["s:end"] == 2.0
    assert [(each.block, each.at.seconds) for each in seen.ends()] == [("two", 1.0), ("one", 2.0)]


async def test_append_waits_for_the_blocks_before_it() -> None:
    async with stage() as seen:
        first, second = seen.ask(block((STORY,), id="one")), seen.ask(block((STORY,), id="two", composition="APPEND"))
        await asyncio.gather(first.outcome, second.outcome)

    assert [(each.block, each.at.seconds) for each in seen.ends()] == [("one", 2.0), ("two", 4.0)]


async def test_replace_interrupts_the_blocks_before_it() -> None:
    async with stage() as seen:
        first = seen.ask(block((STORY,), id="one"))
        await seen.seen("s:m", "one")
        second = await seen.perform(block((), id="two", composition="REPLACE"))
        outcome = await first.outcome

    assert (outcome.status, outcome.replaced_by) == ("interrupted", "two")
    assert [each.text for each in outcome.spoken] == ["one"]
    assert second.status == "done"


async def test_after_a_replace_the_parts_go_home_before_the_new_block_starts() -> None:
    async with stage(FakeBody(homing=0.75)) as seen:
        first = seen.ask(block((Pointing(id="p", target="a"), STORY), id="one"))
        await seen.seen("p:ready", "one")
        second = await seen.perform(block((STORY,), id="two", composition="REPLACE"))
        await first.outcome

    begins = {
        each.block: each.at.seconds for each in seen.feedback if isinstance(each, BlockProgress) and each.time == 0
    }
    assert seen.body.homes == [("right_arm", "voice")]
    assert [(each.block, each.at.seconds, each.status) for each in seen.ends()] == [
        ("one", 0.5, "interrupted"), ("two", 3.25, "done")
    ]  # fmt: skip
    assert begins["two"] == 0.5 + 0.75
    assert second.status == "done"


async def test_an_empty_replace_starts_and_ends_when_all_is_home() -> None:
    async with stage(FakeBody(homing=0.75)) as seen:
        first = seen.ask(block((Pointing(id="p", target="a"),), id="one"))
        await seen.seen("p:ready", "one")
        await seen.perform(block((), id="two", composition="REPLACE"))
        await first.outcome

    progress = [(e.block, e.progress, e.at.seconds) for e in seen.feedback if isinstance(e, BlockProgress)]
    assert progress == [("one", "start", 0.0), ("one", "end", 0.5), ("two", "start", 1.25), ("two", "end", 1.25)]


async def test_an_appended_block_is_planned_from_where_the_body_is_then() -> None:
    body = FakeBody()
    async with stage(body) as seen:
        first = seen.ask(block((STORY,), id="one"))
        second = seen.ask(block((Gaze(id="g", target="a"), STORY), id="two", composition="APPEND"))
        await second.accepted
        body.estimates["g"] = (0.0, 0.0, 0.25, 0.0, 0.0, 0.25)
        await asyncio.gather(first.outcome, second.outcome)

    said = [each for each in seen.feedback if isinstance(each, PredictionFeedback) and each.block == "two"]
    assert {(each.behavior, each.sync): each.time for each in said[0].points}["g", "stroke"] == 0.25


async def test_an_id_in_use_is_refused_and_free_again_after_the_end() -> None:
    async with stage() as seen:
        first = seen.ask(block((STORY,)))
        again = seen.requests.send(keys.BLOCK, PerformBlock(id="r2", requester="test", block=block((STORY,))))
        with pytest.raises(RequestRefused, match="still being performed"):
            await again.outcome
        await first.outcome
        third = seen.requests.send(keys.BLOCK, PerformBlock(id="r3", requester="test", block=block((STORY,))))

        assert getattr(await third.outcome, "status", "") == "done"


async def test_nothing_is_kept_of_the_performance_of_blocks_that_have_ended() -> None:
    async with stage() as seen:
        for number in range(3):
            await seen.perform(block((STORY,), id=f"b{number}"))
        await asyncio.sleep(1.0)
        gc.collect()
        kept = [each for each in gc.get_objects() if type(each) is BlockPerformance]

    assert kept == []


async def test_a_gaze_shift_ends_on_arrival_and_holds_nothing() -> None:
    async with stage() as seen:
        await seen.perform(block((GazeShift(id="g", target="human"),)))

    assert seen.times() == {"g:start": 0.0, "g:end": 1.0}


async def test_feedback_speaks_the_dialect_of_its_block() -> None:
    behaviors = (Gaze(id="g", target="a"), Pointing(id="p", target="a"))
    async with stage() as seen:
        await seen.perform(block(behaviors, dialect="bml-1.0"))

    names = [each.sync for each in seen.progress() if each.behavior == "g"]
    assert names == ["start", "ready", "relax", "end"]
    names = [each.sync for each in seen.progress() if each.behavior == "p"]
    assert names == ["start", "ready", "strokeStart", "stroke", "strokeEnd", "relax", "end"]


async def test_a_prediction_precedes_the_performance() -> None:
    async with stage() as seen:
        await seen.perform(block((STORY,)))

    prediction = next(each for each in seen.feedback if isinstance(each, PredictionFeedback))
    assert [(each.sync, each.time) for each in prediction.points] == [("start", 0.0), ("m", 1.0), ("end", 2.0)]


async def test_a_wait_ends_with_its_duration_or_when_it_is_released() -> None:
    waits = (Wait(id="w1", duration=0.5), Wait(id="w2"), STORY)
    async with stage() as seen:
        await seen.perform(block(waits, after("s:m", "w2:end")))

    assert seen.times()["w1:end"] == 0.5
    assert seen.times()["w2:end"] == seen.times()["s:m"] == 1.0


async def test_an_absolute_end_is_kept_by_releasing_the_last_hold_in_time() -> None:
    point = Pointing(id="p", target="a")
    async with stage() as seen:
        await seen.perform(block((point, STORY), together("p:end", "10"), together("s:end", "4.5")))

    assert seen.times()["p:end"] == 10.0
    assert seen.times()["s:end"] == 4.5
    assert seen.body.stops == ["p:stroke_end"]


async def test_a_prediction_is_corrected_by_what_is_measured() -> None:
    """The stroke of the arm can't wait for the mark; the speech begins such that both come together."""
    behaviors = (Pointing(id="p", target="a"), STORY)
    example = block(behaviors, together("p:stroke", "s:m"))
    async with stage(FakeBody({"p": Script(durations=(1.5, 0.25, 0.5, 0.25, 0.25, 0.5))})) as seen:
        await seen.perform(example)

    assert seen.times()["p:stroke"] == 2.25
    assert seen.times()["s:start"] <= 1.25
    exact = FakeBody()
    async with stage(exact) as seen:
        await seen.perform(example)

    assert seen.times()["p:stroke"] == seen.times()["s:m"] == 1.25
    assert exact.stops == []


@pytest.mark.parametrize("seed", range(5))
async def test_a_bus_that_delays_and_doubles_loses_nothing(seed: int) -> None:
    async with FaultyHub(Faults(duplicate=0.3, delay=0.05), seed) as hub, stage(hub=hub) as seen:
        outcome = await seen.perform(block((Gaze(id="g", target="a"), STORY), together("g:stroke", "s:start")))

    assert outcome.status == "done"
    assert len(seen.times()) == 10
    assert len({(each.behavior, each.sync, each.at) for each in seen.progress()}) == 10


async def test_a_block_may_be_tied_to_a_point_of_a_block_that_is_still_performed() -> None:
    async with stage() as seen:
        first = seen.ask(block((STORY,), id="one"))
        await seen.seen("s:start", "one")
        gaze = Gaze(id="g", target="a")
        ties = (together("one:s:m", "g:start"), after("one:bml:start+1.75", "g:relax"))
        second = await seen.perform(block((gaze,), *ties, id="two"))
        await first.outcome

    assert second.status == "done"
    assert seen.times("two")["g:start"] == 1.0
    assert seen.times("two")["g:relax"] == 1.75


async def test_what_another_block_never_reaches_holds_nobody() -> None:
    async with stage() as seen:
        first = seen.ask(block((STORY,), id="one"))
        await seen.seen("s:start", "one")
        second = seen.ask(block((Speech(id="t", text="so"),), after("one:s:end", "t:start"), id="two"))
        await second.accepted
        seen.requests.cancel("r-one")
        await first.outcome
        outcome = await second.outcome

    assert getattr(outcome, "status", "") == "done"
    assert seen.times("two")["t:start"] == 0.0

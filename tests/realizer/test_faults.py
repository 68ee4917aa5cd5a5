"""What can go wrong while a block runs: it ends, exactly once, the rest runs, nothing hangs in the air."""

import asyncio
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gaze, GazeShift, Mark, Pointing, Speech
from engage_hri.schemas.blocks import BlockOutcome
from engage_hri.services.realizer.perform import performance as executor
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import planned_again
from engage_hri.services.requests.ends import RequestRefused
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import block, stage, together

GAZE = Gaze(id="gaze-1", target="can-1")
POINT = Pointing(id="point-1", target="can-1")
SPEECH = Speech(id="speech-1", text="This can?")
TIES = (together("gaze-1:stroke", "point-1:start"), together("point-1:stroke_start", "speech-1:start"))
BLOCK = block((GAZE, POINT, SPEECH), *TIES)
POINT_REQUIRED = block((GAZE, replace(POINT, required=True), SPEECH), *TIES)


@pytest.mark.parametrize(
    ("script", "kind", "speech_start"),
    [
        (Script(refuse=True), "CANNOT_CREATE_BEHAVIOR", 0.5),
        (Script(fail="stroke_start"), "EXECUTION_FAILURE", 1.25),
        (Script(stall="stroke_start"), "EXECUTION_FAILURE", 1.0 + 0.25 + 3.0 + 5 * 0.25),
    ],
)
async def test_a_lost_behavior_is_dropped_with_one_warning_and_the_rest_runs(
    script: Script, kind: str, speech_start: float
) -> None:
    async with stage(FakeBody({"point-1": script})) as seen:
        outcome = await seen.perform(BLOCK)

    assert (outcome.status, outcome.dropped) == ("done", ("point-1",))
    assert [each.kind for each in seen.warnings() if each.kind != "LATE"] == [kind]
    assert {each.behavior for each in seen.warnings()} == {"point-1"}
    assert seen.times()["speech-1:start"] == speech_start
    assert seen.body.homes == [("right_arm",)]
    assert len(seen.ends()) == 1


async def test_what_is_lost_in_one_go_is_planned_around_once(monkeypatch: pytest.MonkeyPatch) -> None:
    shifts = tuple(GazeShift(id=f"shift-{number}", target="can-1") for number in range(40))
    plans: list[Plan] = []

    def counted(*arguments: Any, **more: Any) -> Plan:
        plans.append(planned_again(*arguments, **more))
        return plans[-1]

    monkeypatch.setattr(executor, "planned_again", counted)
    async with stage(FakeBody({shift.id: Script(refuse=True) for shift in shifts})) as seen:
        at_once = together(*(f"{shift.id}:start" for shift in shifts))
        outcome = await seen.perform(block((SPEECH, *shifts), at_once))

    assert (outcome.status, len(outcome.dropped)) == ("done", 40)
    assert len(plans) <= 2


@pytest.mark.parametrize("script", [Script(refuse=True), Script(fail="stroke"), Script(stall="stroke")])
async def test_a_lost_required_behavior_fails_the_block(script: Script) -> None:
    async with stage(FakeBody({"point-1": script})) as seen:
        outcome = await seen.perform(POINT_REQUIRED)

    assert outcome.status == "failed"
    assert outcome.fault is not None
    assert outcome.fault.where == "b: point-1"
    assert seen.body.acts == {}
    assert ("right_arm",) in seen.body.homes
    assert [each.status for each in seen.ends()] == ["failed"]


async def test_a_stalled_arm_warns_before_it_is_given_up() -> None:
    async with stage(FakeBody({"point-1": Script(stall="stroke_start")})) as seen:
        await seen.perform(BLOCK)

    assert [each.kind for each in seen.warnings()] == ["LATE", "EXECUTION_FAILURE"]
    assert seen.body.aborted == ["point-1"]


async def test_an_arm_four_times_slower_is_late_but_never_given_up() -> None:
    async with stage(FakeBody({"point-1": Script(slow=4.0)})) as seen:
        outcome = await seen.perform(BLOCK)

    assert outcome.dropped == ()
    assert {each.kind for each in seen.warnings()} == {"LATE"}
    assert seen.times()["speech-1:start"] == seen.times()["point-1:stroke_start"] == 3.5


async def test_a_body_that_dies_fails_the_block() -> None:
    async with stage() as seen:
        pending = seen.ask(BLOCK)
        await seen.seen("point-1:start")
        seen.hub.kill("control")
        outcome = await pending.outcome

    assert isinstance(outcome, BlockOutcome)
    assert (outcome.status, outcome.fault and (outcome.fault.cause, outcome.fault.whose)) == (
        "failed",
        ("gone", "control"),
    )


async def test_a_body_that_never_ends_what_is_aborted_does_not_keep_the_block() -> None:
    deaf = FakeBody({"point-1": Script(stall="stroke_start", deaf=True)})
    async with stage(deaf) as seen:
        outcome = await seen.perform(POINT_REQUIRED)

    assert outcome.status == "failed"


async def test_without_a_body_a_block_is_refused() -> None:
    async with stage() as seen:
        seen.hub.kill("control")
        with pytest.raises(RequestRefused, match="no body"):
            await seen.ask(BLOCK).outcome

    assert [each.kind for each in seen.warnings()] == ["CANNOT_CREATE_BEHAVIOR"]


async def test_a_cancelled_block_ends_interrupted_and_tells_the_words_said() -> None:
    speech = Speech(id="speech-1", text="One two three", marks=(Mark("m1", 3), Mark("m2", 7)))
    async with stage() as seen:
        pending = seen.ask(block((speech,)))
        await seen.seen("speech-1:m1")
        seen.requests.cancel("r-b", "barge-in")
        outcome = await pending.outcome

    assert isinstance(outcome, BlockOutcome)
    assert outcome.status == "interrupted"
    assert [(each.text, each.complete) for each in outcome.spoken] == [("One", False)]
    assert [each.status for each in seen.ends()] == ["interrupted"]


async def test_a_block_cancelled_while_it_is_planned_never_begins() -> None:
    async with stage() as seen:
        pending = seen.ask(BLOCK)
        seen.requests.cancel("r-b")
        outcome = await pending.outcome

    assert getattr(outcome, "status", "") == "interrupted"
    assert seen.body.commands == []


async def test_losing_a_behavior_keeps_what_it_tied_together() -> None:
    example = block(
        (GAZE, POINT, SPEECH),
        together("point-1:stroke_start", "speech-1:start"),
        together("point-1:stroke_start", "gaze-1:stroke"),
    )
    async with stage(FakeBody({"point-1": Script(refuse=True)})) as seen:
        await seen.perform(example)

    assert seen.times()["speech-1:start"] == seen.times()["gaze-1:stroke"]


async def test_a_lost_report_is_made_good_by_the_next() -> None:
    async with stage() as seen:
        pending = seen.ask(BLOCK)
        await seen.seen("point-1:start")
        seen.hub.partition("control")
        await asyncio.sleep(0.6)
        seen.hub.heal()
        outcome = await pending.outcome

    assert getattr(outcome, "status", "") == "done"
    order = [each.sync for each in seen.progress() if each.behavior == "point-1"]
    assert order == ["start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end"]
    assert seen.times()["point-1:ready"] == seen.times()["point-1:stroke_start"]

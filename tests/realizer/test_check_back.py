"""Blocks as generation's `check-back` profile writes them, with their connection events: each tie is tight."""

import pytest

from engage_hri.schemas.behaviors import BlockBehavior, Event, Gaze, Pointing, Speech, TurnSignal
from engage_hri.schemas.blocks import Block
from tests.realizer.fake_body import FakeBody
from tests.realizer.stage import FakeRecognition, after, block, stage, together

HUMAN = "human"


def pointed_reference_and_end_of_turn() -> Block:
    """Step 5 of the scenario: a pointed reference with its glance, a gazed-at one, the end of the turn."""
    behaviors: tuple[BlockBehavior, ...] = (
        Gaze(id="gaze-0", target=HUMAN),
        Speech(id="speech-1", text="Please move"),
        Speech(id="ref-1.phrase", text="the blue piece"),
        Gaze(id="ref-1.gaze", target="blue-square"),
        Event(id="ref-1.event", kind="directed_gaze", responder=HUMAN, objects=("blue-square",), cause="reference"),
        Pointing(id="ref-1.point", target="blue-square"),
        Gaze(id="ref-1.glance", target=HUMAN),
        Speech(id="speech-2", text="so that it is touching the top of"),
        Speech(id="ref-2.phrase", text="the rectangle"),
        Gaze(id="ref-2.gaze", target="rectangle"),
        Event(id="ref-2.event", kind="directed_gaze", responder=HUMAN, objects=("rectangle",), cause="reference"),
        Gaze(id="turn.gaze", target=HUMAN),
        Event(id="turn.mfg", kind="mutual_facial_gaze", responder=HUMAN, optional=True),
        Event(id="turn.ap", kind="adjacency_pair", responder=HUMAN, turn="t1"),
        TurnSignal(id="turn.end", turn="t1", signal="ended", actor=HUMAN),
    )
    return block(
        behaviors,
        after("gaze-0:stroke", "speech-1:start"),
        together("turn.ap:start", "speech-1:start"),
        # reference 1: pointed
        after("speech-1:end", "ref-1.phrase:start", "ref-1.gaze:start"),
        together("ref-1.event:start", "ref-1.gaze:start"),
        after("ref-1.phrase:end", "ref-1.gaze:relax"),
        after("ref-1.gaze:start", "ref-1.point:start"),
        after("ref-1.gaze:stroke", "ref-1.point:stroke_start"),
        together("ref-1.point:stroke_start", "ref-1.phrase:start"),
        after("ref-1.phrase:end", "ref-1.point:stroke_end"),
        after("ref-1.event:end", "ref-1.point:stroke_end"),
        together("ref-1.glance:start", "ref-1.gaze:relax"),
        # reference 2: gaze only
        after("ref-1.phrase:end", "speech-2:start"),
        after("speech-2:end", "ref-2.phrase:start", "ref-2.gaze:start"),
        after("ref-1.glance:stroke", "ref-2.gaze:start"),
        together("ref-2.event:start", "ref-2.gaze:start"),
        after("ref-2.phrase:end", "ref-2.gaze:relax"),
        after("ref-2.gaze:stroke", "ref-2.phrase:start"),
        # end of turn
        together("turn.gaze:start", "ref-2.phrase:end"),
        together("ref-2.gaze:relax", "turn.gaze:start"),
        together("turn.mfg:start", "turn.gaze:start"),
        together("turn.end:start", "ref-2.phrase:end"),
    )


async def test_every_tie_of_a_check_back_block_is_tight() -> None:
    recognition = FakeRecognition({"ref-1.event": 0.25, "ref-2.event": 0.5})
    async with stage(recognition=recognition) as seen:
        outcome = await seen.perform(pointed_reference_and_end_of_turn())

    assert outcome.status == "done"
    assert seen.warnings() == []
    times = seen.times()
    assert times["speech-1:start"] == times["turn.ap:start"] == 0.5
    assert times["ref-1.gaze:start"] == times["ref-1.event:start"] == times["ref-1.point:start"] == 1.5
    assert times["gaze-0:end"] == 1.5
    assert times["ref-1.gaze:stroke"] == 2.0
    assert times["ref-1.point:stroke_start"] == times["ref-1.phrase:start"] == 2.25
    assert times["ref-1.phrase:end"] == times["speech-2:start"] == 3.25
    assert times["ref-1.point:stroke_end"] == 3.25
    assert times["ref-1.gaze:relax"] == times["ref-1.gaze:end"] == times["ref-1.glance:start"] == 3.25
    assert times["ref-1.glance:stroke"] == 3.75
    assert times["speech-2:end"] == times["ref-2.gaze:start"] == times["ref-2.event:start"] == 4.25
    assert times["ref-1.glance:end"] == 4.25
    assert times["ref-2.gaze:stroke"] == times["ref-2.phrase:start"] == 4.75
    turn_end = 5.75
    ends = ("ref-2.phrase:end", "ref-2.gaze:relax", "turn.gaze:start", "turn.mfg:start", "turn.end:start")
    assert {times[point] for point in ends} == {turn_end}
    assert "ref-1.point:stroke_start" not in seen.body.stops
    assert [signal.signal.signal for signal in recognition.signals] == ["ended"]
    starts = {request.event.id: request.at.seconds for request in recognition.events}
    assert starts["ref-1.event"] == 1.5


async def test_a_point_is_held_until_the_human_has_looked() -> None:
    async with stage(recognition=FakeRecognition({"ref-1.event": 3.0, "ref-2.event": 0.5})) as seen:
        await seen.perform(pointed_reference_and_end_of_turn())

    times = seen.times()
    assert times["ref-1.event:end"] == times["ref-1.point:stroke_end"] == 4.5
    assert times["speech-2:start"] == 3.25
    assert "ref-1.point:stroke_end" in seen.body.stops


async def test_without_recognition_an_event_fails_half_a_second_after_its_limit() -> None:
    async with stage() as seen:
        outcome = await seen.perform(pointed_reference_and_end_of_turn())

    assert outcome.status == "done"
    times = seen.times()
    assert times["ref-1.event:end"] == times["ref-1.point:stroke_end"] == 1.5 + 2.5 + 0.5
    assert (
        next(each for each in seen.progress() if each.behavior == "ref-1.event" and each.sync == "end").source
        == "clock"
    )


async def test_recognition_that_dies_ends_its_events_by_the_clock() -> None:
    async with stage(recognition=FakeRecognition()) as seen:
        pending = seen.ask(pointed_reference_and_end_of_turn())
        await seen.seen("ref-1.event:start")
        seen.hub.kill("recognition")
        outcome = await pending.outcome

    assert getattr(outcome, "status", "") == "done"
    assert seen.times()["ref-1.event:end"] == pytest.approx(1.5 + 2.5 + 0.5)


async def test_an_event_that_recognition_refuses_is_dropped_and_holds_nothing() -> None:
    async with stage(recognition=FakeRecognition({"ref-2.event": 0.5}, refuse=("ref-1.event",))) as seen:
        outcome = await seen.perform(pointed_reference_and_end_of_turn())

    assert outcome.status == "done"
    assert outcome.dropped == ("ref-1.event",)
    assert seen.times()["ref-1.point:stroke_end"] == 3.25


async def test_the_second_point_takes_the_arm_over_without_going_home() -> None:
    points = (
        Pointing(id="p1", target="a"),
        Pointing(id="p2", target="b"),
        Speech(id="s", text="this and that"),
    )
    example = block(points, after("s:end", "p1:stroke_end"), after("p1:stroke_end", "p2:start"))
    async with stage() as seen:
        await seen.perform(example)

    times = seen.times()
    assert times["p1:stroke_end"] == times["p1:relax"] == times["p1:end"] == times["p2:start"] == 1.5


async def test_a_gaze_block_overlays_a_fragments_block() -> None:
    body = FakeBody()
    async with stage(body) as seen:
        fragment = seen.ask(block((Speech(id="s", text="a long story"), Gaze(id="g", target="x")), id="fragment-1"))
        glance = await seen.perform(block((Gaze(id="g", target=HUMAN),), id="maintenance-1"))
        await fragment.outcome

    assert glance.status == "done"
    assert {each.block for each in seen.ends()} == {"fragment-1", "maintenance-1"}

"""The figures of the thesis' chapter 4, with exact times: what each constraint means, on a body that varies."""

from engage_hri.schemas.behaviors import Gaze, Pointing, Speech
from tests.realizer.fake_body import FakeBody, Script
from tests.realizer.stage import after, before, block, stage, together

GAZE = Gaze(id="gaze-1", target="can-1")
POINT = Pointing(id="point-1", target="can-1")
SPEECH = Speech(id="speech-1", text="This can?")
FIGURE_4_4 = block(
    (GAZE, POINT, SPEECH),
    together("gaze-1:stroke", "point-1:start"),
    together("point-1:stroke_start", "speech-1:start"),
)


async def test_figure_4_4_runs_as_its_petri_net_says() -> None:
    async with stage() as seen:
        outcome = await seen.perform(FIGURE_4_4)

    assert outcome.status == "done"
    times = seen.times()
    assert times == {
        "gaze-1:start": 0.0,
        "gaze-1:ready": 0.0,
        "gaze-1:stroke_start": 0.0,
        "gaze-1:stroke": 0.5,
        "point-1:start": 0.5,
        "point-1:ready": 1.0,
        "point-1:stroke_start": 1.25,
        "speech-1:start": 1.25,
        "point-1:stroke": 1.75,
        "point-1:stroke_end": 2.0,
        "point-1:relax": 2.25,
        "speech-1:end": 2.25,
        "point-1:end": 2.75,
        "gaze-1:stroke_end": 2.75,
        "gaze-1:relax": 2.75,
        "gaze-1:end": 3.25,
    }
    assert seen.body.stops == ["gaze-1:relax"]


async def test_figure_4_6_speech_waits_for_a_slowed_arm() -> None:
    async with stage(FakeBody({"point-1": Script(slow=2.0)})) as seen:
        await seen.perform(FIGURE_4_4)

    times = seen.times()
    assert times["point-1:stroke_start"] == times["speech-1:start"] == 0.5 + 2 * 0.75
    assert "point-1:stroke_start" not in seen.body.stops


async def test_figure_4_7_speech_comes_earlier_with_an_arm_that_is_already_there() -> None:
    near = Script(durations=(0.125, 0.125, 0.5, 0.25, 0.25, 0.5))
    async with stage(FakeBody({"point-1": near})) as seen:
        await seen.perform(FIGURE_4_4)

    times = seen.times()
    assert times["point-1:stroke_start"] == times["speech-1:start"] == 0.75
    assert "point-1:stroke_start" not in seen.body.stops


async def test_the_arm_holds_before_its_stroke_for_a_speech_that_is_late() -> None:
    late = block(
        (GAZE, POINT, SPEECH),
        together("point-1:stroke_start", "speech-1:start"),
        after("gaze-1:stroke+2", "speech-1:start"),
    )
    async with stage() as seen:
        await seen.perform(late)

    times = seen.times()
    assert times["point-1:start"] == 1.375
    assert times["point-1:stroke_start"] == times["speech-1:start"] == 2.5
    assert seen.body.stops == ["gaze-1:relax", "point-1:stroke_start"]
    held = next(each for each in seen.progress() if each.sync == "stroke_start" and each.behavior == "point-1")
    assert (held.arrived, held.predicted) == (2.125, 2.5)


async def test_figure_4_9_speech_comes_after_the_stroke_begins_however_late() -> None:
    example = block((POINT, SPEECH), after("point-1:stroke_start", "speech-1:start"))
    async with stage(FakeBody({"point-1": Script(slow=3.0)})) as seen:
        await seen.perform(example)

    assert seen.times()["speech-1:start"] == seen.times()["point-1:stroke_start"] == 2.25
    assert seen.body.stops == []


async def test_before_is_the_inverse_of_after() -> None:
    example = block((POINT, SPEECH), before("speech-1:start", "point-1:stroke_start"))
    async with stage() as seen:
        await seen.perform(example)

    assert seen.times()["speech-1:start"] == seen.times()["point-1:stroke_start"] == 0.75


async def test_figure_4_10_an_offset_counts_from_the_measured_stroke() -> None:
    example = block((POINT, SPEECH), together("point-1:stroke_start + 2", "speech-1:start"))
    async with stage(FakeBody({"point-1": Script(slow=3.0)})) as seen:
        await seen.perform(example)

    times = seen.times()
    assert times["point-1:stroke_start"] == 2.25
    assert times["speech-1:start"] == 4.25
    assert seen.body.stops == []


async def test_figure_4_11_three_behaviors_start_together() -> None:
    example = block(
        (GAZE, POINT, SPEECH), together("gaze-1:start", "speech-1:start"), together("point-1:start", "speech-1:start")
    )
    async with stage() as seen:
        await seen.perform(example)

    times = seen.times()
    assert times["gaze-1:start"] == times["point-1:start"] == times["speech-1:start"] == 0.0


async def test_circular_synchronization_of_equals_is_no_deadlock() -> None:
    example = block(
        (GAZE, POINT, SPEECH),
        together("gaze-1:start", "point-1:start"),
        together("point-1:start", "speech-1:start"),
        together("speech-1:start", "gaze-1:start"),
        after("gaze-1:start", "point-1:start"),
        after("point-1:start", "gaze-1:start"),
    )
    async with stage() as seen:
        outcome = await seen.perform(example)

    assert outcome.status == "done"
    assert seen.times()["gaze-1:start"] == seen.times()["speech-1:start"] == 0.0


async def test_figure_3_3_gaze_point_and_four_phrases() -> None:
    phrases = [Speech(id=f"speech-{n}", text=f"phrase {n}") for n in (1, 2, 3, 4)]
    example = block(
        (GAZE, phrases[0], POINT, *phrases[1:]),
        together("gaze-1:stroke", "speech-1:start"),
        together("gaze-1:stroke + 2", "point-1:stroke_start"),
        together("point-1:stroke_end", "speech-2:start"),
        together("speech-2:end", "speech-3:start"),
        together("speech-3:end", "speech-4:start"),
    )
    async with stage() as seen:
        outcome = await seen.perform(example)

    assert outcome.status == "done"
    times = seen.times()
    assert times["gaze-1:stroke"] == times["speech-1:start"] == 0.5
    assert times["point-1:stroke_start"] == 2.5
    assert times["point-1:stroke_end"] == times["speech-2:start"] == 3.25
    assert times["speech-2:end"] == times["speech-3:start"] == 4.25
    assert times["speech-3:end"] == times["speech-4:start"] == 5.25
    assert times["speech-4:end"] == 6.25
    assert [spoken.text for spoken in outcome.spoken] == [phrase.text for phrase in phrases]


async def test_predictions_of_an_exact_body_come_true() -> None:
    async with stage() as seen:
        await seen.perform(FIGURE_4_4)

    assert [each.predicted for each in seen.progress()] == [each.time for each in seen.progress()]

"""The figures of the thesis' chapter 4, with exact times: what each constraint means, on a body that varies."""

from schemas.behaviors import Gaze, Pointing, Speech
from tests.realizer.stage import block, stage, together

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

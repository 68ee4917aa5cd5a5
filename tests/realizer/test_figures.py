"""The nets and schedules of the thesis' figures, as planned; test_golden has them performed."""

import pytest

from engage_hri.schemas.behaviors import Gaze, Pointing, Speech
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.net.petri_net import is_live, is_safe
from engage_hri.services.realizer.plan.planner import plan_block
from tests.realizer.fake_body import FakeBody
from tests.realizer.stage import after, block, together

GAZE = Gaze(id="gaze-1", target="can-1")
POINT = Pointing(id="point-1", target="can-1")
SPEECH = Speech(id="speech-1", text="This can?")
PHRASES = tuple(Speech(id=f"speech-{number}", text=f"phrase {number}") for number in (1, 2, 3, 4))

Places = set[tuple[str, str, str, float]]
"""Kind, source, target and seconds of what ties instants of different behaviors."""
FIGURES: dict[str, tuple[Block, Places, dict[str, float]]] = {
    "4.4": (
        block(
            (GAZE, POINT, SPEECH),
            together("gaze-1:stroke", "point-1:start"),
            together("point-1:stroke_start", "speech-1:start"),
        ),
        set(),
        {"gaze-1:stroke = point-1:start": 0.5, "point-1:stroke_start = speech-1:start": 1.25, "bml:end": 3.25},
    ),
    "4.9": (
        block((POINT, SPEECH), after("point-1:stroke_start", "speech-1:start")),
        {("order", "point-1:stroke_start", "speech-1:start", 0.0)},
        {"point-1:stroke_start": 0.75, "speech-1:start": 0.75, "bml:end": 2.25},
    ),
    "4.10": (
        block((POINT, SPEECH), together("point-1:stroke_start + 2", "speech-1:start")),
        {("delay", "point-1:stroke_start", "speech-1:start", 2.0)},
        {"point-1:stroke_start": 0.75, "speech-1:start": 2.75, "bml:end": 3.75},
    ),
    "4.11": (
        block(
            (GAZE, POINT, SPEECH),
            together("gaze-1:start", "speech-1:start"),
            together("point-1:start", "speech-1:start"),
        ),
        set(),
        {"gaze-1:start = gaze-1:ready = gaze-1:stroke_start = point-1:start = speech-1:start": 0.0, "bml:end": 2.75},
    ),
    "3.3": (
        block(
            (GAZE, PHRASES[0], POINT, *PHRASES[1:]),
            together("gaze-1:stroke", "speech-1:start"),
            together("gaze-1:stroke + 2", "point-1:stroke_start"),
            together("point-1:stroke_end", "speech-2:start"),
            together("speech-2:end", "speech-3:start"),
            together("speech-3:end", "speech-4:start"),
        ),
        {("delay", "gaze-1:stroke = speech-1:start", "point-1:stroke_start", 2.0)},
        {
            "gaze-1:stroke = speech-1:start": 0.5,
            "point-1:start": 1.375,
            "point-1:stroke_start": 2.5,
            "point-1:stroke_end = speech-2:start": 3.25,
            "speech-2:end = speech-3:start": 4.25,
            "speech-3:end = speech-4:start": 5.25,
            "speech-4:end": 6.25,
            "bml:end": 6.75,
        },
    ),
}


@pytest.mark.parametrize("figure", FIGURES)
def test_a_figure_has_its_net_and_its_schedule(figure: str) -> None:
    example, ties, times = FIGURES[figure]

    plan = plan_block(example, map(FakeBody().estimate, example.behaviors))

    names = [transition.name for transition in plan.net.transitions]
    schedule = dict(zip(names, plan.schedule, strict=True))
    assert {name: schedule[name] for name in times} == times
    places = {
        (place.kind, names[place.source], names[place.target], place.lag)
        for place in plan.net.places
        if place.kind in ("order", "delay") and place.source and names[place.target] != "bml:end"
    }
    assert places == ties
    phases = sum(place.kind == "phase" for place in plan.net.places)
    assert phases == sum({"gaze": 3, "pointing": 6, "speech": 1}[chain.type] for chain in plan.chains.values())
    assert is_live(plan.net)
    assert is_safe(plan.net)

"""Work of a rehearsal, counted: what a beginning costs, and how much lies between two pauses."""

import asyncio
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Gesture, Pointing, Posture, PostureShift
from engage_hri.schemas.body import EstimateItem, PlannedTime
from engage_hri.services.control.figure import choreography, kinematics
from engage_hri.services.control.figure.repertoire import BUILT_IN, extended
from engage_hri.services.control.figure.table_clearance import ClearOfTable
from engage_hri.services.control.motion.path import Path
from engage_hri.services.control.testing import WORLD, Stage, performed
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.steps import SLICE

DEEP = "[pose]\nDEEP = { torso = { lean = 25 } }\n"


@pytest.fixture
def work(monkeypatch: pytest.MonkeyPatch) -> Counter[str]:
    """Calls of planning, paths that are laid, and poses whose arms are held against the table."""
    counted: Counter[str] = Counter()

    def watched(name: str, function: Callable[..., Any], size: Callable[..., int]) -> Callable[..., Any]:
        def called(*arguments: Any, **named: Any) -> Any:
            counted[name] += size(*arguments)
            return function(*arguments, **named)

        return called

    def poses(side: str, angles: Any, trunk: Any = None) -> int:
        return np.broadcast(np.asarray(angles)[0], 0.0 if trunk is None else np.asarray(trunk)[0]).size

    monkeypatch.setattr(choreography, "plan", watched("plans", choreography.plan, lambda *_: 1))
    monkeypatch.setattr(Path, "__init__", watched("paths", Path.__init__, lambda *_: 1))
    monkeypatch.setattr(kinematics, "above_table", watched("poses", kinematics.above_table, poses))
    monkeypatch.setattr(ClearOfTable, "check", watched("checks", ClearOfTable.check, lambda *_: 1))
    return counted


async def body() -> SimulatedBody:
    made = SimulatedBody(repertoire=extended(BUILT_IN, [("deep.toml", DEEP)]))
    made.see(WORLD)
    return made


def planned(*begins: tuple[BlockBehavior, float]) -> list[EstimateItem]:
    return [EstimateItem(behavior=each, times=(PlannedTime(sync="start", at=at),)) for each, at in begins]


LEANS = [
    [(Gesture(id="beat", lexeme="BEAT", mode="BOTH_HANDS"), 0.0), (PostureShift(id="lean", lexeme=lexeme), 0.3)]
    for lexeme in ("LEAN_FORWARD", "DEEP")
]


async def test_a_beginning_is_planned_and_laid_once(work: Counter[str]) -> None:
    simulated = await body()
    work.clear()
    simulated.rehearse(planned((Gaze(id="look", target="human"), 0.1)), WORLD)
    assert work["plans"] == 1
    assert work["paths"] <= 2, "the path, and none for its estimate but the way home"


@pytest.mark.parametrize("begins", LEANS, ids=["forward", "deep"])
async def test_a_lean_that_meets_a_gesture_is_checked_once(work: Counter[str], begins: Any) -> None:
    simulated = await body()
    work.clear()
    simulated.rehearse(planned(*begins), WORLD)
    assert work["checks"] == 1


@pytest.mark.parametrize(
    "begins",
    [
        *LEANS,
        [
            (Gesture(id="beat", lexeme="BEAT", mode="BOTH_HANDS"), 0.0),
            (Pointing(id="point", target="far-left", mode="LEFT_HAND"), 1.0),
            (Posture(id="lean", lexeme="LEAN_FORWARD"), 1.2),
            (Gesture(id="wave", lexeme="WAVE", mode="RIGHT_HAND"), 1.5),
            (Gaze(id="look", target="near-right"), 1.6),
        ],
    ],
    ids=["forward", "deep", "many"],
)
async def test_little_is_done_between_two_turns_of_the_loop(work: Counter[str], begins: Any) -> None:
    """A slice ends with the piece that fills it: no piece lays many paths, and what fills a slice is all it has."""
    simulated = await body()
    steps = simulated.rehearse_in_steps(planned(*begins), WORLD)
    slices, elements = [], 0
    work.clear()
    try:
        while True:
            elements += next(steps)
            if elements >= SLICE:
                slices.append(work.copy())
                elements = 0
                work.clear()
    except StopIteration:
        slices.append(work.copy())
    assert len(slices) > 3
    assert max(each["plans"] for each in slices) <= 1
    assert max(each["paths"] for each in slices) <= 2
    assert max(each["poses"] for each in slices) <= 15_000


@pytest.mark.parametrize("begins", LEANS, ids=["forward", "deep"])
async def test_what_happens_between_the_steps_changes_nothing_of_what_is_told(begins: Any) -> None:
    simulated = await body()
    await performed(simulated, PostureShift(id="turn", lexeme="TURN_LEFT"))
    Stage(simulated, Gesture(id="wave", lexeme="WAVE"), "end")
    await asyncio.sleep(0.2)
    at_once = simulated.rehearse(planned(*begins), WORLD)
    steps, told = simulated.rehearse_in_steps(planned(*begins), WORLD), None
    others = [Posture(id="other", lexeme="LEAN_BACK"), Gesture(id="beat-2", lexeme="BEAT", mode="LEFT_HAND")]
    while told is None:
        try:
            next(steps)
        except StopIteration as end:
            told = end.value
        if others:
            Stage(simulated, others.pop(), "end")
        await asyncio.sleep(0.03)
    await Stage.end_all()

    assert told == at_once

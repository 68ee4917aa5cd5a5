"""Inverse kinematics takes no turn of the loop for long: it goes round by round, and nothing is solved twice."""

import asyncio
from pathlib import Path

import pytest

pytest.importorskip("mujoco", reason="needs the extra `mujoco`")
pytest.importorskip("icub_models", reason="needs the package icub-models, which has the model")

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Head, Pointing
from engage_hri.schemas.body import EstimateBehaviors, EstimateItem, Estimates
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.mujoco.described import DescribedBody
from engage_hri.services.control.mujoco.ik import ROUNDS, Chain
from engage_hri.services.control.testing import performed
from tests.control.directing import robot

ICUB = Path(__file__).parent / "robots" / "icub.toml"
PLACES = {
    "near": (0.45, 0.15, 0.73),
    "far": (0.75, 0.45, 0.75),
    "within": (0.05, -0.1, 0.73),
    "behind": (-0.5, 0.3, 0.9),
}
"""Two that an arm reaches, and two for which it tries everything."""
AT_ONCE = 6
"""Rounds in one turn: some 0.2 ms each on a slow machine."""


class Turns:
    """Counts rounds of inverse kinematics, and the most of them in one callback of the loop."""

    def __init__(self) -> None:
        self.rounds = self.most = self._now = 0

    def begin(self) -> None:
        self._now = 0

    def note(self) -> None:
        self.rounds += 1
        self._now += 1
        self.most = max(self.most, self._now)


@pytest.fixture
def turns(monkeypatch: pytest.MonkeyPatch) -> Turns:
    turns, errors, run = Turns(), Chain._errors, asyncio.Handle._run

    def counted(self: Chain, *given: object) -> object:
        turns.note()
        return errors(self, *given)  # type: ignore[arg-type]

    def begun(self: asyncio.Handle) -> None:
        turns.begin()
        run(self)

    monkeypatch.setattr(Chain, "_errors", counted)
    monkeypatch.setattr(asyncio.Handle, "_run", begun)
    return turns


def behaviors(**like: str) -> list[BlockBehavior]:
    looks = [Gaze(id=f"look-{place}", target=place) for place in PLACES]
    return [
        *looks,
        *(Pointing(id=f"point-{place}", target=place, **like) for place in PLACES),
        Head(id="n", lexeme="NOD"),
    ]  # type: ignore[arg-type]


def world() -> World:
    return World(entities=tuple(Entity(id=id, kind="object", position=place) for id, place in PLACES.items()))


async def test_what_is_prepared_is_solved_in_many_turns_and_not_again(turns: Turns):
    """The same answers as without it come of that, and without a single further round."""
    body, alone = DescribedBody(ICUB), DescribedBody(ICUB)
    for each in (body, alone):
        each.see(world())
    preparing = body.prepare(behaviors())
    assert preparing is not None
    await preparing
    assert turns.most <= AT_ONCE
    assert turns.rounds > 2 * ROUNDS
    before = turns.rounds
    told = [body.estimate(each, None, world()) for each in behaviors()]
    assert turns.rounds == before
    assert body.prepare(behaviors()) is None
    assert told == [alone.estimate(each, None, world()) for each in behaviors()]
    assert {each.feasible for each in told} == {True, False}


async def test_a_behavior_that_nobody_has_estimated_is_solved_in_turns_as_well(turns: Turns):
    body = DescribedBody(ICUB)
    body.see(world())
    for each in (Pointing(id="p", target="near"), Gaze(id="g", target="far"), Head(id="n", lexeme="NOD")):
        await performed(body, each)

    assert 0 < turns.most <= AT_ONCE


async def test_control_answers_estimates_in_turns(hub: MemoryHub, turns: Turns):
    async with robot(hub, world(), body=DescribedBody(ICUB)) as client:
        await asyncio.sleep(0.1)
        items = tuple([EstimateItem(behavior=each) for each in behaviors()])
        answer = await client.bus.query(keys.ESTIMATE, EstimateBehaviors(items=items))

    assert isinstance(answer, Estimates)
    assert len(answer.items) == len(items)
    assert 0 < turns.most <= AT_ONCE

"""Estimates of a body with a mistake: refused by name where they come in, and told to the body's author once."""

from collections.abc import Callable, Sequence

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gesture, Head, Speech
from engage_hri.schemas.body import Estimate, EstimateBehaviors, EstimateItem, Estimates, Phase
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.service import embody
from engage_hri.services.control.serving.questions import flaw
from engage_hri.services.control.testing import WORLD
from engage_hri.services.control.torso.body import SimulatedBody
from engage_hri.services.runtime.service import running

BEAT = Gesture(id="g", lexeme="BEAT")
Phases = tuple[Phase, ...]
Change = Callable[[Phases], Phases]
WRONG: dict[str, Change] = {
    "a phase ends at 'bogus', and the next begins at 'ready'": lambda all: tuple(
        [replace(each, to="bogus") for each in all]
    ),
    "a phase ends at 'end', and the next begins at 'stroke'": lambda all: (all[-1], *all[-3::-1]),
    "a phase ends at 'ready', and the next begins at 'stroke_start'": lambda all: (all[0], *all[2:]),
    "its phases lead from 'ready' to 'end'": lambda all: all[1:],
    "its phases lead from 'start' to 'relax'": lambda all: all[:-1],
    "its phases lead from 'start' to 'stroke:2'": lambda all: (
        *all, Phase(since="end", to="stroke:2", shortest=0.1, natural=0.1)
    ),
    "a gesture has no sync point 'middle'": lambda all: (
        replace(all[0], to="middle"), replace(all[1], since="middle"), *all[2:]
    ),
    "'ready' comes after 'stroke_start'": lambda all: (
        replace(all[0], to="stroke_start"), replace(all[1], since="stroke_start", to="ready"),
        replace(all[2], since="ready"), *all[3:],
    ),
    "'stroke:3' does not follow the stroke before it": lambda all: (
        *all[:3], replace(all[3], to="stroke:3"), replace(all[3], since="stroke:3"), *all[4:]
    ),
}  # fmt: skip


class Mistaken(SimulatedBody):
    """A body that changes the phases of its estimates, or leaves the last one away."""

    change: Change = staticmethod(lambda all: all)
    given: int | None = None

    def rehearse(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Sequence[Estimate]:
        made = [self.estimate(item.behavior, item.pose, world) for item in items]
        return [replace(each, phases=self.change(each.phases)) for each in made][: self.given]


async def asked(hub: MemoryHub, body: SimulatedBody, *behaviors: object) -> tuple[Estimates | str, list[str]]:
    """The answer of control, or what it refuses; and its faults. Each question is asked twice."""

    async def serve(bus, ready):  # type: ignore[no-untyped-def]
        await embody(bus, ready, ControlConfig(), body)

    question = EstimateBehaviors(items=tuple([EstimateItem(behavior=each) for each in behaviors]))  # type: ignore[arg-type]
    faults = []
    async with running(hub, {"control": serve}):
        bus = hub.join("realizer")
        with bus.subscribe(keys.fault("control")) as inbox:
            for _ in range(2):
                try:
                    answer: Estimates | str = await bus.query(keys.ESTIMATE, question, timeout=1.0)  # type: ignore[assignment]
                except EngageError as error:
                    answer = error.fault.reason
            inbox.close()
            async for received in inbox:
                assert isinstance(received.message, Fault)
                faults.append(received.message.reason)
    return answer, faults


@pytest.mark.parametrize("wrong", WRONG)
async def test_an_estimate_with_wrong_phases_is_refused_with_what_is_wrong_and_told_once(
    hub: MemoryHub, wrong: str
) -> None:
    body = Mistaken()
    body.change = WRONG[wrong]
    answer, faults = await asked(hub, body, BEAT, replace(BEAT, id="h"))

    assert isinstance(answer, Estimates)
    assert [(each.behavior, each.feasible, each.warning) for each in answer.items] == [
        ("g", False, "CANNOT_CREATE_BEHAVIOR"), ("h", False, "CANNOT_CREATE_BEHAVIOR"),
    ]  # fmt: skip
    assert answer.items[0].fault is not None
    assert answer.items[0].fault.reason == f"the estimate that the body gives of this gesture is wrong: {wrong}"
    assert faults == [answer.items[0].fault.reason]


async def test_too_few_estimates_are_refused_all_together(hub: MemoryHub) -> None:
    body = Mistaken()
    body.given = 1
    answer, faults = await asked(hub, body, BEAT, replace(BEAT, id="h"))

    assert answer == "the body has been asked about 2 behaviors and gives 1 estimates"
    assert faults == [answer]


async def test_the_estimate_of_another_behavior_is_refused() -> None:
    estimate = SimulatedBody().estimate(BEAT, None, WORLD)

    assert flaw(replace(BEAT, id="h"), estimate) == "it is of 'g'"


async def test_what_bodies_leave_out_or_add_is_no_mistake() -> None:
    body = SimulatedBody()
    nods, words = Head(id="n", lexeme="NOD", repetition=3), Speech(id="s", text="so it is")

    assert flaw(nods, body.estimate(nods, None, WORLD)) == ""
    assert flaw(words, Estimate(behavior="s", feasible=True)) == ""
    whole = Phase(since="start", to="end", shortest=1.0, natural=1.0)
    assert flaw(BEAT, Estimate(behavior="g", feasible=True, phases=(whole,))) == ""

"""Answers of the control service to questions about its body: what behaviors would take, and what it can do.

A plan is made of estimates. So one comes for each behavior, with phases of which a plan can be made; else the
behavior is refused, and the mistake is told as the body's.
"""

from collections.abc import Awaitable, Callable, Coroutine, Sequence
from itertools import pairwise
from typing import Any

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import DescribeBody, Estimate, EstimateBehaviors, Estimates
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.contract.calibration import Calibration
from engage_hri.services.control.serving.intake import ControlIntake
from engage_hri.services.control.serving.live_behavior import estimate_of, spoken, spoken_items
from engage_hri.services.runtime.loop import InTurns
from engage_hri.services.runtime.steps import Steps

ADVICE = "phases lead from `start` to `end`, each from where the one before it ends (docs/control.md)"
ROUNDING: Seconds = 1e-6
"""Seconds by which words may end after the speech."""
MOST_TOLD = 100
"""Most mistakes of a body that are told, each once: it may make a new one in each estimate."""


class Questions:
    """Answers about a body. Nothing of it moves."""

    def __init__(
        self,
        config: ControlConfig,
        body: Body,
        calibration: Calibration,
        intake: ControlIntake,
        warn: Callable[[Fault], None],
    ) -> None:
        """calibration: says how far what is estimated may be beside. intake: knows the world as it is now.

        warn: takes each mistake of the body once, as a fault that its author is to see.
        """
        self._config, self._body, self._calibration, self._intake = config, body, calibration, intake
        self._warn = warn
        self._warned: set[tuple[str, str]] = set()
        """Types of behaviors and mistakes in what was told of them."""
        self._rehearsals = InTurns()

    def estimate(self, question: Message) -> Message | Coroutine[Any, Any, Message]:
        """Answer `EstimateBehaviors`; what its behaviors need is prepared before. Raises InputRefused."""
        if not isinstance(question, EstimateBehaviors):
            raise InputRefused(Fault(reason="expected EstimateBehaviors", where=keys.ESTIMATE, service="control"))
        preparing = self._body.prepare([spoken(item.behavior) for item in question.items])
        if preparing is not None:
            return self._prepared(preparing, question)
        return self._rehearsals.answer(self._estimated(question, self._intake.world))

    async def _prepared(self, preparing: Awaitable[None], question: EstimateBehaviors) -> Message:
        await preparing
        answer = self._rehearsals.answer(self._estimated(question, self._intake.world))
        return await answer if isinstance(answer, Coroutine) else answer

    def _estimated(self, question: EstimateBehaviors, world: World) -> Steps[Message]:
        refused = [self._intake.refused(item.behavior) for item in question.items]
        known = [item for item, refusal in zip(question.items, refused, strict=True) if refusal is None]
        others = [item for item in question.others if self._intake.refused(item.behavior) is None]
        told = yield from self._body.rehearse_in_steps(spoken_items(known), world, spoken_items(others))
        if len(told := list(told)) != len(known):
            reason = f"the body has been asked about {len(known)} behaviors and gives {len(told)} estimates"
            advice = "`Body.rehearse` returns one for each item, in their order"
            fault = Fault(reason=reason, advice=advice, service="control")
            self._tell("", fault)
            raise EngageError(fault)
        estimates = iter([self._taken(item.behavior, each) for item, each in zip(known, told, strict=True)])
        return Estimates(items=tuple([next(estimates) if refusal is None else refusal for refusal in refused]))

    def _taken(self, behavior: BlockBehavior, estimate: Estimate) -> Estimate:
        """Take in an estimate of the body; one that has a mistake is a refusal."""
        if not (wrong := flaw(behavior, estimate)):
            return self._calibration.stated(estimate_of(behavior, estimate))
        type = type_name(behavior)
        reason = f"the estimate that the body gives of this {type} is wrong: {wrong}"
        fault = Fault(reason=reason, where=behavior.id, advice=ADVICE, service="control")
        self._tell(type, fault)
        return Estimate(behavior=behavior.id, feasible=False, fault=fault, warning="CANNOT_CREATE_BEHAVIOR")

    def _tell(self, type: str, fault: Fault) -> None:
        if (type, fault.reason) not in self._warned and len(self._warned) < MOST_TOLD:
            self._warned.add((type, fault.reason))
            self._warn(fault)

    def describe(self, question: Message) -> Message:
        """Answer `DescribeBody` with what the body can do. Raises InputRefused."""
        if not isinstance(question, DescribeBody):
            raise InputRefused(Fault(reason="expected DescribeBody", where=keys.DESCRIBE, service="control"))
        able = self._body.capabilities
        zones = dict.fromkeys((*able.no_point_zones, *self._config.no_point_zones))
        return replace(able, no_point_zones=tuple(zones))


def flaw(behavior: BlockBehavior, estimate: Estimate) -> str:
    """Say what is wrong with an estimate; empty: nothing.

    Without phases it is fine. A phase may pass over sync points; a later stroke of a head is `stroke:2` and on.
    """
    if not isinstance(estimate, Estimate):
        return f"it is a {type(estimate).__name__}"
    if estimate.behavior != behavior.id:
        return f"it is of {estimate.behavior!r}"
    if not estimate.feasible or not estimate.phases:
        return ""
    for one, other in pairwise(estimate.phases):
        if one.to != other.since:
            return f"a phase ends at {one.to!r}, and the next begins at {other.since!r}"
    first, last = estimate.phases[0].since, estimate.phases[-1].to
    if (first, last) != ("start", "end"):
        return f"its phases lead from {first!r} to {last!r}"
    return _out_of_order(behavior, [first, *(phase.to for phase in estimate.phases)]) or _words_out_of_order(estimate)


def _words_out_of_order(estimate: Estimate) -> str:
    position, at = 0, 0.0
    for word in estimate.words:
        if word.position <= position or word.start < at or word.end < word.start:
            return f"its word at position {word.position} is not after the word before it"
        position, at = word.position, word.end
    seconds = sum(phase.natural for phase in estimate.phases)
    return f"its words take {at:g} s, and its phases {seconds:g} s" if at > seconds + ROUNDING else ""


def _out_of_order(behavior: BlockBehavior, syncs: Sequence[str]) -> str:
    known = sync_points(behavior)
    at, strokes = -1, 1
    for sync in syncs:
        name, _, number = sync.partition(":")
        if name == "stroke" and number.isdecimal() and "stroke_end" in known:
            if int(number) != strokes + 1 or at != known.index("stroke"):
                return f"{sync!r} does not follow the stroke before it"
            strokes += 1
        elif sync not in known:
            return f"a {type_name(behavior)} has no sync point {sync!r}"
        elif known.index(sync) <= at:
            return f"{sync!r} comes after {known[at]!r}"
        else:
            at = known.index(sync)
    return ""

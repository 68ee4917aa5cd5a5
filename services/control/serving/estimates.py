"""Estimates of a body, incoming: one for each behavior, with phases of which a plan can be made; else refused."""

from collections.abc import Sequence
from itertools import pairwise

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import Estimate, EstimateItem
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.control.serving.warnings_told import warn

ADVICE = "phases lead from `start` to `end`, each from where the one before it ends (docs/control.md)"
ROUNDING: Seconds = 1e-6
"""Seconds by which words may end after the speech."""
MOST_TOLD = 100
"""Most mistakes of a body that are told, each once: it may make a new one in each estimate."""


class IncomingEstimates:
    """Takes in the estimates of a body. A mistake is told once, as a fault that its author sees."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._told: set[tuple[str, str]] = set()

    def take(self, items: Sequence[EstimateItem], estimates: Sequence[Estimate]) -> list[Estimate]:
        """Give the estimates back, with a refusal in place of each that has a mistake.

        Raises EngageError: there is not one for each item.
        """
        estimates = list(estimates)
        if len(estimates) != len(items):
            reason = f"the body has been asked about {len(items)} behaviors and gives {len(estimates)} estimates"
            advice = "`Body.rehearse` returns one for each item, in their order"
            fault = Fault(reason=reason, advice=advice, service="control")
            self._tell("", fault)
            raise EngageError(fault)
        return [self._taken(item, estimate) for item, estimate in zip(items, estimates, strict=True)]

    def _taken(self, item: EstimateItem, estimate: Estimate) -> Estimate:
        behavior = item.behavior
        if not (wrong := flaw(behavior, estimate)):
            return estimate
        type = type_name(behavior)
        reason = f"the estimate that the body gives of this {type} is wrong: {wrong}"
        fault = Fault(reason=reason, where=behavior.id, advice=ADVICE, service="control")
        self._tell(type, fault)
        return Estimate(behavior=behavior.id, feasible=False, fault=fault, warning="CANNOT_CREATE_BEHAVIOR")

    def _tell(self, type: str, fault: Fault) -> None:
        if (type, fault.reason) not in self._told and len(self._told) < MOST_TOLD:
            self._told.add((type, fault.reason))
            warn(self._bus, fault)


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

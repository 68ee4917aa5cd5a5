"""A plan, indexed by what decisions ask of it."""

from collections.abc import Container

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.plan.schedule import EPSILON
from engage_hri.services.realizer.points import Point


class PlanIndex:
    """Tables of a plan that decisions look things up in.

    points: of each behavior, in order. foreign: points of other blocks. members: for each point, the part that its
    behavior has in the point's instant. pauses: word gaps at which an utterance waits, so as not to be too early.

    waits_for: for each transition, those that must fire so many seconds before it. awaited_by: the reverse.
    not_after: for each transition, those that it may be later than by no more than so many seconds.
    is_predictive: the block can only be on time if it is foreseen when points will be.
    """

    def __init__(self, plan: Plan) -> None:
        size = len(plan.net.transitions)
        self.points = {id: chain.points for id, chain in plan.chains.items()}
        self.foreign = frozenset(plan.foreign)
        of_behavior = {
            (member.behavior, transition): member
            for transition, members in enumerate(plan.members)
            for member in members
        }
        self.members = {
            point: of_behavior[point.behavior, transition]
            for point, transition in plan.at.items()
            if (point.behavior, transition) in of_behavior
        }
        self.waits_for: list[list[tuple[int, Seconds]]] = [[] for _ in range(size)]
        self.awaited_by: list[list[int]] = [[] for _ in range(size)]
        self.not_after: list[list[tuple[int, Seconds]]] = [[] for _ in range(size)]
        for place in plan.net.places:
            if place.kind in ("order", "delay", "series"):
                self.waits_for[place.target].append((place.source, place.lag))
                self.awaited_by[place.source].append(place.target)
                if place.kind != "series":
                    # Points that are predicted, or of another block, may come before those that they wait for.
                    self.not_after[place.source].append((place.target, -place.lag))
        for bound in plan.net.bounds:
            if bound.kind != "phase":
                self.not_after[bound.source].append((bound.target, -bound.lag))
        constrained = {transition for transition, sources in enumerate(self.waits_for) if sources}
        self.is_predictive = _is_predictive(plan, constrained)
        self.pauses = _pauses(plan, constrained)


def _is_predictive(plan: Plan, constrained: Container[int]) -> bool:
    """True if a time is bounded from above, or a point that cannot or should not wait is tied to another."""
    if any(bound.kind != "phase" for bound in plan.net.bounds):
        return True
    return any(
        any(member.kind in ("passive", "prompt") for member in members)
        and (len(members) > 1 or transition in constrained)
        for transition, members in enumerate(plan.members)
    )


def _pauses(plan: Plan, constrained: Container[int]) -> frozenset[Point]:
    found: set[Point] = set()
    for id, chain in plan.chains.items():
        if isinstance(chain.behavior, Speech) and (estimate := plan.estimates.get(id)) is not None:
            for phase in estimate.phases:
                gap, at = Point(id, phase.to), plan.at.get(Point(id, phase.to), 0)
                waits = at and plan.predicted(gap) - plan.predicted(Point(id, phase.since)) > phase.natural + EPSILON
                if phase.hold and (waits or at in constrained or len(plan.members[at]) > 1):
                    found.add(gap)
    return frozenset(found)

"""A plan, indexed by what decisions ask of it."""

from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.points import Point


class Wiring:
    """points: of each behavior, in order. foreign: points of other blocks. members: of each point, the part of its
    behavior in the point's instant.

    waits_for: of each transition, what must have been measured, and how many seconds before. awaited_by: those that
    wait for it. not_after: those that it may be later than by no more than so many seconds.
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
                    # Who is predicted, or is of another block, may have been there before those it waits for.
                    self.not_after[place.source].append((place.target, -place.lag))
        for bound in plan.net.bounds:
            if bound.kind != "phase":
                self.not_after[bound.source].append((bound.target, -bound.lag))
        self.is_predictive = _is_predictive(plan)
        self._pauses = _pauses(plan)

    def pauses(self, point: Point) -> bool:
        """Can an utterance that has begun wait there, at a word gap, where it should not be too early?"""
        return point in self._pauses


def _is_predictive(plan: Plan) -> bool:
    """Is anything bounded from above, or constrained and cannot or should not wait? Else prediction is not needed."""
    if any(bound.kind != "phase" for bound in plan.bounds):
        return True
    constrained = _constrained(plan)
    return any(
        any(member.kind in ("passive", "prompt") for member in members)
        and (len(members) > 1 or transition in constrained)
        for transition, members in enumerate(plan.members)
    )


def _constrained(plan: Plan) -> set[int]:
    """Transitions that must not be before something."""
    return {place.target for place in plan.net.places if place.kind in ("order", "delay", "series")}


def _pauses(plan: Plan) -> frozenset[Point]:
    constrained = _constrained(plan)
    found: set[Point] = set()
    for id, chain in plan.chains.items():
        if isinstance(chain.behavior, Speech) and (estimate := plan.estimates.get(id)) is not None:
            gaps = (Point(id, phase.to) for phase in estimate.phases if phase.hold)
            found.update(
                point for point in gaps if plan.at[point] in constrained or len(plan.members[plan.at[point]]) > 1
            )
    return frozenset(found)

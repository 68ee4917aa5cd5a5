"""Facts of a running block: what has been measured so far, and what follows from that alone.

Bodies report late, twice, out of order, and about what was never asked of them. Such a report is no fact, and
changes nothing.
"""

from collections.abc import Iterator
from math import isfinite

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.plan_index import PlanIndex
from engage_hri.services.realizer.plan.assembly import Member
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.points import Point


class Facts:
    """Measured times, by the clock of the loop.

    began: when the block started. begun: when each behavior was told to begin. reached, arrived: when each point was
    passed, and held at.
    """

    plan: Plan

    def __init__(self, began: Seconds) -> None:
        self.began = began
        self.reached: dict[Point, Seconds] = {}
        self.arrived: dict[Point, Seconds] = {}
        self.begun: dict[str, Seconds] = {}
        self._next: dict[str, int] = {}
        """For each behavior, the number of its points that are reached."""
        self._heard: dict[str, Seconds] = {}
        """Time of the latest report of each behavior."""

    def _set_plan(self, plan: Plan) -> None:
        self.plan = plan
        self._index = PlanIndex(plan)
        self._points = self._index.points
        self._instants: dict[int, Seconds] = {}
        """Time at which each transition fired."""

    def has_ended(self, behavior: str) -> bool:
        points = self._points.get(behavior)
        return points is None or points[-1] in self.reached

    def plausible(self, point: Point, at: Seconds, now: Seconds) -> Seconds:
        """`at`, but no later than now, and no earlier than the behavior's last report: clocks differ, bodies err."""
        return self._not_before_last(point.behavior, min(at, now) if isfinite(at) else now)

    def _not_before_last(self, behavior: str, at: Seconds) -> Seconds:
        return max(at, self._heard.get(behavior, at), self.begun.get(behavior, at))

    def _is_ahead(self, point: Point) -> bool:
        """True if the behavior has begun, and has not passed `point` yet."""
        points = self._points.get(point.behavior, ())
        return point.behavior in self.begun and point in points[self.next_number(point.behavior) :]

    def lateness(self, point: Point) -> Seconds:
        """Seconds by which a point was reached later than its constraints allow; 0 if it is not reached."""
        at = self.reached.get(point)
        if at is None or point not in self.plan.at:
            return 0.0
        late = (
            at - since - seconds
            for other, seconds in self._index.not_after[self.plan.at[point]]
            if (since := self._instants.get(other)) is not None
        )
        return max((0.0, *late))

    def earliness(self, point: Point) -> Seconds:
        """Seconds by which a point was reached before the time that the block fixes for it; 0 if it fixes none."""
        at = self.reached.get(point)
        if at is None or point not in self.plan.at:
            return 0.0
        fixed = (lag for source, lag in self._index.waits_for[self.plan.at[point]] if source == 0)
        return max(0.0, self.began + max(fixed, default=0.0) - at)

    def holds(self, point: Point) -> bool:
        """True if the behavior has arrived at the instant of `point`.

        A gaze holds at `relax`, and its `stroke_end` is the same instant.
        """
        return self._index.members[point].point in self.arrived

    def _is_there(self, member: Member) -> bool:
        can_wait = member.can_wait or member.point in self._index.pauses
        return member.point in self.reached or (can_wait and member.point in self.arrived)

    def next_number(self, behavior: str) -> int:
        """Number of points of the behavior that are reached."""
        return self._next.get(behavior, 0)

    def member(self, point: Point) -> Member:
        """The behavior's part in the instant of `point`. Raises KeyError if that is in no instant."""
        return self._index.members[point]


def too_early(facts: Facts, foreign: Point) -> Iterator[tuple[Point, Seconds]]:
    """Points that came before a point of another block allowed it, now that this is reached, and by how much.

    They were met by prediction, which was wrong, or were fixed by other times.
    """
    at, plan = facts.reached[foreign], facts.plan
    if (here := plan.at.get(foreign)) is None:
        return
    ties = [(here, 0.0)]
    ties += [
        (place.target, place.lag)
        for place in plan.net.places
        if place.source == here and place.kind in ("delay", "order") and place.target < len(plan.members)
    ]
    for transition, lag in ties:
        for member in plan.members[transition]:
            came = facts.reached.get(member.point)
            if came is not None and member.behavior in plan.chains:
                yield member.point, at + lag - came

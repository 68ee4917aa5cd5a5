"""What has been measured of a block so far, and what that says by itself.

Bodies report late, twice, out of order, and about what nobody has asked them for. Such a report is no fact, and
changes nothing.
"""

from math import isfinite

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.wiring import Wiring
from engage_hri.services.realizer.plan.assembly import Member
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.points import Point


class Facts:
    """reached, arrived: when the points were passed, and held at. begun: when each behavior was told to begin.

    began: loop time of the block's start; all times are of that clock.
    """

    plan: Plan

    def __init__(self, began: Seconds) -> None:
        self.began = began
        self.reached: dict[Point, Seconds] = {}
        self.arrived: dict[Point, Seconds] = {}
        self.begun: dict[str, Seconds] = {}
        self._next: dict[str, int] = {}
        """Of each behavior, how many of its points are reached."""
        self._heard: dict[str, Seconds] = {}
        """When each behavior was last heard of."""

    def _set_plan(self, plan: Plan) -> None:
        self.plan = plan
        self._wiring = Wiring(plan)
        self._points = self._wiring.points
        self._instants: dict[int, Seconds] = {}
        """When each transition fired that has."""

    def has_ended(self, behavior: str) -> bool:
        points = self._points.get(behavior)
        return points is None or points[-1] in self.reached

    def plausible(self, point: Point, at: Seconds, now: Seconds) -> Seconds:
        """`at`, but no later than now, nor earlier than the behavior was last heard of: clocks differ, bodies err."""
        return self._not_before_last(point.behavior, min(at, now) if isfinite(at) else now)

    def _not_before_last(self, behavior: str, at: Seconds) -> Seconds:
        return max(at, self._heard.get(behavior, at), self.begun.get(behavior, at))

    def _is_ahead(self, point: Point) -> bool:
        """Has its behavior begun, and not passed it yet?"""
        points = self._points.get(point.behavior, ())
        return point.behavior in self.begun and point in points[self.next_number(point.behavior) :]

    def lateness(self, point: Point) -> Seconds:
        """How much later than its constraints allow a point was that is reached; 0 if it was not."""
        at = self.reached.get(point)
        if at is None or point not in self.plan.at:
            return 0.0
        late = (
            at - since - seconds
            for other, seconds in self._wiring.not_after[self.plan.at[point]]
            if (since := self._instants.get(other)) is not None
        )
        return max((0.0, *late))

    def holds(self, point: Point) -> bool:
        """Has it come to that instant? A gaze holds at `relax`, where its `stroke_end` is reported too."""
        return self._wiring.members[point].point in self.arrived

    def _is_there(self, member: Member) -> bool:
        can_wait = member.can_wait or self._wiring.pauses(member.point)
        return member.point in self.reached or (can_wait and member.point in self.arrived)

    def next_number(self, behavior: str) -> int:
        """How many points of it are reached."""
        return self._next.get(behavior, 0)

    def member(self, point: Point) -> Member:
        """Raises KeyError if it is in no instant."""
        return self._wiring.members[point]

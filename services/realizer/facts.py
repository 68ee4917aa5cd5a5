"""What has been measured of a block so far, and what that says by itself."""

from schemas.units import Seconds
from services.realizer.assembly import Member
from services.realizer.planner import Plan
from services.realizer.points import Point
from services.realizer.wiring import Wiring


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
        points, number = self._points.get(point.behavior, ()), self.next_number(point.behavior)
        since = self.reached[points[number - 1]] if points and number else self.begun.get(point.behavior, at)
        return max(since, min(at, now))

    def lateness(self, point: Point) -> Seconds:
        """How much later than its constraints allow a point was that is reached; 0 if it was not."""
        at, transition = self.reached[point], self.plan.at[point]
        late = (
            at - since - seconds
            for other, seconds in self._wiring.not_after[transition]
            if (since := self._instants.get(other)) is not None
        )
        return max((0.0, *late))

    def holds(self, point: Point) -> bool:
        """Has it come to that instant? A gaze holds at `relax`, where its `stroke_end` is reported too."""
        return self.member(point).point in self.arrived

    def _is_there(self, member: Member) -> bool:
        can_wait = member.can_wait or self._wiring.pauses(member.point)
        return member.point in self.reached or (can_wait and member.point in self.arrived)

    def next_number(self, behavior: str) -> int:
        """How many points of it are reached."""
        return self._next.get(behavior, 0)

    def member(self, point: Point) -> Member:
        member = self._wiring.member(point)
        assert member is not None, f"{point} is in no instant"
        return member

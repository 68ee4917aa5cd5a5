"""What is expected of a running block: when each instant will be, from what was measured and what others foresee."""

import heapq
from collections.abc import Iterable, Mapping

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.decide.effects import Pace
from engage_hri.services.realizer.decide.experience import Experience
from engage_hri.services.realizer.decide.facts import Facts
from engage_hri.services.realizer.decide.forecast import Forecast, full_forecast
from engage_hri.services.realizer.plan.assembly import Member
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.plan.schedule import EPSILON
from engage_hri.services.realizer.points import Point, performer

SURPRISE: Seconds = 0.1
"""What comes as far from when it was expected as this moves what depends on it noticeably."""


class Outlook(Facts):
    """paces: at what pace each behavior was last told to go. is_surprised: see `SURPRISE`, since `expected`.

    not_before: when a behavior that is overdue is expected at its next point. foreseen: when other blocks expect
    those of their points that this one is tied to. forecast: None where nothing in the block needs one.
    """

    forecast: Forecast | None

    def __init__(self, plan: Plan, began: Seconds) -> None:
        super().__init__(began)
        self.experience = Experience(plan.estimates)
        self.paces: dict[str, Pace] = {}
        self.not_before: dict[str, Seconds] = {}
        self.foreseen: dict[Point, Seconds] = {}
        self.is_surprised = False
        self._followed: set[Point] = set()
        """Points that other blocks are tied to."""
        self._expected = {point: began + plan.predicted(point) for point in plan.at}

    def _look_ahead(self) -> None:
        """With the plan there is now."""
        self.is_surprised = True
        self._arrivals: list[tuple[Seconds, Seconds, str, int]] = []
        """Until when and since when each behavior is expected at its next point: overdue from there."""
        self.forecast = None
        if self._wiring.is_predictive or self._followed:
            self.forecast = Forecast(self.plan, self.began, self.experience.factor, self.foreseen)
            for point in self._followed & self.plan.at.keys():
                self.forecast.require(self.plan.at[point])

    # -- other blocks --------------------------------------------------------------------------------------------

    def foresee(self, point: Point, at: Seconds) -> None:
        """The block that `point` is of expects it at `at` now."""
        if point in self.plan.at and point not in self.reached:
            self.is_surprised = self.is_surprised or abs(at - self.foreseen.get(point, self.began)) > SURPRISE
            self.foreseen[point] = at
            if self.forecast is not None:
                self.forecast.foresee(self.plan.at[point], at)

    @property
    def ahead(self) -> Mapping[Point, Seconds]:
        """When the points that other blocks are tied to are expected, of those that are still to come."""
        if not self._followed or self.forecast is None:
            return {}
        at, times = self.plan.at, self.forecast.times
        return {point: times[at[point]] for point in self._followed if point in at and point not in self.reached}

    @property
    def _next_lateness_check(self) -> Seconds | None:
        """When to look who is late, though nothing here depends on it: others prepare for what comes after."""
        while self._arrivals and self._next.get(self._arrivals[0][2]) != self._arrivals[0][3]:
            heapq.heappop(self._arrivals)  # It has come.
        return self._arrivals[0][0] + SURPRISE if self._followed and self._arrivals else None

    # -- behaviors under way -------------------------------------------------------------------------------------

    def _learn(self, point: Point, at: Seconds) -> None:
        """Correct what is expected of the same parts by how long a phase took that nobody has hurried or held up."""
        chain = self.plan.chains.get(point.behavior)
        number = self._next.get(point.behavior, 0)
        if chain is None or number == 0 or chain.points[number] != point or self.paces.get(point.behavior):
            return
        if performer(chain.behavior) == "body":
            took = at - self.reached[chain.points[number - 1]]
            changed = self.experience.learn(point.behavior, chain.segments[number - 1].natural, took)
            if self.forecast is not None:
                self.forecast.relearn(changed)

    def _expect_next(self, behavior: str) -> None:
        """It has come as far as it has: from when on it is overdue at its next point."""
        points, number = self._points[behavior], self._next.get(behavior, 0)
        if self.forecast is not None and 0 < number < len(points):
            self.not_before.pop(behavior, None)
            expected = self.reached[points[number - 1]] + self._phase(behavior, number)
            heapq.heappush(self._arrivals, (expected, expected, behavior, number))

    def _changes(self, now: Seconds) -> Iterable[int]:
        """Instants that are expected at another time than before. Who is overdue will be late by as much again."""
        if self.forecast is None:
            return ()
        while self._arrivals and self._arrivals[0][0] < now - EPSILON:
            _, expected, behavior, number = heapq.heappop(self._arrivals)
            points = self._points.get(behavior, ())
            if self._next.get(behavior) != number or number >= len(points) or self.holds(points[number]):
                continue
            expected = max(expected, self._asked(points[number], expected))
            until = expected
            if expected < now - EPSILON:  # and not slower on purpose
                until = self.not_before[behavior] = now + (now - expected)
                self.forecast.overdue(self.plan.at[points[number]], until)
            heapq.heappush(self._arrivals, (until, expected, behavior, number))
        return self.forecast.update()

    def _asked(self, point: Point, natural: Seconds) -> Seconds:
        """When its behavior was told to be there; `natural` if it was left to it."""
        return dict(self.paces.get(point.behavior, ())).get(point.sync, natural)

    def _arrival(self, member: Member) -> Seconds | None:
        """When a behavior under way will come to its hold point; None if it has not begun."""
        points, number = self._points[member.behavior], self._next.get(member.behavior, 0)
        if not number:
            return None
        at = self.reached[points[number - 1]]
        for each in range(number, points.index(member.point) + 1):
            at += self._phase(member.behavior, each)
            if each == number:
                at = max(at, self.not_before.get(member.behavior, at))
        return at

    def _phase(self, behavior: str, number: int) -> Seconds:
        """How long it is expected to take from the point before to the one of that number."""
        if self.forecast is None:
            return self.plan.chains[behavior].segments[number - 1].natural * self.experience.factor(behavior)
        before, here = (self.plan.at[point] for point in self._points[behavior][number - 1 : number + 1])
        return 0.0 if before == here else self.forecast.phase(behavior, here)

    # -- what is told of it --------------------------------------------------------------------------------------

    def expected(self, now: Seconds) -> dict[Point, Seconds]:
        """When each point of the block that is still to come is expected, seconds from the block's start."""
        forecast = self.from_scratch()
        for transition in range(len(self.plan.members)):
            forecast.overdue(transition, now)
        forecast.update()
        coming = {point for points in self._points.values() for point in points} - self.reached.keys()
        self._expected |= {point: max(now, forecast.times[self.plan.at[point]]) for point in coming}
        self.is_surprised = False
        return {point: self._expected[point] - self.began for point in coming}

    def times(self) -> dict[Point, Seconds]:
        """When each point of the plan was, or is expected."""
        forecast = self.from_scratch()
        return {point: self.reached.get(point, forecast.times[at]) for point, at in self.plan.at.items()}

    def from_scratch(self) -> Forecast:
        """When each instant will be: what the forecast kept up to date says of those it keeps, and all others."""
        facts = (self.foreseen, self.reached, self.arrived, self._instants)
        return full_forecast(self.plan, self.began, self.experience.factor, *facts)

"""Expected times of a running block, from what was measured and what other blocks expect."""

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
"""Difference from the expected time, in seconds, from which predictions are computed again."""


class Expectations(Facts):
    """Facts and what is expected.

    paces: the pace that each behavior was last told. is_surprised: something has moved by `SURPRISE` since the last
    call of `expected`. not_before: when a behavior that is overdue is expected at its next point. foreseen: expected
    times of points of other blocks that this one is tied to. forecast: None if nothing in the block needs one.
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
        """Points of this block that other blocks are tied to."""
        self._expected = {point: began + plan.predicted(point) for point in plan.at}

    def _look_ahead(self) -> None:
        """Begin a forecast of the plan, if it needs one."""
        self.is_surprised = True
        self._arrivals: list[tuple[Seconds, Seconds, str, int]] = []
        """Behaviors and numbers of their next points: until when, and since when, each is expected there."""
        self.forecast = None
        if self._index.is_predictive or self._followed:
            self.forecast = Forecast(self.plan, self.began, self.experience.factor, self.foreseen)
            for point in self._followed & self.plan.at.keys():
                self.forecast.require(self.plan.at[point])

    # -- other blocks --------------------------------------------------------------------------------------------

    def foresee(self, point: Point, at: Seconds) -> None:
        """Note that the other block that has `point` expects it at `at` now."""
        if point in self.plan.at and point not in self.reached:
            self.is_surprised = self.is_surprised or abs(at - self.foreseen.get(point, self.began)) > SURPRISE
            self.foreseen[point] = at
            if self.forecast is not None:
                self.forecast.foresee(self.plan.at[point], at)

    @property
    def ahead(self) -> Mapping[Point, Seconds]:
        """Expected times of the points that other blocks are tied to and that are still to come."""
        if not self._followed or self.forecast is None:
            return {}
        at, times = self.plan.at, self.forecast.times
        return {point: times[at[point]] for point in self._followed if point in at and point not in self.reached}

    @property
    def _next_lateness_check(self) -> Seconds | None:
        """Next time to check for delays that only other blocks depend on."""
        while self._arrivals and self.next_number(self._arrivals[0][2]) != self._arrivals[0][3]:
            heapq.heappop(self._arrivals)  # The behavior has arrived there.
        return self._arrivals[0][0] + SURPRISE if self._followed and self._arrivals else None

    # -- behaviors under way -------------------------------------------------------------------------------------

    def _learn(self, point: Point, at: Seconds) -> None:
        """Correct the estimates of the same parts by a measured phase, unless it was hurried or held up."""
        chain = self.plan.chains.get(point.behavior)
        number = self.next_number(point.behavior)
        if chain is None or number == 0 or chain.points[number] != point or self.paces.get(point.behavior):
            return
        if performer(chain.behavior) == "body":
            before, natural = chain.points[number - 1], chain.segments[number - 1].natural
            if self.plan.predicted(point) - self.plan.predicted(before) < natural - EPSILON:
                return  # it was to be cut short
            took = at - self.reached[before]
            changed = self.experience.learn(point.behavior, natural, took)
            if self.forecast is not None:
                self.forecast.relearn(changed)

    def _expect_next(self, behavior: str) -> None:
        """Note from when on the behavior is overdue at its next point."""
        points, number = self._points[behavior], self.next_number(behavior)
        if self.forecast is not None and 0 < number < len(points):
            self.not_before.pop(behavior, None)
            expected = self.reached[points[number - 1]] + self._phase(behavior, number)
            heapq.heappush(self._arrivals, (expected, expected, behavior, number))

    def _changes(self, now: Seconds) -> Iterable[int]:
        """Instants that are expected at another time than before.

        A behavior that is overdue by a second is expected a second from now.
        """
        if self.forecast is None:
            return ()
        while self._arrivals and self._arrivals[0][0] < now - EPSILON:
            _, expected, behavior, number = heapq.heappop(self._arrivals)
            points = self._points.get(behavior, ())
            if self.next_number(behavior) != number or number >= len(points) or self.holds(points[number]):
                continue
            expected = max(expected, self._asked(points[number], expected))
            until = expected
            if expected < now - EPSILON:  # and not slower on purpose
                until = self.not_before[behavior] = now + (now - expected)
                self.forecast.overdue(self.plan.at[points[number]], until)
            heapq.heappush(self._arrivals, (until, expected, behavior, number))
        return self.forecast.update()

    def _asked(self, point: Point, natural: Seconds) -> Seconds:
        """Time at which the behavior was told to be at `point`; `natural` if it was told none."""
        return dict(self.paces.get(point.behavior, ())).get(point.sync, natural)

    def _arrival(self, member: Member) -> Seconds | None:
        """Expected time at which a behavior comes to its hold point; None if it has not begun."""
        points, number = self._points[member.behavior], self.next_number(member.behavior)
        if not number:
            return None
        at = self.reached[points[number - 1]]
        for each in range(number, points.index(member.point) + 1):
            at += self._phase(member.behavior, each)
            if each == number:
                at = max(at, self.not_before.get(member.behavior, at))
        return at

    def _phase(self, behavior: str, number: int) -> Seconds:
        """Expected seconds from the point before to the point of that number."""
        if self.forecast is None:
            return self.plan.chains[behavior].segments[number - 1].natural * self.experience.factor(behavior)
        before, here = (self.plan.at[point] for point in self._points[behavior][number - 1 : number + 1])
        return 0.0 if before == here else self.forecast.phase(behavior, here)

    # -- expected times ------------------------------------------------------------------------------------------

    def expected(self, now: Seconds) -> dict[Point, Seconds]:
        """Expected times of all points of the block that are still to come, in seconds from the block's start."""
        forecast = self.from_scratch()
        for transition in range(len(self.plan.members)):
            forecast.overdue(transition, now)
        forecast.update()
        coming = {point for points in self._points.values() for point in points} - self.reached.keys()
        self._expected |= {point: max(now, forecast.times[self.plan.at[point]]) for point in coming}
        self.is_surprised = False
        return {point: self._expected[point] - self.began for point in coming}

    def times(self) -> dict[Point, Seconds]:
        """Time of each point of the plan, measured or expected, by the clock of the loop."""
        forecast = self.from_scratch()
        return {point: self.reached.get(point, forecast.times[at]) for point, at in self.plan.at.items()}

    def from_scratch(self) -> Forecast:
        """A forecast of all instants; for those that the kept forecast has, it says the same."""
        facts = (self.foreseen, self.reached, self.arrived, self._instants)
        return full_forecast(self.plan, self.began, self.experience.factor, *facts)

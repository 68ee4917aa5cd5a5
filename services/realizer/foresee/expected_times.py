"""Foresight: expected times of a running block, and at what pace its behaviors are to move for them."""

from collections.abc import Callable
from itertools import pairwise
from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.foresee.expectations import NOTICEABLE, SURPRISE, Expectations, Pace
from engage_hri.services.realizer.foresee.forecast import Forecast
from engage_hri.services.realizer.foresee.from_scratch import full_forecast
from engage_hri.services.realizer.foresee.outlook import Outlook
from engage_hri.services.realizer.plan.known import BLOCK_END, BLOCK_START
from engage_hri.services.realizer.plan.plan import slack
from engage_hri.services.realizer.points import EPSILON, ORIGIN, SHIFTS, Member, Point


class Foresight(Expectations):
    """Answers from what is expected of a block."""

    def due(self, transition: int, ripe: Seconds) -> Seconds:
        """Time at which an instant is due, no earlier than all that it waits for is `ripe`."""
        return ripe if self.forecast is None else max(ripe, self.forecast.times[transition])

    def arrival(self, member: Member) -> Seconds | None:
        """Expected time at which a behavior comes to its hold point; None if it has not begun."""
        points, number = self.plan.chains[member.behavior].points, self._facts.next_number(member.behavior)
        if not number:
            return None
        at = self._since(member.behavior)
        for each in range(number, points.index(member.point) + 1):
            at += self._phase(member.behavior, each)
            if each == number:
                at = max(at, self.not_before.get(member.behavior, at))
        return at

    def pace(self, behavior: str, now: Seconds, may_pass: Callable[[Point], bool]) -> Pace:
        """Instants for the behavior's points up to the next where it must ask; empty if it comes to them anyway.

        It is told of all points up to the last for which it hurries, waits or dawdles: a gesture that is made smaller
        in time need not stop for it. The others come as is natural, also where that changes on the way.
        """
        forecast, plan, facts = self.forecast, self.plan, self._facts
        if forecast is None or behavior not in plan.chains:
            return ()
        # A shift beneath a look takes no time, and ends whenever it is asked to: no bound says so.
        is_moving = plan.chains[behavior].type not in SHIFTS
        is_minded = behavior in self._minded or behavior in self.may_be_slower
        if is_moving and not is_minded and not forecast.is_hurried(behavior):
            return ()  # No bound makes it hurry, for itself or for who comes after it, or wait on its way.
        points, segments = plan.chains[behavior].points, plan.chains[behavior].segments
        number = facts.next_number(behavior)
        at = self._since(behavior) if number else now
        is_hurried, told = forecast.is_hurried(behavior), 0
        stops = self._stops[behavior] = set()
        planned: list[tuple[str, Seconds]] = []
        before = plan.at[points[number - 1]] if number else -1
        for index, point in enumerate(points[number:], start=number):
            here, is_off = plan.at[point], False
            if here != before:
                is_cut = is_moving or plan.successors.get(behavior, ("", None))[1] == point
                if is_cut and index and forecast.phase(behavior, here) == 0.0 < segments[index - 1].natural:
                    break  # another takes its part before this point: it need not hurry there
                natural, latest = at + forecast.phase(behavior, here), at + forecast.longest(behavior, here)
                is_off = forecast.is_hurried(behavior, here)
                if point is points[number] and not self.paces.get(behavior):
                    natural = max(natural, self.not_before.get(behavior, natural))  # overdue, not slower on purpose
                at = max(natural, now) if facts.holds(point) else natural
                if forecast.times[here] > natural + SURPRISE and self._net.part_of[point].kind == "passive":
                    at = max(natural, min(forecast.times[here], latest))
                    is_off = is_off or at > natural + SURPRISE
                if behavior in self.may_be_slower and self._net.part_of[point].can_wait and may_pass(point):
                    is_off = is_off or forecast.times[here] > at + EPSILON
                    at = max(at, min(forecast.times[here], at + slack(plan, point)))
            before = here
            is_end = not may_pass(point)
            if is_end and is_hurried and index:
                at, is_off, is_end = max(at, forecast.times[here]), True, False
                if self._net.part_of[point].point == point:
                    stops.add(point.sync)
            planned.append((point.sync, at))
            told = len(planned) if is_off else told
            if is_end:
                break
        if told:
            self.paced.add(behavior)
        return tuple(planned[:told])

    # -- expected times ------------------------------------------------------------------------------------------

    def expected(self, now: Seconds) -> dict[Point, Seconds]:
        """Expected times of all points of the block that are still to come, in seconds from the block's start."""
        times = self._each(self._as_of(now), now)
        coming = {each for chain in self.plan.chains.values() for each in chain.points} - self._facts.reached.keys()
        self._expected |= {point: max(now, times[point]) for point in coming}
        self.is_surprised = False
        return {point: self._expected[point] - self._facts.began for point in coming}

    def times(self, now: Seconds) -> dict[Point, Seconds]:
        """Time of each point of the plan and of the end of the block, measured or expected, by the loop's clock."""
        forecast, last = self._as_of(now), len(self.plan.members) - 1
        return {**self._each(forecast, now), BLOCK_START: self._facts.began, BLOCK_END: forecast.times[last]}

    def outlook(self, now: Seconds) -> Outlook:
        """All that was measured, and that is expected from it."""
        return Outlook({**self._each(self._as_of(now), now), ORIGIN: self._facts.began})

    def _each(self, forecast: Forecast, now: Seconds) -> dict[Point, Seconds]:
        """Expected time of each point: that of its instant, unless its behavior cannot wait so long."""
        at, facts, passed = self.plan.at, self._facts, self._net.passed
        instants = {point: passed.get(here, forecast.times[here]) for point, here in at.items()}
        arrivals = {point: facts.reached.get(point, instants[point]) for point in at}
        for chain in self.plan.chains.values():
            for (before, point), segment in zip(pairwise(chain.points), chain.segments, strict=True):
                is_passive = self._net.part_of[point].kind == "passive"
                if point not in facts.reached and is_passive and at[before] != at[point]:
                    behavior, here, since = point.behavior, at[point], arrivals[before]
                    if before in facts.reached:
                        since = self._since(behavior)
                    least, most = forecast.phase(behavior, here), forecast.longest(behavior, here)
                    is_given = point not in self.plan.constrained and behavior not in self.plan.natural
                    if is_given and self.plan.successors.get(behavior, "")[1:] == (point,):
                        most = segment.natural  # Who is to take its part may come later than it has ended by itself.
                    most = inf if before in facts.reached and facts.held_between(since, now, behavior) else most
                    arrivals[point] = max(now, since + least, min(since + most, instants[point]))
        return arrivals

    def _as_of(self, now: Seconds) -> Forecast:
        """A forecast in which nothing that has not come is expected before `now`."""
        facts = self._facts
        if (forecast := self.forecast) is not None:
            self.catch_up()
        else:
            known = (self.foreseen, facts.reached, facts.arrived, self._net.instants)
            heard = self.utterances.since
            forecast = full_forecast(self.plan, facts.began, self.experience.factor, *known, self._prolonged, heard)
        return forecast.as_of(now, self._stood(now))


def differ_noticeably(one: Pace, other: Pace) -> bool:
    """True if `other` has a new point, or moves one by more than NOTICEABLE, or if only one of the two is empty."""
    if not one or not other:
        return one != other
    before = dict(one)
    return any(sync not in before or abs(before[sync] - at) > NOTICEABLE for sync, at in other)

"""Expectations of a running block as its news come: what was measured, said, held, and what other blocks expect.

They say "not before"; who is released by a measured event need not ask them. So they may fall behind: what they are
told waits until `update`. Asked of them is when each point is expected, and at what pace the behaviors are to move
for that.
"""

import heapq
from collections.abc import Callable, Collection, Iterable, Mapping
from itertools import pairwise
from math import inf
from typing import Any

from msgspec import Struct

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.foresee.forecast import Forecast, full_forecast, is_predictive
from engage_hri.services.realizer.foresee.pace import SHORT, Experience, Interval, Utterances
from engage_hri.services.realizer.net.facts import Facts
from engage_hri.services.realizer.net.running import Observer, RunningNet
from engage_hri.services.realizer.plan.known import BLOCK_END, BLOCK_START
from engage_hri.services.realizer.plan.plan import BRAKING, Plan, slack
from engage_hri.services.realizer.points import EPSILON, ORIGIN, SHIFTS, Member, Point, frozen, stands_soon


class Outlook(Struct, frozen=True):
    """Times at which behaviors pass their points, as they were measured or are expected, by the loop's clock."""

    times: Mapping[Point, Seconds]

    def apart(self, point: Point, other: Point) -> Seconds:
        """Seconds by which one point is later than another; -inf if one is not known."""
        if point not in self.times or other not in self.times:
            return -inf
        return self.times[point] - self.times[other]


SURPRISE: Seconds = 0.008
"""Difference from the expected time, in seconds, from which predictions are computed again."""
OVERDUE: Seconds = 0.1
"""Seconds after which it is looked whether a behavior is overdue, if only other blocks want to know."""
NOTICEABLE: Seconds = 0.02
"""Seconds; planned instants that differ by less are not worth a message."""
Pace = tuple[tuple[str, Seconds], ...]
"""Sync points and their instants, by loop time, where the behavior's natural pace would miss them; else empty."""


class Foresight(Observer):
    """Expectations of a block.

    paces: the pace that each behavior was last told. paced: those that ever hurried or dawdled: a gesture that was
    made smaller says nothing about speed from there on. is_surprised: something has moved by `SURPRISE` since the
    last call of `expected`. not_before: when a behavior that is overdue is expected at its next point. foreseen:
    expected times of points of other blocks that this one is tied to. followed: points that others are tied to.
    forecast: None if nothing in the block needs one.
    """

    forecast: Forecast | None

    def __init__(self, plan: Plan, facts: Facts) -> None:
        self.experience = Experience(plan.estimates)
        self.utterances = Utterances(self.experience)
        self.paces: dict[str, Pace] = {}
        self.paced: set[str] = set()
        self.may_be_slower: set[str] = set()
        """Behaviors that were told to pass a hold point before its instant."""
        self._missed: dict[Point, Seconds] = {}
        """Times at which behaviors were expected that were overdue then, as the next report of each."""
        self._stops: dict[str, set[str]] = {}
        """Hold points within the pace of each behavior at which it has to wait for leave."""
        self.not_before: dict[str, Seconds] = {}
        self.foreseen = {point: facts.began + plan.predicted(point) for point in plan.foreign}
        self.is_surprised = False
        self._updated = facts.began
        """When it was last looked whether a word is overdue."""
        self._facts = facts
        self.followed: set[Point] = set()
        self._expected = {point: facts.began + plan.predicted(point) for point in plan.at}

    def look_ahead(self, plan: Plan, net: RunningNet) -> None:
        """Begin a forecast of the plan, if it needs one. The net has yet to run."""
        self.plan = plan
        self._net = net
        self.is_surprised = True
        self._news: list[tuple[Any, ...]] = []
        """What the forecast has yet to be told: a function, and its arguments."""
        self._arrivals: list[tuple[Seconds, Seconds, str, int]] = []
        """Behaviors and numbers of their next points: until when, and since when, each is expected there."""
        self._minded: frozenset[str] = frozen()
        self.forecast = None
        if is_predictive(plan) or self.followed:
            self.forecast = forecast = Forecast(plan, self._facts.began, self.experience.factor, self.foreseen)
            bounded = forecast.bounded
            self._minded = frozen(member.behavior for transition in bounded for member in plan.members[transition])

    def minds(self, transition: int) -> bool:
        """True if it takes a forecast to say when `transition` is due: some behavior there may be held back."""
        return bool(self._minded) and any(member.behavior in self._minded for member in self.plan.members[transition])

    # -- what happens (see `Observer`) ---------------------------------------------------------------------------

    def on_began(self, behavior: str, at: Seconds) -> None:
        """Expect the points of a behavior that begins from now on."""
        if (forecast := self.forecast) is not None and (chain := self.plan.chains.get(behavior)) is not None:
            self._news.append((forecast.overdue, self.plan.at[chain.points[0]], at))

    def on_arrived(self, point: Point, at: Seconds) -> None:
        if (forecast := self.forecast) is not None:
            self._news.append((forecast.come, point.behavior, self.plan.at[point], at))

    def on_reached(self, point: Point, at: Seconds) -> None:
        if (forecast := self.forecast) is not None:
            self._news.append((forecast.passed, point.behavior, self.plan.at[point], at))
        if not self.is_surprised and point.behavior in self.plan.chains:
            self.is_surprised = abs(at - self._expected.get(point, at)) > SURPRISE

    def on_fired(self, transition: int, at: Seconds) -> None:
        if (forecast := self.forecast) is not None:
            self._news.append((forecast.fix, transition, at))

    def prolong(self) -> None:
        """Take in for how long clocks of the net were stopped: what they lead to is later by that."""
        if (forecast := self.forecast) is not None:
            self._news += [(forecast.prolong, *each) for each in self._prolonged]

    def none_before(self, now: Seconds) -> None:
        """Expect nothing that has not happened before now: what was held has not come in the meantime."""
        if (forecast := self.forecast) is not None:
            coming = [each for each in range(len(self.plan.members)) if each not in self._net.fired]
            self._news += [(forecast.overdue, each, now) for each in coming]

    def go_on(self, behavior: str, now: Seconds) -> None:
        """Expect a behavior that was held, and is not any more, at its next point: later, if it may have stood."""
        if (forecast := self.forecast) is None or not (number := self._facts.next_number(behavior)):
            return
        if not self.utterances.follows(behavior):
            self._news.append((forecast.overdue, *self._after_hold(behavior, now)))
        elif self._stood_since(behavior, now) and not self._facts.holds(self.plan.chains[behavior].points[number]):
            self.utterances.go_on(behavior, now)

    def recall_holds(self) -> None:
        """Take in what was held before there was this plan, as it was taken in when that went on."""
        if (forecast := self.forecast) is not None and (last := self._facts.last_hold) is not None:
            self.prolong()
            self.none_before(last)
            self._news += [(forecast.overdue, *each) for each in self._stood(last)]
        self._news += [(forecast.shift, *each) for each in self.utterances.since.items()] if forecast else []

    def _stood(self, now: Seconds) -> Iterable[tuple[int, Seconds]]:
        """Next points of behaviors that were held on their way there, as of `_after_hold`."""
        facts = self._facts
        for behavior in facts.under_way:
            number = facts.next_number(behavior)
            if number and facts.held_between(self._measured(behavior), now, behavior):
                yield self._after_hold(behavior, now)

    def _after_hold(self, behavior: str, now: Seconds) -> tuple[int, Seconds]:
        """The instant of the next point of a behavior under way, and when it comes there if it was held since.

        A voice may have stood between two words, a clock has stopped; a movement goes on to where it can wait.
        """
        number, chain = self._facts.next_number(behavior), self.plan.chains[behavior]
        point = chain.points[number]
        stood = self._stood_since(behavior, now) if stands_soon(chain.behavior) else 0.0
        at = self._since(behavior) + self._phase(behavior, number) + stood
        return self.plan.at[point], now if self._facts.holds(point) else max(now, at)

    def _measured(self, behavior: str) -> Seconds:
        """Time at which the behavior was at the latest place of which it has told: a sync point, or a word."""
        at = self.utterances.measured(behavior)
        number = self._facts.next_number(behavior)
        return self._facts.reached[self.plan.chains[behavior].points[number - 1]] if at is None else at

    def _since(self, behavior: str) -> Seconds:
        """Time at which the behavior passed its latest point; a speech: would have, by the words since."""
        if (at := self.utterances.since.get(behavior)) is not None:
            return at
        return self._facts.reached[self.plan.chains[behavior].points[self._facts.next_number(behavior) - 1]]

    def _stood_since(self, behavior: str, now: Seconds) -> Seconds:
        return self._facts.stood_between(self._measured(behavior), now, behavior)

    @property
    def _prolonged(self) -> list[tuple[int, int, Seconds]]:
        places = self._net.net.places
        return [(places[each].source, places[each].target, by) for each, by in self._net.prolonged.items()]

    # -- other blocks --------------------------------------------------------------------------------------------

    def foresee(self, point: Point, at: Seconds) -> None:
        """Note that the other block that has `point` expects it at `at` now."""
        if point in self.plan.at and point not in self._facts.reached:
            self.is_surprised = self.is_surprised or abs(at - self.foreseen.get(point, self._facts.began)) > SURPRISE
            self.foreseen[point] = at
            if (forecast := self.forecast) is not None:
                self._news.append((forecast.foresee, self.plan.at[point], at))

    def follow(self, points: Iterable[Point]) -> bool:
        """Expect these points from now on, for other blocks (see `ahead`). False: look ahead again for that."""
        self.followed.update(points)
        return self.forecast is not None or not self.followed

    @property
    def ahead(self) -> Mapping[Point, Seconds]:
        """Expected times of the points that other blocks are tied to and that are still to come."""
        if not self.followed or self.forecast is None:
            return {}
        times, reached = self.forecast.times, self._facts.reached
        coming = {point: self.plan.transition(point) for point in self.followed if point not in reached}
        return {point: times[transition] for point, transition in coming.items() if transition is not None}

    # -- behaviors under way -------------------------------------------------------------------------------------

    def learn(self, point: Point, at: Seconds) -> None:
        """Correct the estimates of the same parts by a phase that ends at `point`, unless it was hurried or held up.

        The point is the next of its behavior, and not among the facts yet. Words do not teach it twice.
        """
        chain = self.plan.chains.get(point.behavior)
        number = self._facts.next_number(point.behavior)
        if chain is None or number == 0 or chain.points[number] != point or point.behavior in self.paced:
            return
        before, natural = chain.points[number - 1], chain.segments[number - 1].natural
        if self.utterances.follows(point.behavior):
            self._learn_words(point.behavior, self.utterances.interval(point.behavior, to_point=True), at)
        elif natural >= SHORT and TYPES[chain.type].performer == "body":
            schedule, at_instant = self.plan.schedule, self.plan.at
            if schedule[at_instant[point]] - schedule[at_instant[before]] < natural - EPSILON:
                return  # it was to be cut short
            since = self._facts.reached[before]
            is_beneath = chain.type in SHIFTS and at - since < natural  # perhaps: a look has begun over it
            if is_beneath or self._facts.held_between(since, at, point.behavior):
                return  # how long it would have taken, nobody knows
            self._relearn(self.experience.learn(point.behavior, natural, at - since))

    def hear(self, behavior: str, position: int, at: Seconds, now: Seconds) -> bool:
        """Take a word of a speech; True if all that comes after it is expected at another time now.

        position: characters of the text said so far. at: when the word was finished.
        """
        if not self.utterances.hear(behavior, position, at, now):
            return False
        is_news = False
        if (interval := self.utterances.interval(behavior)) is not None:
            is_news = self._learn_words(behavior, interval, at)
            self.utterances.teach(behavior)
        return self._shift(behavior, now) or is_news

    def _learn_words(self, behavior: str, interval: Interval | None, at: Seconds) -> bool:
        if interval is None or self._facts.held_between(interval.since, at, behavior):
            return False  # a hold says nothing about the voice
        return self._relearn(self.experience.learn_words(behavior, interval.natural, at - interval.since))

    def _relearn(self, changed: Collection[str]) -> bool:
        if self.forecast is not None and changed:
            self._news.append((self.forecast.relearn, changed))
        return bool(changed)

    def _shift(self, behavior: str, now: Seconds) -> bool:
        """Let the forecast have what was heard of a speech by now, or was not; True if that changes something."""
        if not (later := self.utterances.settle(behavior, now)):
            return False
        self.is_surprised = self.is_surprised or abs(later) > NOTICEABLE
        if self.forecast is not None:
            self._news.append((self.forecast.shift, behavior, self.utterances.since[behavior]))
        return True

    def expect_next(self, behavior: str) -> None:
        """Note from when on the behavior is overdue at its next point."""
        number, chain = self._facts.next_number(behavior), self.plan.chains.get(behavior)
        if self.forecast is None or chain is None or not number:
            return
        if (estimate := self.plan.estimates.get(behavior)) is not None and estimate.words:
            self.utterances.pass_point(chain, estimate.words, number, self._facts.reached[chain.points[number - 1]])
        if number < len(chain.points):
            self.not_before.pop(behavior, None)
            self._news.append((self._await, behavior, number))

    def _await(self, behavior: str, number: int) -> None:
        if (before := self._facts.reached.get(self.plan.chains[behavior].points[number - 1])) is not None:
            expected = before + self._phase(behavior, number)
            heapq.heappush(self._arrivals, (expected, expected, behavior, number))

    def catch_up(self) -> None:
        """Tell the forecast what has happened."""
        for function, *arguments in self._news:
            function(*arguments)
        self._news.clear()

    def update(self, now: Seconds, may_pass: Callable[[Point], bool]) -> Iterable[int]:
        """Draw the conclusions of all that happened; returns the instants that are expected at another time now.

        A behavior that is overdue by a second is expected a second from now; the time for which it is held does not
        count, nor that in which it brakes for a hold point. may_pass: False for one that it has to stop at.
        """
        if self.forecast is None:
            return ()
        facts, self._updated = self._facts, now
        for behavior in tuple(self.utterances.since):
            is_under_way = behavior in self.plan.chains and not facts.is_held(behavior)
            if is_under_way and not facts.holds(self.plan.chains[behavior].points[facts.next_number(behavior)]):
                self._shift(behavior, now)
        self.catch_up()
        while self._arrivals and self._arrivals[0][0] < now - EPSILON:
            _, expected, behavior, number = heapq.heappop(self._arrivals)
            chain = self.plan.chains.get(behavior)
            if chain is None or facts.next_number(behavior) != number or facts.holds(chain.points[number]):
                continue
            if self.utterances.follows(behavior):  # `_shift` says when it is overdue.
                due = self._since(behavior) + self._phase(behavior, number)
                heapq.heappush(self._arrivals, (max(now, due), expected, behavior, number))
                continue
            expected = max(expected, self.asked(chain.points[number], expected))
            until = due = expected + facts.held_between(facts.reached[chain.points[number - 1]], now, behavior)
            if not may_pass(chain.points[number]):
                until = due = due + BRAKING
            if facts.is_held(behavior):
                until = max(now, due)
            elif due < now - EPSILON:  # and not slower on purpose
                self._missed.setdefault(chain.points[number], expected)
                until = self.not_before[behavior] = now + (now - due)
                self.forecast.overdue(self.plan.at[chain.points[number]], until)
            heapq.heappush(self._arrivals, (until, expected, behavior, number))
        return self.forecast.update()

    @property
    def next_check(self) -> Seconds | None:
        """Next time to look for delays that only other blocks depend on; None: there is no need."""
        while self._arrivals and self._facts.next_number(self._arrivals[0][2]) != self._arrivals[0][3]:
            heapq.heappop(self._arrivals)  # The behavior has arrived there.
        if not self.followed or not self._arrivals:
            return None
        word = self.utterances.next_check()
        return (
            self._arrivals[0][0] if word is None else min(self._arrivals[0][0], max(word, self._updated))
        ) + OVERDUE

    def asked(self, point: Point, natural: Seconds) -> Seconds:
        """Time at which the behavior was told to be at `point`; `natural` if it was told none, or waits there.

        What it is told once it is overdue there is no excuse: that may be late because it is itself.
        """
        if point.sync in self._stops.get(point.behavior, ()):
            return natural
        told = dict(self.paces.get(point.behavior, ())).get(point.sync, natural)
        return min(told, self._missed.get(point, inf))

    def _phase(self, behavior: str, number: int) -> Seconds:
        """Expected seconds from the point before to the point of that number."""
        chain = self.plan.chains[behavior]
        if self.forecast is None:
            return chain.segments[number - 1].natural * self.experience.factor(behavior)
        before, here = (self.plan.at[point] for point in chain.points[number - 1 : number + 1])
        return 0.0 if before == here else self.forecast.phase(behavior, here)

    # -- questions -----------------------------------------------------------------------------------------------

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
            known = (self.foreseen, facts.reached, facts.arrived, self._net.fired)
            heard = self.utterances.since
            forecast = full_forecast(self.plan, facts.began, self.experience.factor, *known, self._prolonged, heard)
        return forecast.as_of(now, self._stood(now))


def differ_noticeably(one: Pace, other: Pace) -> bool:
    """True if `other` has a new point, or moves one by more than NOTICEABLE, or if only one of the two is empty."""
    if not one or not other:
        return one != other
    before = dict(one)
    return any(sync not in before or abs(before[sync] - at) > NOTICEABLE for sync, at in other)

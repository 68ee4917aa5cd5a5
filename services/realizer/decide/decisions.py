"""Decisions of the realizer, without a clock: how far each behavior may go, given the sync points measured so far.

Facts go in (`arrive`, `reach`), `advance(now)` says what to do about them, `deadline` when to ask again.

An instant fires when all behaviors that share it are there and all it waits for has been measured. Until then
behaviors that are early hold; the last to come is told to pass, and never stops. A behavior that cannot hold is kept
back where it last can, so that by prediction it comes on time, and told to be faster or slower if that is not enough;
every new fact corrects the prediction. Only what a fact touches is looked at again.
"""

import heapq
from collections.abc import Iterable
from math import inf, isfinite

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.effects import Begin, Effect, Extend, Pace
from engage_hri.services.realizer.decide.expectations import SURPRISE, Expectations
from engage_hri.services.realizer.decide.lateness import LatenessWatch
from engage_hri.services.realizer.plan.assembly import Member
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.plan.schedule import EPSILON
from engage_hri.services.realizer.points import SHIFTS, Point, performer

NOTICEABLE: Seconds = 0.02
"""Seconds; planned instants that differ by less are not worth a message."""


class Decisions(Expectations):
    """The state of one performance. began: loop time of the block's start; all times are of that clock."""

    def __init__(self, plan: Plan, began: Seconds, config: RealizerConfig) -> None:
        super().__init__(plan, began)
        self.config = config
        self.lateness_watch = LatenessWatch(config)
        self._through: dict[str, int] = {}
        self._granted_at: dict[str, Seconds] = {}
        self.replan(plan)
        self.is_surprised = False

    def replan(self, plan: Plan) -> None:
        """Go on with another plan of the same block, from the same facts: something was dropped."""
        self._set_plan(plan)
        self._look_ahead()
        size = len(plan.net.transitions)
        self._unmet = [len(sources) for sources in self._index.waits_for]
        """For each transition, the number of those it waits for, and of its behaviors that have not begun."""
        for transition, members in enumerate(plan.members):
            self._unmet[transition] += sum(self._is_to_come(member) for member in members)
        self._unreached = [len(members) for members in plan.members]
        self._granted: set[tuple[int, str]] = set()
        self._wakes: list[tuple[Seconds, int]] = []
        self._touched: set[str] = set()
        self._unended = {id for id in plan.waited_for if not self.has_ended(id)}
        self._dirty: set[int] = set()
        for transition in [each for each in range(size) if not self._unmet[each]]:
            self._open(transition)
        self._fire(0, self.began)
        for point in (*self.reached, *(self.arrived.keys() - self.reached.keys())):
            if point in plan.at:
                self._note(point)
        for behavior in self.begun:
            points = self._points.get(behavior, ())
            if self.forecast is not None and points:
                self.forecast.overdue(plan.at[points[0]], self.begun[behavior])
                for point in points:
                    self.forecast.require(plan.at[point])
            if behavior not in plan.chains:
                self.lateness_watch.forget(behavior)
            elif not self.has_ended(behavior):
                self._await(behavior)

    # -- facts ---------------------------------------------------------------------------------------------------

    def arrive(self, point: Point, at: Seconds) -> None:
        """Note that the behavior holds at `point`. A report that cannot be true is ignored."""
        if isfinite(at) and point not in self.arrived and self._is_ahead(point):
            at = self._heard[point.behavior] = self._not_before_last(point.behavior, at)
            self._learn(point, at)
            self.arrived[point] = at
            self._note(point)
            self._watch(point.behavior)

    def reach(self, point: Point, at: Seconds) -> tuple[Point, ...]:
        """Note that the behavior has passed `point`, and earlier ones that were not reported; returns what is news.

        A report that cannot be true is ignored.
        """
        if not isfinite(at):
            return ()
        if point in self._index.foreign:
            if point not in self.reached:
                self.reached[point] = at
                self._note(point)
            return ()
        if not self._is_ahead(point):
            return ()
        points, known = self._points[point.behavior], self.next_number(point.behavior)
        news = points[known : points.index(point) + 1]
        at = self._heard[point.behavior] = self._not_before_last(point.behavior, at)
        if len(news) == 1 and not self.holds(point):
            self._learn(point, at)
        for each in news:
            self.reached[each] = at
            self._note(each)
            self.is_surprised = self.is_surprised or abs(at - self._expected.get(each, at)) > SURPRISE
        self._next[point.behavior] = known + len(news)
        if self.has_ended(point.behavior):
            self._unended.discard(point.behavior)
        self._watch(point.behavior)
        self._await(point.behavior)
        return news

    def _note(self, point: Point) -> None:
        """Count a point that is reached, or arrived at, into its instant."""
        transition = self.plan.at[point]
        member = self._index.members.get(point)
        at = self.reached.get(point)
        self._dirty.add(transition)
        if self.forecast is not None:
            if at is None:
                self.forecast.come(point.behavior, transition, self.arrived[point])
            else:
                self.forecast.passed(point.behavior, transition, at)
        if at is not None and member is not None and member.point == point:
            self._unreached[transition] -= 1
            if not self._unreached[transition] and transition:
                self._fire(transition, max(self.reached[each.point] for each in self.plan.members[transition]))

    def _fire(self, transition: int, at: Seconds) -> None:
        self._instants[transition] = at
        for target in self._index.awaited_by[transition]:
            self._unmet[target] -= 1
            if not self._unmet[target]:
                self._open(target)
        if self.forecast is not None:
            self.forecast.fix(transition, at)

    def _open(self, transition: int) -> None:
        """Take up an instant: all that it waits for has been measured."""
        self._dirty.add(transition)
        if self.forecast is not None:
            self.forecast.require(transition)

    @property
    def is_over(self) -> bool:
        """True if everything has ended that the end of the block waits for."""
        return not self._unended

    # -- decisions -----------------------------------------------------------------------------------------------

    def advance(self, now: Seconds) -> list[Effect]:
        """Decide what to do now. Extensions come first: a behavior hands over before another takes its place."""
        self._conclude(now)
        while self._wakes and self._wakes[0][0] <= now + EPSILON:
            self._dirty.add(heapq.heappop(self._wakes)[1])
        beginning = self._decide_all(now)
        effects: list[Effect] = []
        for behavior in sorted(self._touched - set(beginning)):
            if behavior in self.begun and not self.has_ended(behavior):
                effects += self._extension(behavior, now)
        self._touched.clear()
        # Of two that begin together on one part, the body leaves it to the later command: the plan has the order.
        for behavior in sorted(beginning, key=self.plan.entering.index) if len(beginning) > 1 else beginning:
            through = self._furthest(behavior, now)
            self.paces[behavior] = pace(behavior, self, now)
            effects.append(Begin(behavior, self._points[behavior][through].sync, self.paces[behavior]))
            self._watch(behavior)
        effects += self.lateness_watch.overdue(now)
        return effects

    def _decide_all(self, now: Seconds) -> list[str]:
        """Decide the instants that something has changed for until nothing follows; returns behaviors that begin."""
        beginning: list[str] = []
        count = 0
        while self._dirty:
            dirty, self._dirty = sorted(self._dirty), set()
            for transition in dirty:
                self._decide(transition, now, beginning)
            for behavior in beginning[count:]:
                self.begun[behavior] = now
                self._follow(behavior, now)
            count = len(beginning)
        return beginning

    @property
    def deadline(self) -> Seconds | None:
        """Time at which to call `advance` even if nothing happens until then; None: there is no need."""
        wake = self._wakes[0][0] if self._wakes else inf
        report_due, check_due = self.lateness_watch.deadline, self._next_lateness_check
        at = min(wake, inf if report_due is None else report_due, inf if check_due is None else check_due)
        return None if at == inf else at

    def _conclude(self, now: Seconds) -> None:
        """Decide again about instants that are expected at another time than before."""
        for transition in self._changes(now):
            if transition < len(self.plan.members):
                if not self._unmet[transition]:
                    self._dirty.add(transition)
                self._touched.update(member.behavior for member in self.plan.members[transition])

    def _decide(self, transition: int, now: Seconds, beginning: list[str]) -> None:
        members = self.plan.members[transition]
        if self._unmet[transition] or (transition and transition in self._instants):
            return
        missing = [member for member in members if member.kind != "start" and not self._is_there(member)]
        may_pass = missing[0] if len(missing) == 1 and missing[0].can_wait else None
        ready = max(
            (self._instants[source] + lag for source, lag in self._index.waits_for[transition]), default=self.began
        )
        due = ready if self.forecast is None else max(ready, self.forecast.times[transition])
        for member in missing:
            if member.point in self._index.pauses:
                self._decide_pause(transition, member, due, now)
        if due > now + EPSILON:
            self._wake(transition, due)
            if may_pass is not None and (arrival := self._arrival(may_pass)) is not None and arrival >= due - EPSILON:
                # Not told earlier than necessary: if the behavior is faster than expected, it must wait after all.
                if ready - self.config.lead > now + EPSILON:
                    self._wake(transition, ready - self.config.lead)
                else:
                    self._grant(transition, may_pass)
            return
        if may_pass is not None:
            self._grant(transition, may_pass)
        if not missing:
            for member in members:
                self._grant(transition, member)
                if member.kind == "start" and member.behavior not in self.begun:
                    beginning.append(member.behavior)

    def _is_to_come(self, member: Member) -> bool:
        """True if the behavior has not begun and comes to the instant later than with its start."""
        return member.kind != "start" and member.behavior in self._points and member.behavior not in self.begun

    def _follow(self, behavior: str, now: Seconds) -> None:
        """Forecast the points of a behavior that begins: its instants no longer wait for its beginning."""
        for transition in {self.plan.at[point] for point in self._points.get(behavior, ())}:
            member = next(each for each in self.plan.members[transition] if each.behavior == behavior)
            if member.kind != "start":
                self._unmet[transition] -= 1
                if not self._unmet[transition]:
                    self._open(transition)
            if self.forecast is not None:
                self.forecast.require(transition)
                if member.kind == "start":
                    self.forecast.overdue(transition, now)
        self._conclude(now)

    def _decide_pause(self, transition: int, member: Member, due: Seconds, now: Seconds) -> None:
        """Let an utterance through a word gap unless it would be noticeably early; it is told just before."""
        arrival = self._arrival(member)
        if arrival is None or (transition, member.behavior) in self._granted:
            return
        if arrival - self.config.gap > now + EPSILON:
            self._wake(transition, arrival - self.config.gap)
        elif due <= arrival + self.config.skew:
            self._grant(transition, member)

    def _grant(self, transition: int, member: Member) -> None:
        if (transition, member.behavior) not in self._granted:
            self._granted.add((transition, member.behavior))
            self._touched.add(member.behavior)

    def _extension(self, behavior: str, now: Seconds) -> Iterable[Extend]:
        """The command to go on, if the behavior may go further than before or is to go at another pace."""
        known, before = self._through[behavior], self.paces.get(behavior, ())
        through = self._furthest(behavior, now)
        after = pace(behavior, self, now)
        if through > known or differ_noticeably(before, after):
            self.paces[behavior] = after
            self._watch(behavior)
            yield Extend(behavior, self._points[behavior][through].sync, after)

    def _furthest(self, behavior: str, now: Seconds) -> int:
        """Number of the last point that the behavior may go through."""
        points = self._points[behavior]
        known = furthest = self._through.get(behavior, -1)
        for number in range(known + 1, len(points)):
            if not self.may_pass(points[number]):
                break
            furthest = number
        if furthest > known:
            self._through[behavior] = furthest
            self._granted_at[behavior] = now
        return max(0, furthest)

    def may_pass(self, point: Point) -> bool:
        if point in self.reached or not (self.member(point).can_wait or point in self._index.pauses):
            return True
        return (self.plan.at[point], point.behavior) in self._granted

    def _wake(self, transition: int, at: Seconds) -> None:
        heapq.heappush(self._wakes, (at, transition))

    # -- reports that are due ------------------------------------------------------------------------------------

    def _watch(self, behavior: str) -> None:
        chain = self.plan.chains.get(behavior)
        if chain is None or behavior not in self.begun or performer(chain.behavior) != "body":
            return
        points, number = chain.points, self.next_number(behavior)
        if number >= len(points):
            self.lateness_watch.forget(behavior)
            return
        is_there = self.holds(points[number])
        if is_there and not self.may_pass(self.member(points[number]).point):
            self.lateness_watch.forget(behavior)
            return
        since = self.reached[points[number - 1]] if number else self.begun[behavior]
        natural = chain.segments[number - 1].natural if number else 0.0
        asked = self._asked(points[number], since + natural)
        expected = max(since + natural, asked, self._granted_at[behavior] if is_there else 0.0)
        self.lateness_watch.expect(behavior, points[number].sync, expected, natural)

    def _await(self, behavior: str) -> None:
        """Look at the next point where the behavior must ask, and expect its next report."""
        points = self._points[behavior]
        for point in points[self.next_number(behavior) :]:
            # Only now that it is under way can be told whether it comes on time to the point where it must ask next.
            if not self.may_pass(point):
                self._dirty.add(self.plan.at[point])
                break
        self._expect_next(behavior)

    # -- other blocks --------------------------------------------------------------------------------------------

    def follow(self, points: Iterable[Point]) -> None:
        """Forecast these points from now on: other blocks are tied to them (see `ahead`)."""
        self._followed.update(points)
        if self.forecast is None:
            self.replan(self.plan)
            return
        for point in self._followed & self.plan.at.keys():
            self.forecast.require(self.plan.at[point])


def pace(behavior: str, decisions: "Decisions", now: Seconds) -> Pace:
    """Instants for the behavior's points up to the next where it must ask; empty if it will come to them anyway."""
    forecast, plan = decisions.forecast, decisions.plan
    if forecast is None or behavior not in plan.chains:
        return ()
    points, segments = plan.chains[behavior].points, plan.chains[behavior].segments
    is_moving = plan.chains[behavior].type not in SHIFTS  # a shift beneath a look takes no time, and moves nothing
    number = decisions.next_number(behavior)
    at = decisions.reached[points[number - 1]] if number else now
    is_paced = forecast.is_hurried(behavior)
    planned: list[tuple[str, Seconds]] = []
    before = plan.at[points[number - 1]] if number else -1
    for index, point in enumerate(points[number:], start=number):
        here = plan.at[point]
        if here != before:
            if is_moving and index and forecast.phase(behavior, here) == 0.0 < segments[index - 1].natural:
                break  # another takes its part before this point: it need not hurry there
            natural, latest = at + forecast.phase(behavior, here), at + forecast.longest(behavior, here)
            if point is points[number] and not decisions.paces.get(behavior):
                natural = max(natural, decisions.not_before.get(behavior, natural))  # overdue, not slower on purpose
            at = max(natural, now) if decisions.holds(point) else natural
            if forecast.times[here] > natural + NOTICEABLE and decisions.member(point).kind == "passive":
                at = max(natural, min(forecast.times[here], latest))
                is_paced = is_paced or at > natural + NOTICEABLE
        before = here
        planned.append((point.sync, at))
        if not decisions.may_pass(point):
            break
    return tuple(planned) if is_paced else ()


def differ_noticeably(one: Pace, other: Pace) -> bool:
    """True if `other` has a new point, or moves one by more than NOTICEABLE, or if only one of the two is empty."""
    if not one or not other:
        return one != other
    before = dict(one)
    return any(sync not in before or abs(before[sync] - at) > NOTICEABLE for sync, at in other)

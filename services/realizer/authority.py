"""How far each behavior may go, given the sync points measured so far: the realizer's decisions, without a clock.

Facts go in (`arrive`, `reach`), `advance(now)` says what to do about them, `deadline` when to ask again.

An instant fires when all who share it are there and all it waits for has been measured. Until then those who are
early hold; the last to come is told to pass, and never stops. What cannot hold is kept back where it last can, so
that by prediction it comes on time; every new fact corrects the prediction.
"""

from msgspec import Struct

from schemas.units import Seconds
from services.realizer.assembly import Member
from services.realizer.config import RealizerConfig
from services.realizer.planner import Plan
from services.realizer.points import Point, performer
from services.realizer.schedule import EPSILON, Lag, PositiveCycle, earliest


class Begin(Struct, frozen=True):
    """Start `behavior`; it may go through `through` without asking."""

    behavior: str
    through: str


class Extend(Struct, frozen=True):
    """`behavior` may now go through `through`."""

    behavior: str
    through: str


class Late(Struct, frozen=True):
    """`behavior` is taking much longer to `sync` than it should."""

    behavior: str
    sync: str
    overdue: Seconds


class Stalled(Struct, frozen=True):
    """`behavior` has been late for `sync` so long that it must be given up."""

    behavior: str
    sync: str
    overdue: Seconds


Effect = Begin | Extend | Late | Stalled


class Authority:
    """The state of one performance. began: loop time of the block's start; all times are of that clock."""

    def __init__(self, plan: Plan, began: Seconds, config: RealizerConfig) -> None:
        self.began = began
        self.config = config
        self.reached: dict[Point, Seconds] = {}
        self.arrived: dict[Point, Seconds] = {}
        self.begun: dict[str, Seconds] = {}
        self.deadline: Seconds | None = None
        self._through: dict[str, int] = {}
        self._granted_at: dict[str, Seconds] = {}
        self._warned: set[str] = set()
        self.replan(plan)

    def replan(self, plan: Plan) -> None:
        """Go on with another plan of the same block, from the same facts: something was dropped."""
        self.plan = plan
        net = plan.net
        self._waits_for: list[list[tuple[int, Seconds]]] = [[] for _ in net.transitions]
        for place in net.places:
            if place.kind in ("order", "delay", "series"):
                self._waits_for[place.target].append((place.source, place.lag))
        self._points = {id: chain.points for id, chain in plan.chains.items()}
        self._member_at = {
            (member.behavior, transition): member
            for transition, members in enumerate(plan.members)
            for member in members
        }
        self._bounds = plan.bounds
        self._instants: dict[int, Seconds] = {0: self.began}
        """When each transition fired that has."""
        self._is_predictive = _is_predictive(plan)
        self._open = [each for each in range(len(net.transitions) - 1) if self._measured(each) is None or each == 0]

    # -- facts ---------------------------------------------------------------------------------------------------

    def arrive(self, point: Point, at: Seconds) -> None:
        """The behavior holds at `point`."""
        if point in self.plan.at:
            self.arrived.setdefault(point, at)

    def reach(self, point: Point, at: Seconds) -> tuple[Point, ...]:
        """The behavior has passed `point`: it, and earlier points whose report was lost, unless known already."""
        points = self._points.get(point.behavior, ())
        if point not in points:
            if point in self.plan.at:
                self.reached.setdefault(point, at)
            return ()
        news = []
        for each in points[: points.index(point) + 1]:
            if each not in self.reached:
                self.reached[each] = at
                news.append(each)
        return tuple(news)

    def has_ended(self, behavior: str) -> bool:
        points = self._points.get(behavior)
        return points is None or points[-1] in self.reached

    @property
    def is_over(self) -> bool:
        """Has everything ended that the block waits for?"""
        return all(self.has_ended(behavior) for behavior in self.plan.waited_for)

    # -- decisions -----------------------------------------------------------------------------------------------

    def advance(self, now: Seconds) -> list[Effect]:
        """What to do now. Extensions come before beginnings: who hands over leaves before his successor comes."""
        self.deadline = None
        self._open = [each for each in self._open if each == 0 or self._measured(each) is None]
        forecast = self._forecast(now) if self._is_predictive else None
        granted: set[tuple[int, str]] = set()
        beginning: list[str] = []
        for transition in self._open:
            self._decide(transition, now, forecast, granted, beginning)
        effects: list[Effect] = []
        for behavior in self.begun:
            if not self.has_ended(behavior) and (through := self._extension(behavior, granted, now)):
                effects.append(Extend(behavior, through))
        for behavior in beginning:
            self.begun[behavior] = now
            effects.append(Begin(behavior, self._extension(behavior, granted, now) or "start"))
        effects += self._overdue(now)
        return effects

    def _decide(
        self,
        transition: int,
        now: Seconds,
        forecast: list[Seconds] | None,
        granted: set[tuple[int, str]],
        beginning: list[str],
    ) -> None:
        members = self.plan.members[transition]
        ready = self._ready_at(transition)
        if ready is None:
            return
        missing = [member for member in members if member.kind != "start" and not self._is_there(member)]
        due = ready if forecast is None else max(ready, forecast[transition])
        if due > now + EPSILON:
            self._wake_at(due)
            if len(missing) != 1 or missing[0].kind != "hold":
                return
            arrival = self._arrival(missing[0])
            if arrival is not None and arrival >= due - EPSILON:
                granted.add((transition, missing[0].behavior))
            return
        if not missing:
            for member in members:
                granted.add((transition, member.behavior))
                if member.kind == "start" and member.behavior not in self.begun:
                    beginning.append(member.behavior)
        elif len(missing) == 1 and missing[0].kind == "hold":
            granted.add((transition, missing[0].behavior))

    def _measured(self, transition: int) -> Seconds | None:
        """When the instant was, all its members told; None as long as one has not."""
        if (instant := self._instants.get(transition)) is not None:
            return instant
        latest = None
        for member in self.plan.members[transition]:
            if (at := self.reached.get(member.point)) is None:
                return None
            latest = at if latest is None else max(latest, at)
        if latest is not None:
            self._instants[transition] = latest
        return latest

    def _ready_at(self, transition: int) -> Seconds | None:
        """When everything it waits for will have been; None while something of it has not been measured."""
        ready = self.began
        for source, lag in self._waits_for[transition]:
            measured = self._measured(source)
            if measured is None:
                return None
            ready = max(ready, measured + lag)
        return ready

    def _is_there(self, member: Member) -> bool:
        return member.point in self.reached or (member.kind == "hold" and member.point in self.arrived)

    def _arrival(self, member: Member) -> Seconds | None:
        """When a behavior under way will come to its hold point; None if it has not begun."""
        chain = self.plan.chains[member.behavior]
        seconds = 0.0
        for number in range(chain.points.index(member.point), -1, -1):
            if (since := self.reached.get(chain.points[number])) is not None:
                return since + seconds
            if number:
                seconds += chain.segments[number - 1].natural
        return None

    def _extension(self, behavior: str, granted: set[tuple[int, str]], now: Seconds) -> str | None:
        """The last point it may go through, if that is further than before."""
        points = self._points[behavior]
        known = self._through.get(behavior, -1)
        furthest = known
        for number in range(known + 1, len(points)):
            transition = self.plan.at[points[number]]
            member = self._member(behavior, transition)
            if member.kind == "hold" and points[number] not in self.reached and (transition, behavior) not in granted:
                break
            furthest = number
        if furthest == known:
            return None
        self._through[behavior] = furthest
        self._granted_at[behavior] = now
        return points[furthest].sync

    def _wake_at(self, at: Seconds) -> None:
        self.deadline = at if self.deadline is None else min(at, self.deadline)

    def _forecast(self, now: Seconds) -> list[Seconds]:
        """When each instant will be, as far as is known now: bounds included."""
        net = self.plan.net
        times = [now] * len(net.transitions)
        facts = []
        for transition in range(len(net.transitions)):
            if (measured := self._measured(transition)) is not None:
                times[transition] = measured
                facts.append(transition)
        lags = []
        for place in net.places:
            if place.kind == "phase":
                if self._has_come(place.behavior, place.target):
                    continue
                if (since := self._passed(place.behavior, place.source)) is not None:
                    times[place.target] = max(times[place.target], since + place.lag)
                    continue
            if place.kind != "idle":
                lags.append(Lag(place.source, place.target, place.lag, 0))
        for bound in self._bounds:
            if bound.kind != "phase" or self._passed(bound.behavior, bound.target) is None:
                lags.append(Lag(bound.source, bound.target, bound.lag, -1))
        try:
            return earliest(times, facts, lags)
        except PositiveCycle:
            return earliest(times, facts, [lag for lag in lags if lag.reason >= 0])

    def _member(self, behavior: str, transition: int) -> Member:
        return self._member_at[behavior, transition]

    def _passed(self, behavior: str, transition: int) -> Seconds | None:
        return self.reached.get(self._member(behavior, transition).point)

    def _has_come(self, behavior: str, transition: int) -> bool:
        return self._is_there(self._member(behavior, transition))

    # -- patience ------------------------------------------------------------------------------------------------

    def _overdue(self, now: Seconds) -> list[Effect]:
        effects: list[Effect] = []
        for behavior, began in self.begun.items():
            chain = self.plan.chains.get(behavior)
            if chain is None or self.has_ended(behavior) or performer(chain.behavior) != "body":
                continue
            points = chain.points
            number = next(number for number, point in enumerate(points) if point not in self.reached)
            # A gaze holds at `relax`, where its `stroke_end` is reported too: what counts is the instant.
            holds_at = self._member(behavior, self.plan.at[points[number]]).point
            if holds_at in self.arrived and self._through[behavior] < points.index(holds_at):
                continue
            since = self.reached[points[number - 1]] if number else began
            natural = chain.segments[number - 1].natural if number else 0.0
            expected = max(since + natural, self._granted_at[behavior] if holds_at in self.arrived else 0.0)
            late = expected + self.config.late + self.config.late_factor * natural
            stalled = expected + self.config.stall + self.config.stall_factor * natural
            if now >= stalled - EPSILON:
                effects.append(Stalled(behavior, points[number].sync, now - expected))
            elif now >= late - EPSILON:
                self._wake_at(stalled)
                if behavior not in self._warned:
                    self._warned.add(behavior)
                    effects.append(Late(behavior, points[number].sync, now - expected))
            else:
                self._wake_at(late)
        return effects


def _is_predictive(plan: Plan) -> bool:
    """Is anything constrained that cannot wait, or bounded from above? Else nothing need be predicted."""
    if any(bound.kind != "phase" for bound in plan.bounds):
        return True
    for transition, members in enumerate(plan.members):
        if any(member.kind == "passive" for member in members) and (
            len(members) > 1
            or any(
                place.target == transition and place.kind in ("order", "delay", "series") for place in plan.net.places
            )
        ):
            return True
    return False

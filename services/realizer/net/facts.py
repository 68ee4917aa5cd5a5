"""Facts of a running block: what has been measured so far, and what follows from that alone.

Bodies report late, twice, out of order, and about what was never asked of them. Such a report is no fact, and
changes nothing.

What was held, and when, is a fact, too: holds have stopped clocks and phases (`Stops`). Another plan of the block has
to know what has stood for how long, or it would take what a hold cost for lateness.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from functools import partial
from math import inf, isfinite

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.running import RunningNet
from engage_hri.services.realizer.points import Point, frozen

STANDING: Seconds = 0.5
"""Seconds in which a body comes to stand once it is held, and gets under way again."""


class Hold(Struct, frozen=True):
    """Time in which the same was held. behaviors: which clocks stood, by what they lead to; None: all of them."""

    since: Seconds
    until: Seconds
    behaviors: Collection[str] | None

    def names(self, behaviors: Iterable[str]) -> bool:
        """True if one of these was held."""
        return self.behaviors is None or any(each in self.behaviors for each in behaviors)


class Stops(Struct, frozen=True):
    """Measure of what holds have stopped. All times are seconds from the start of the block.

    holds: one after the other, up to now. phases: for a point, the seconds in which its behavior stood on its way
    there. times: of points that are reached, and of others as they are expected now. cost: for a point and one
    before it, the seconds for which holds account, of those by which it is later than allowed after that: the
    allowed seconds, and those by which it is later.
    """

    holds: tuple[Hold, ...] = ()
    phases: Mapping[Point, Seconds] = {}
    reached: Mapping[Point, Seconds] = {}
    times: Mapping[Point, Seconds] = {}
    cost: Callable[[Point, Point, Seconds, Seconds], Seconds] = lambda late, early, allowed, by: 0.0

    def of_clock(self, behaviors: Collection[str], since: Seconds, lag: Seconds) -> Seconds:
        """Seconds for which a clock stood that began to run at a time for so long, and leads to these behaviors.

        As `RunningNet.prolonged`: a hold that comes when the clock has run down stops it no more.
        """
        ripe = since + lag
        for hold in self.holds:
            if hold.until > since and hold.since < ripe and hold.names(behaviors):
                ripe += hold.until - max(hold.since, since)
        return ripe - since - lag

    def of(self, behavior: str, since: Seconds, until: Seconds) -> Seconds:
        """Seconds between these times in which a behavior was held."""
        overlaps = (min(each.until, until) - max(each.since, since) for each in self.holds if each.names((behavior,)))
        return sum(each for each in overlaps if each > 0.0)


NO_STOPS = Stops()


class Facts:
    """Measured times, by the clock of the loop. They outlive the net: another plan of the block starts from them.

    began: when the block started. begun: when each behavior was told to begin. reached, arrived: when each point was
    passed, and held at. held: behaviors that are to wait where they next can (`hold`); None: all of them. stuck:
    points of other blocks that do not come before what is held goes on. standing: those that come no nearer either.
    """

    def __init__(self, began: Seconds) -> None:
        self.began = began
        self.reached: dict[Point, Seconds] = {}
        self.arrived: dict[Point, Seconds] = {}
        self.begun: dict[str, Seconds] = {}
        self._under_way: set[str] = set()
        self._next: dict[str, int] = {}
        """For each behavior, the number of its points that are reached."""
        self._heard: dict[str, Seconds] = {}
        """Time of the latest report of each behavior."""
        self.held: Collection[str] | None = ()
        self.stuck: frozenset[Point] = frozen()
        self.standing: frozenset[Point] = frozen()
        self._holds: list[tuple[Seconds, Collection[str] | None]] = []
        """The times at which other behaviors were held than before, and which."""
        self._words: dict[str, list[Seconds]] = {}
        """When the voice has finished words of each behavior."""

    def adopt(self, net: RunningNet, points: Mapping[str, tuple[Point, ...]]) -> None:
        """Let `net` run from its start to where these facts bring it. points: of each behavior, in order."""
        self._net = net
        self._points = points
        net.start(self.began)
        waiting = self.arrived.keys() - self.reached.keys()
        happened: list[tuple[Seconds, Callable[[], None]]] = [
            *((at, partial(net.begin, behavior, at)) for behavior, at in self.begun.items()),
            *((at, partial(net.reach, point, at)) for point, at in self.reached.items()),
            *((self.arrived[each], partial(net.arrive, each, self.arrived[each])) for each in waiting),
        ]
        if self._holds:  # What was held stopped the clocks of its time; else the order of these does not matter.
            happened += [(at, partial(net.stop_and_go, held, at)) for at, held in self._holds]
            happened.sort(key=lambda each: each[0])
        for _, happen in happened:
            happen()

    # -- what is measured ----------------------------------------------------------------------------------------

    def begin(self, behavior: str, at: Seconds) -> None:
        """Note that a behavior was told to begin."""
        self.begun[behavior] = at
        self._under_way.add(behavior)
        self._net.begin(behavior, at)

    def arrive(self, point: Point, at: Seconds) -> None:
        """Note that the behavior holds at `point`, which is ahead of it."""
        self.arrived[point] = self._heard[point.behavior] = at = self.bounded(point, at)
        self._net.arrive(point, at)

    def reach(self, point: Point, at: Seconds) -> tuple[Point, ...]:
        """Note that the behavior has passed `point`, which is ahead of it, and earlier ones that were not reported.

        Returns these points.
        """
        points, known = self._points[point.behavior], self.next_number(point.behavior)
        news = points[known : points.index(point, known) + 1]
        self._heard[point.behavior] = at = self.bounded(point, at)
        self._next[point.behavior] = known + len(news)
        self.reached.update(dict.fromkeys(news, at))
        if point == points[-1]:
            self._under_way.discard(point.behavior)
        for each in news:
            self._net.reach(each, at)
        return news

    def hear(self, point: Point, at: Seconds) -> None:
        """Note that a point of another block is reached."""
        if isfinite(at) and point not in self.reached:
            self.reached[point] = at
            self._net.reach(point, at)

    def hold(
        self,
        behaviors: Collection[str] | None,
        now: Seconds,
        stuck: Collection[Point] = (),
        standing: Collection[Point] = (),
    ) -> None:
        """Note that these behaviors, and no others, are held from now on (None: all of them), and what is stuck.

        Clocks before their instants stop, and those before points of other blocks that are stuck.
        """
        self.held, self.stuck, self.standing = behaviors, frozen(stuck), frozen(standing)
        stopped = None if behaviors is None else {*behaviors, *(point.behavior for point in stuck)}
        self._holds.append((now, stopped))
        self._net.hold(stopped, now)

    def plausible(self, point: Point, at: Seconds, now: Seconds) -> Seconds:
        """`at`, but no later than now, and no earlier than the behavior's last report: clocks differ, bodies err."""
        return self.bounded(point, min(at, now) if isfinite(at) else now)

    def bounded(self, point: Point, at: Seconds) -> Seconds:
        """`at`, but no earlier than the last report of the behavior, and its beginning."""
        return max(at, self._heard.get(point.behavior, at), self.begun.get(point.behavior, at))

    def is_ahead(self, point: Point) -> bool:
        """True if the behavior has begun, and has not passed `point` yet."""
        if point.behavior not in self.begun or point in self.reached:
            return False
        return point in self._points.get(point.behavior, ())

    # -- what follows --------------------------------------------------------------------------------------------

    def has_ended(self, behavior: str) -> bool:
        """True if the behavior has passed all its points, or is not in the block any more."""
        points = self._points.get(behavior)
        return points is None or points[-1] in self.reached

    @property
    def under_way(self) -> Iterable[str]:
        """Behaviors that have begun and not ended."""
        return (behavior for behavior in self._under_way if not self.has_ended(behavior))

    def next_number(self, behavior: str) -> int:
        """Number of points of the behavior that are reached."""
        return self._next.get(behavior, 0)

    def holds(self, point: Point) -> bool:
        """True if the behavior has arrived at the instant of `point`.

        A gaze holds at `relax`, and its `stroke_end` is the same instant.
        """
        return self._net.part_of[point].point in self.arrived

    @property
    def is_holding(self) -> bool:
        """True if any behavior is held, or anything stuck elsewhere."""
        return self.held is None or bool(self.held) or bool(self.stuck)

    @property
    def has_held(self) -> bool:
        """True if anything has been held since the block began."""
        return bool(self._holds)

    @property
    def last_hold(self) -> Seconds | None:
        """Latest time at which others were held than before, or none any more; None: none ever was."""
        return self._holds[-1][0] if self._holds else None

    def is_held(self, behavior: str) -> bool:
        """True if the behavior is to wait where it next can."""
        return self.held is None or behavior in self.held

    def say(self, behavior: str, at: Seconds) -> None:
        """Note that the voice has finished a word: the one in which it is held, perhaps. Then it stands."""
        self._words.setdefault(behavior, []).append(at)

    @property
    def silent(self) -> frozenset[str]:
        """Behaviors that are held, and whose voice has come to the end of a word since: they come no nearer."""
        return frozen(
            behavior
            for behavior, words in self._words.items()
            if self.is_held(behavior) and words[-1] >= self._holds_of(behavior, inf)[-1][0]
        )

    def stood_between(self, since: Seconds, until: Seconds, behavior: str) -> Seconds:
        """Seconds between these times in which the behavior was held and stood: from the end of its last word on.

        A hold is over before a voice that tells of its words could stand, if it is short and no word has ended in it.
        """
        stood, told = 0.0, self._words.get(behavior, ())
        for first, last in self._holds_of(behavior, until):
            words = [word for word in told if first <= word <= last]
            if words or not told or last - first > STANDING:
                stood += _overlap(max([first, *words]), last, since, until)
        return stood

    def held_between(self, since: Seconds, until: Seconds, behavior: str = "") -> Seconds:
        """Seconds between these times in which the behavior was held; empty: in which any was."""
        if not self._holds:  # asked at every point
            return 0.0
        return sum(_overlap(first, last, since, until) for first, last in self._holds_of(behavior, until))

    def holds_so_far(self, now: Seconds) -> tuple[Hold, ...]:
        """All times in which the same was held, up to now, in seconds from the block's start."""
        ends = [*(at for at, _ in self._holds[1:]), now]
        began, holds = self.began, zip(self._holds, ends, strict=False)
        return tuple([Hold(at - began, end - began, held) for (at, held), end in holds if held is None or held])

    def _holds_of(self, behavior: str, until: Seconds) -> list[tuple[Seconds, Seconds]]:
        """Intervals in which the behavior (empty: any) was held; the last goes on to `until` if it is held still."""
        found: list[tuple[Seconds, Seconds]] = []
        ends = [*(at for at, _ in self._holds[1:]), until]
        for (at, held), end in zip(self._holds, ends, strict=False):
            if held is None or (behavior in held if behavior else held):
                first = found.pop()[0] if found and found[-1][1] == at else at
                found.append((first, end))
        return found


def _overlap(first: Seconds, last: Seconds, since: Seconds, until: Seconds) -> Seconds:
    """Seconds that are both between the first two times and between the other two."""
    return max(0.0, min(last, until) - max(first, since))

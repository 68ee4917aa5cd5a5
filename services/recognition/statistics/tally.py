"""Counts, delays and times between connection events, updated with each change: Table 2.1 of the thesis.

The time between events is the difference of successive *starts*, of all kinds and both initiators, failures
included. Starts may become known late (a backchannel shows only at its end), so recent ones are kept sorted and
gaps are final only after `SETTLED`. Memory is bounded by the events of that time and of the recent window.

A change is only counted when it comes. What follows from the counts is made when somebody reads it, and so is all
that is told of the recent window: of each event in it only the last change is kept.
"""

from bisect import bisect_left, insort
from collections.abc import Iterable, Sequence
from operator import sub
from typing import NamedTuple

from msgspec import Struct, field

from engage_hri.schemas.behaviors import EVENT_KINDS, EventKind
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, KindStatistics, WindowStatistics
from engage_hri.schemas.units import Seconds, Stamp

SETTLED: Seconds = 120.0
"""Longest time until a start becomes known: a later one is counted, but splits no gap."""


def is_same_start(one: ConnectionEvent, other: ConnectionEvent) -> bool:
    """True if an event that is not decided is the other one, told by another life under another id."""
    return one.state == "started" and (one.kind, one.started, one.initiator, one.responder) == (
        other.kind, other.started, other.initiator, other.responder
    )  # fmt: skip


class Spread(Struct):
    """Number, sum, least and greatest of some delays."""

    number: int = 0
    sum: Seconds = 0.0
    least: Seconds | None = None
    greatest: Seconds | None = None

    def add(self, delay: Seconds) -> None:
        self.number += 1
        self.sum += delay
        if self.least is None or delay < self.least:
            self.least = delay
        if self.greatest is None or delay > self.greatest:
            self.greatest = delay

    @property
    def mean(self) -> Seconds | None:
        return self.sum / self.number if self.number else None

    def join(self, other: "Spread") -> None:
        """Add the delays of another."""
        self.number += other.number
        self.sum += other.sum
        self.least = min((each for each in (self.least, other.least) if each is not None), default=None)
        self.greatest = max((each for each in (self.greatest, other.greatest) if each is not None), default=None)

    @classmethod
    def resumed(cls, number: int, least: Seconds | None, mean: Seconds | None, greatest: Seconds | None) -> "Spread":
        """Spread of `number` delays, of which these are known; none if there is no mean."""
        return cls() if mean is None else cls(number, number * mean, least, greatest)


class Count(Struct):
    """Count of one kind of event. failed: without the optional ones."""

    count: int = 0
    succeeded: int = 0
    failed: int = 0
    delays: Spread = field(default_factory=Spread)
    failed_delays: Spread = field(default_factory=Spread)
    error: Seconds = 0.0
    """Greatest known error of the delays."""

    def decide(self, event: ConnectionEvent) -> None:
        """Count a success or a failure; nothing else changes the rates."""
        if event.is_answered_by_another:
            return
        if event.state == "succeeded":
            self.succeeded += 1
            if event.delay is None:
                return
            self.delays.add(event.delay)
        elif event.state == "failed" and not event.optional:
            self.failed += 1
            self.failed_delays.add(event.delay or 0.0)
        else:
            return
        if event.delay_error is not None and event.delay_error > self.error:
            self.error = event.delay_error

    def join(self, other: "Count") -> None:
        """Add what another has counted."""
        self.count += other.count
        self.succeeded += other.succeeded
        self.failed += other.failed
        self.delays.join(other.delays)
        self.failed_delays.join(other.failed_delays)
        self.error = max(self.error, other.error)

    def statistics(self, kind: EventKind) -> KindStatistics:
        delays, failed_delays, decided = self.delays, self.failed_delays, self.succeeded + self.failed
        return KindStatistics(
            kind=kind, count=self.count, succeeded=self.succeeded, failed=self.failed,
            delay_min=delays.least, delay_mean=delays.mean, delay_max=delays.greatest,
            failure_rate=self.failed / decided if decided else None,
            failed_delay_min=failed_delays.least, failed_delay_mean=failed_delays.mean,
            failed_delay_max=failed_delays.greatest, delay_error=self.error,
        )  # fmt: skip


class Starts:
    """Starts of connection events, in order: their number, mean and largest difference."""

    def __init__(self) -> None:
        self._kept: list[Seconds] = []
        self._settled = 0
        """Number of starts that are counted and no longer kept."""
        self._first: Seconds = float("inf")
        """Earliest of the settled starts."""
        self._largest_settled: Seconds = float("-inf")

    def add(self, start: Seconds) -> None:
        kept = self._kept
        if not kept or start >= kept[-1]:
            kept.append(start)
            if kept[0] < start - 2 * SETTLED:  # now and then, and not at each start
                self._settle(start - SETTLED)
        elif self._settled and start < kept[0]:
            self._settled += 1
            self._first = min(self._first, start)
        else:
            insort(kept, start)

    def resume(self, count: int, mean: Seconds | None, largest: Seconds | None, last: Stamp | None) -> None:
        """Go on from the numbers of a former life."""
        if last is not None and count:
            self._kept, self._settled = [last.seconds], count - 1
            if mean is not None and largest is not None:
                self._first, self._largest_settled = last.seconds - mean * (count - 1), largest

    def join(self, other: "Starts") -> None:
        """Add the starts of another. Between those that are no longer kept the largest of both differences counts."""
        self._kept = sorted((*self._kept, *other._kept))
        self._settled += other._settled
        self._first = min(self._first, other._first)
        self._largest_settled = max(self._largest_settled, other._largest_settled)

    def _settle(self, horizon: Seconds) -> None:
        """Summarize the starts before `horizon`. The last of them is kept, for the next difference."""
        settled = bisect_left(self._kept, horizon) - 1
        if settled > 0:
            self._first = min(self._first, self._kept[0])
            self._largest_settled = max(self._largest_settled, *_differences(self._kept[: settled + 1]))
            self._settled += settled
            del self._kept[:settled]

    @property
    def count(self) -> int:
        return self._settled + len(self._kept)

    @property
    def last(self) -> Seconds | None:
        return self._kept[-1] if self._kept else None

    @property
    def mean_difference(self) -> Seconds | None:
        if self.count < 2:
            return None
        return (self._kept[-1] - min(self._first, self._kept[0])) / (self.count - 1)

    @property
    def largest_difference(self) -> Seconds | None:
        return None if self.count < 2 else max((self._largest_settled, *_differences(self._kept)))


def _differences(starts: Sequence[Seconds]) -> list[Seconds]:
    return list(map(sub, starts[1:], starts))


class _Window:
    """Counts and starts of the session, or of the recent window."""

    def __init__(self) -> None:
        self.counts = {kind: Count() for kind in EVENT_KINDS}
        self.starts = Starts()
        self.own_starts = Starts()
        """Starts without the glances that the maintenance policy caused."""

    def begin(self, event: ConnectionEvent) -> None:
        start = event.started.seconds
        self.counts[event.kind].count += 1
        self.starts.add(start)
        if event.cause != "maintenance":
            self.own_starts.add(start)

    def resume(self, former: WindowStatistics) -> None:
        """Go on from the numbers of a former life.

        It does not tell how many starts the maintenance policy did not cause, only their mean difference and the last
        of them. So the first start of all is taken for one of them.
        """
        for each in former.kinds:
            self.counts[each.kind] = Count(
                each.count, each.succeeded, each.failed,
                Spread.resumed(each.succeeded, each.delay_min, each.delay_mean, each.delay_max),
                Spread.resumed(each.failed, each.failed_delay_min, each.failed_delay_mean, each.failed_delay_max),
                each.delay_error,
            )  # fmt: skip
        self.starts.resume(former.events, former.mtbce, former.max_gap, former.last_start)
        own, last, mean = 1, former.last_start_without_maintenance, former.mtbce_without_maintenance
        if last is not None and mean and former.last_start is not None and former.mtbce is not None:
            first = former.last_start.seconds - former.mtbce * (former.events - 1)
            own = 1 + round((last.seconds - first) / mean)
        self.own_starts.resume(own, mean, former.max_gap, last)

    def join(self, other: "_Window") -> None:
        """Add the counts and starts of another."""
        for kind, count in other.counts.items():
            self.counts[kind].join(count)
        self.starts.join(other.starts)
        self.own_starts.join(other.own_starts)

    def statistics(self, clock: str) -> WindowStatistics:
        starts, own = self.starts, self.own_starts
        return WindowStatistics(
            kinds=tuple(count.statistics(kind) for kind, count in self.counts.items()),
            mtbce=starts.mean_difference, mtbce_without_maintenance=own.mean_difference,
            max_gap=starts.largest_difference, events=starts.count,
            last_start=None if starts.last is None else Stamp(clock, starts.last),
            last_start_without_maintenance=None if own.last is None else Stamp(clock, own.last),
        )  # fmt: skip


class RecentPace(NamedTuple):
    """Pace of the recent window, for engagement."""

    first: Seconds | None = None
    last: Seconds | None = None
    events: int = 0
    failed: int = 0
    judged: int = 0

    @property
    def mean(self) -> Seconds | None:
        """Mean time between the events."""
        if self.first is None or self.last is None or self.events < 2:
            return None
        return (self.last - self.first) / (self.events - 1)


class EventTally:
    """Statistics of one actor's events, or of all. window: length of the recent window. clock: of the stamps.

    The recent window holds the events that started in the last `window` seconds, as they have been decided since.
    """

    def __init__(self, window: Seconds, clock: str = "loop") -> None:
        self._length = window
        self._clock = clock
        self._session = _Window()
        self._recent: dict[str, ConnectionEvent] = {}
        """Events of the recent window, and some that have left it, by id: each as started, or as decided."""
        self._open: dict[str, bool] = {}
        """Events that have not ended, by id; whether they are decided."""

    def feed(self, event: ConnectionEvent) -> None:
        """Count one change of an event. Repeated and unknown ones change nothing."""
        id, state = event.id, event.state
        if state == "started":
            if id not in self._open:
                self._open[id] = False
                self._session.begin(event)
                self._forget(event.at.seconds)
                self._recent[id] = event
        elif (is_decided := self._open.get(id)) is not None:
            if not is_decided and state != "completed":
                self._open[id] = True
                self._session.counts[event.kind].decide(event)
                if id in self._recent:
                    self._recent[id] = event
            if state in ENDINGS:
                del self._open[id]

    def _forget(self, now: Seconds) -> None:
        """Drop what has left the recent window, up to the first that has not: few are known out of order."""
        while self._recent:
            id, event = next(iter(self._recent.items()))
            if event.started.seconds + self._length > now:
                return
            del self._recent[id]

    def _window(self, now: Seconds) -> Iterable[ConnectionEvent]:
        length = self._length
        return [event for event in self._recent.values() if event.started.seconds + length > now]

    def resume(self, former: WindowStatistics) -> None:
        """Go on from the counts of a former life."""
        self._session.resume(former)

    def remember(self, event: ConnectionEvent) -> None:
        """Take an event of the recent window that a former life has counted."""
        self._recent[event.id] = event

    def join(self, other: "EventTally") -> None:
        """Add the events of another."""
        self._session.join(other._session)
        recent = sorted({**other._recent, **self._recent}.items(), key=lambda each: each[1].started.seconds)
        self._recent = dict(recent)
        self._open |= other._open

    def resume_event(self, event: ConnectionEvent) -> None:
        """Take an event that is not decided. The counts have its start, unless it came after they were last told."""
        self._recent = {id: each for id, each in self._recent.items() if not is_same_start(each, event)}
        last = self.starts.last
        if last is None or event.started.seconds > last:
            self.feed(event)
        self._open[event.id] = False
        self._recent[event.id] = event

    @property
    def starts(self) -> Starts:
        """Starts of the session."""
        return self._session.starts

    def next_change(self, now: Seconds) -> Seconds | None:
        """Time after `now` at which the next event leaves the recent window."""
        first = min((event.started.seconds for event in self._window(now)), default=None)
        return None if first is None else first + self._length

    def session(self) -> WindowStatistics:
        return self._session.statistics(self._clock)

    def recent(self, now: Seconds) -> WindowStatistics:
        window = _Window()
        for event in self._window(now):
            window.begin(event)
            window.counts[event.kind].decide(event)
        return window.statistics(self._clock)

    def pace(self, now: Seconds, robot: str) -> RecentPace:
        """Pace and failures of the recent window. Preempted, withdrawn and superseded events are not judged.

        Nor are those that the robot has not answered: they say nothing of the person. robot: its actor id.
        """
        events = self._window(now)
        starts = [event.started.seconds for event in events]
        if not starts:
            return RecentPace()
        judged = [
            event.state
            for event in events
            if not event.optional
            and (event.state == "succeeded" or (event.state == "failed" and event.initiator == robot))
            and not event.is_answered_by_another
        ]
        return RecentPace(min(starts), max(starts), len(starts), judged.count("failed"), len(judged))

"""Counts, delays and times between connection events, updated with each change: Table 2.1 of the thesis.

The time between events is the difference of successive *starts*, of all kinds and both initiators, failures
included. Starts may become known late (a backchannel shows only at its end), so recent ones are kept sorted and
gaps are final only after `SETTLED`. Memory is bounded by the events of that time and of the recent window.
"""

from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterable, Sequence
from operator import sub
from typing import get_args

from msgspec import Struct, field

from engage_hri.schemas.behaviors import EventKind
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, KindStatistics, WindowStatistics
from engage_hri.schemas.units import Seconds, Stamp

SETTLED: Seconds = 120.0
"""Longest time until a start becomes known: a later one is counted, but splits no gap."""
KINDS: tuple[EventKind, ...] = get_args(EventKind)


class Spread(Struct):
    """Number, sum, least and greatest of some delays."""

    number: int = 0
    sum: Seconds = 0.0
    least: Seconds | None = None
    greatest: Seconds | None = None

    def add(self, delay: Seconds) -> None:
        self.number += 1
        self.sum += delay
        self.least = delay if self.least is None else min(self.least, delay)
        self.greatest = delay if self.greatest is None else max(self.greatest, delay)

    @property
    def mean(self) -> Seconds | None:
        return self.sum / self.number if self.number else None


class Count(Struct):
    """Count of one kind of event. failed: without the optional ones. judged: successes and failures without those."""

    count: int = 0
    succeeded: int = 0
    failed: int = 0
    judged: int = 0
    delays: Spread = field(default_factory=Spread)
    failed_delays: Spread = field(default_factory=Spread)
    error: Seconds = 0.0
    """Greatest known error of the delays."""

    def decide(self, event: ConnectionEvent) -> None:
        """Count a success or a failure; nothing else changes the rates."""
        if event.state == "succeeded":
            self.succeeded += 1
            self.judged += not event.optional
            if event.delay is not None:
                self.delays.add(event.delay)
                self.error = max(self.error, event.delay_error or 0.0)
        elif event.state == "failed" and not event.optional:
            self.failed += 1
            self.judged += 1
            self.failed_delays.add(event.delay or 0.0)
            self.error = max(self.error, event.delay_error or 0.0)

    def statistics(self, kind: EventKind) -> KindStatistics:
        delays, failed_delays, decided = self.delays, self.failed_delays, self.succeeded + self.failed
        return KindStatistics(
            kind=kind, count=self.count, succeeded=self.succeeded, failed=self.failed,
            delay_min=delays.least, delay_mean=delays.mean, delay_max=delays.greatest,
            failure_rate=self.failed / decided if decided else None,
            failed_delay_min=failed_delays.least, failed_delay_mean=failed_delays.mean,
            failed_delay_max=failed_delays.greatest, delay_error=self.error,
        )  # fmt: skip


def _counted(events: Iterable[ConnectionEvent]) -> Count:
    count = Count()
    for event in events:
        count.count += 1
        count.decide(event)
    return count


class Starts:
    """Starts of connection events, in order: their number, mean and largest difference.

    A session settles old starts, the recent window forgets them.
    """

    def __init__(self) -> None:
        self._kept: list[Seconds] = []
        self._settled = 0
        """Number of starts that are counted and no longer kept."""
        self._first: Seconds = float("inf")
        """Earliest of the settled starts."""
        self._largest_settled: Seconds = float("-inf")
        self._largest: Seconds | None = None
        """Largest difference; None if outdated."""

    def add(self, start: Seconds) -> None:
        kept = self._kept
        if self._settled and start < kept[0]:
            self._settled += 1
            self._first = min(self._first, start)
            return
        if self._largest is not None and start >= kept[-1]:
            self._largest = max(self._largest, start - kept[-1])
        else:
            self._largest = None
        insort(kept, start)

    def settle(self, horizon: Seconds) -> None:
        """Summarize the starts before `horizon`. The last of them is kept, for the next difference."""
        settled = bisect_left(self._kept, horizon) - 1
        if settled > 0:
            self._first = min(self._first, self._kept[0])
            self._largest_settled = max(self._largest_settled, *_differences(self._kept[: settled + 1]))
            self._settled += settled
            del self._kept[:settled]

    def forget(self, number: int) -> None:
        """Drop the oldest `number` starts."""
        if number:
            del self._kept[:number]
            self._largest = None

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
        if self.count < 2:
            return None
        if self._largest is None:
            self._largest = max(self._largest_settled, *_differences(self._kept))
        return self._largest


def _differences(starts: Sequence[Seconds]) -> list[Seconds]:
    return list(map(sub, starts[1:], starts))


class _Window:
    """Counts and starts of the session, or of the recent window."""

    def __init__(self) -> None:
        self.counts = {kind: Count() for kind in KINDS}
        self.starts = Starts()
        self.own_starts = Starts()
        """Starts without the glances that the maintenance policy caused."""

    def begin(self, event: ConnectionEvent) -> None:
        self.counts[event.kind].count += 1
        self.starts.add(event.started.seconds)
        if _is_own(event):
            self.own_starts.add(event.started.seconds)

    def statistics(self, clock: str) -> WindowStatistics:
        starts, own = self.starts, self.own_starts
        return WindowStatistics(
            kinds=tuple(count.statistics(kind) for kind, count in self.counts.items()),
            mtbce=starts.mean_difference, mtbce_without_maintenance=own.mean_difference,
            max_gap=starts.largest_difference, events=starts.count,
            last_start=None if starts.last is None else Stamp(clock, starts.last),
            last_start_without_maintenance=None if own.last is None else Stamp(clock, own.last),
        )  # fmt: skip


def _is_own(event: ConnectionEvent) -> bool:
    return event.cause != "maintenance"


def _order(event: ConnectionEvent) -> tuple[Seconds, str]:
    return event.started.seconds, event.id


class EventTally:
    """Statistics of one actor's events, or of all. window: length of the recent window. clock: of the stamps.

    The recent window holds the events that started in the last `window` seconds, as they have been decided since.
    """

    def __init__(self, window: Seconds, clock: str = "loop") -> None:
        self._length = window
        self._clock = clock
        self._session = _Window()
        self._recent = _Window()
        self._recent_events: dict[EventKind, list[ConnectionEvent]] = {kind: [] for kind in KINDS}
        """Events of the recent window, in the order of their starts: each as started, or as decided."""
        self._open: set[str] = set()
        self._decided: set[str] = set()

    def feed(self, event: ConnectionEvent) -> None:
        """Count one change of an event. Repeated and unknown ones change nothing."""
        if event.state == "started":
            if event.id in self._open:
                return
            self._open.add(event.id)
            self._session.begin(event)
            self._recent.begin(event)
            insort(self._recent_events[event.kind], event, key=_order)
            for starts in (self._session.starts, self._session.own_starts):
                starts.settle(event.started.seconds - SETTLED)
        elif event.id in self._open:
            if event.id not in self._decided and event.state != "completed":
                self._decided.add(event.id)
                self._decide(event)
            if event.state in ENDINGS:
                self._open.discard(event.id)
                self._decided.discard(event.id)

    def _decide(self, event: ConnectionEvent) -> None:
        self._session.counts[event.kind].decide(event)
        events = self._recent_events[event.kind]
        index = bisect_left(events, _order(event), key=_order)
        if index < len(events) and events[index].id == event.id:
            events[index] = event
            self._recent.counts[event.kind].decide(event)

    @property
    def starts(self) -> Starts:
        """Starts of the session."""
        return self._session.starts

    @property
    def next_change(self) -> Seconds | None:
        """Time at which the oldest event leaves the recent window."""
        return min((self._leaves(events[0]) for events in self._recent_events.values() if events), default=None)

    def _leaves(self, event: ConnectionEvent) -> Seconds:
        return event.started.seconds + self._length

    def forget(self, now: Seconds) -> None:
        """Drop what has left the recent window."""
        for kind, events in self._recent_events.items():
            if events and self._leaves(events[0]) <= now:
                gone = events[: bisect_right(events, now, key=self._leaves)]
                del events[: len(gone)]
                self._recent.counts[kind] = _counted(events)
                self._recent.starts.forget(len(gone))
                self._recent.own_starts.forget(sum(map(_is_own, gone)))

    def session(self) -> WindowStatistics:
        return self._session.statistics(self._clock)

    def recent(self, now: Seconds) -> WindowStatistics:
        self.forget(now)
        return self._recent.statistics(self._clock)

    def recent_mean(self, now: Seconds) -> Seconds | None:
        """Mean time between the events of the recent window."""
        self.forget(now)
        return self._recent.starts.mean_difference

    def judged(self, now: Seconds) -> tuple[int, int]:
        """Number of recent failures, and of recent decisions that count for engagement.

        Optional events do not count, nor those preempted, withdrawn or superseded.
        """
        self.forget(now)
        counts = self._recent.counts.values()
        return sum(count.failed for count in counts), sum(count.judged for count in counts)

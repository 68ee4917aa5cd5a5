"""Counts, delays and times between connection events, kept up with each change: Table 2.1 of the thesis.

The time between events is the difference of successive *starts*, of all kinds and both initiators, failures
included. Starts may become known late (a backchannel shows only at its end), so recent ones are kept sorted and
gaps are final only after `SETTLED`.
"""

from bisect import insort
from collections.abc import Iterable
from itertools import pairwise
from typing import get_args

from msgspec import Struct

from schemas.behaviors import EventKind
from schemas.recognition import ConnectionEvent, KindStatistics, WindowStatistics
from schemas.units import Seconds, Stamp
from services.recognition.machine import ENDINGS

SETTLED: Seconds = 120.0
"""No start becomes known later than this."""
KINDS: tuple[EventKind, ...] = get_args(EventKind)


class Count(Struct):
    """One kind of event. failed: without the optional ones."""

    count: int = 0
    succeeded: int = 0
    failed: int = 0
    delays: int = 0
    delay_sum: Seconds = 0.0
    delay_min: Seconds = float("inf")
    delay_max: Seconds = float("-inf")
    failed_delay_sum: Seconds = 0.0
    failed_delay_min: Seconds = float("inf")
    failed_delay_max: Seconds = float("-inf")

    def decide(self, event: ConnectionEvent) -> None:
        """Count a success or a failure; nothing else changes the rates."""
        if event.state == "succeeded":
            self.succeeded += 1
            if event.delay is not None:
                self.delays += 1
                self.delay_sum += event.delay
                self.delay_min = min(self.delay_min, event.delay)
                self.delay_max = max(self.delay_max, event.delay)
        elif event.state == "failed" and not event.optional:
            self.failed += 1
            delay = event.delay or 0.0
            self.failed_delay_sum += delay
            self.failed_delay_min = min(self.failed_delay_min, delay)
            self.failed_delay_max = max(self.failed_delay_max, delay)

    def statistics(self, kind: EventKind) -> KindStatistics:
        decided, failed = self.succeeded + self.failed, self.failed
        return KindStatistics(
            kind=kind, count=self.count, succeeded=self.succeeded, failed=failed,
            delay_min=self.delay_min if self.delays else None,
            delay_mean=self.delay_sum / self.delays if self.delays else None,
            delay_max=self.delay_max if self.delays else None,
            failure_rate=failed / decided if decided else None,
            failed_delay_min=self.failed_delay_min if failed else None,
            failed_delay_mean=self.failed_delay_sum / failed if failed else None,
            failed_delay_max=self.failed_delay_max if failed else None,
        )  # fmt: skip


class Starts:
    """The starts of a session: their number, mean and largest difference, in bounded memory."""

    def __init__(self) -> None:
        self.count = 0
        self.first: Seconds = float("inf")
        self._unsettled: list[Seconds] = []
        self._largest_settled: Seconds | None = None

    def add(self, start: Seconds) -> None:
        self.count += 1
        self.first = min(self.first, start)
        insort(self._unsettled, start)
        horizon = self._unsettled[-1] - SETTLED
        while len(self._unsettled) > 1 and self._unsettled[1] < horizon:
            gap = self._unsettled[1] - self._unsettled[0]
            self._largest_settled = gap if self._largest_settled is None else max(self._largest_settled, gap)
            del self._unsettled[0]

    @property
    def last(self) -> Seconds | None:
        return self._unsettled[-1] if self._unsettled else None

    @property
    def mean_difference(self) -> Seconds | None:
        return (self._unsettled[-1] - self.first) / (self.count - 1) if self.count > 1 else None

    @property
    def largest_difference(self) -> Seconds | None:
        known = [] if self._largest_settled is None else [self._largest_settled]
        return max([*known, *_differences(self._unsettled)], default=None)


class _Recent(Struct, order=True):
    """An event of the recent window, by start."""

    start: Seconds
    id: str
    event: ConnectionEvent


class Tally:
    """Statistics of one actor's events, or of all. window: length of the recent window. clock: of the stamps."""

    def __init__(self, window: Seconds, clock: str = "loop") -> None:
        self.window = window
        self._clock = clock
        self.starts = Starts()
        self.own_starts = Starts()
        """Without the glances that the maintenance policy caused."""
        self._counts = {kind: Count() for kind in KINDS}
        self._recent: list[_Recent] = []
        self._open: set[str] = set()
        self._decided: set[str] = set()

    def feed(self, event: ConnectionEvent) -> None:
        """Count one change of an event. Repeated and unknown ones change nothing."""
        start = event.started.seconds
        if event.state == "started":
            if event.id in self._open:
                return
            self._open.add(event.id)
            self._counts[event.kind].count += 1
            self.starts.add(start)
            if event.cause != "maintenance":
                self.own_starts.add(start)
            insort(self._recent, _Recent(start, event.id, event), key=lambda recent: (recent.start, recent.id))
        elif event.id in self._open:
            if event.id not in self._decided and event.state != "completed":
                self._decided.add(event.id)
                self._counts[event.kind].decide(event)
                for recent in self._recent:
                    if recent.id == event.id:
                        recent.event = event
            if event.state in ENDINGS:
                self._open.discard(event.id)
                self._decided.discard(event.id)

    @property
    def next_change(self) -> Seconds | None:
        """When the oldest event leaves the recent window."""
        return self._recent[0].start + self.window if self._recent else None

    def forget(self, now: Seconds) -> None:
        """Drop what has left the recent window."""
        while self._recent and self._recent[0].start + self.window <= now:
            del self._recent[0]

    def session(self) -> WindowStatistics:
        kinds = tuple(count.statistics(kind) for kind, count in self._counts.items())
        return self._window(kinds, self.starts, self.own_starts)

    def recent(self, now: Seconds) -> WindowStatistics:
        self.forget(now)
        events = [recent.event for recent in self._recent]
        counts = {kind: Count() for kind in KINDS}
        starts, own = Starts(), Starts()
        for event in events:
            counts[event.kind].count += 1
            counts[event.kind].decide(event)
            starts.add(event.started.seconds)
            if event.cause != "maintenance":
                own.add(event.started.seconds)
        kinds = tuple(count.statistics(kind) for kind, count in counts.items())
        return self._window(kinds, starts, own)

    def judged(self, now: Seconds) -> tuple[int, int]:
        """Recent failures, and recent decisions that tell of engagement.

        Those are neither optional ones nor what was preempted, withdrawn or superseded.
        """
        self.forget(now)
        states = [recent.event.state for recent in self._recent if not recent.event.optional]
        return states.count("failed"), states.count("failed") + states.count("succeeded")

    def _window(self, kinds: tuple[KindStatistics, ...], starts: Starts, own: Starts) -> WindowStatistics:
        return WindowStatistics(
            kinds=kinds, mtbce=starts.mean_difference, mtbce_without_maintenance=own.mean_difference,
            max_gap=starts.largest_difference, events=starts.count, last_start=self._stamp(starts.last),
            last_start_without_maintenance=self._stamp(own.last),
        )  # fmt: skip

    def _stamp(self, at: Seconds | None) -> Stamp | None:
        return None if at is None else Stamp(self._clock, at)


def _differences(starts: Iterable[Seconds]) -> list[Seconds]:
    return [later - earlier for earlier, later in pairwise(starts)]

"""Time limits of events: a clock that waits for its anchors, and the sync points of blocks that are such anchors.

People get so many seconds to answer. These count from what they are to answer: not from when the event was asked for,
but from the stroke of the point, or the end of the words. Such an anchor is a sync point that the body has yet to
report, and a slow arm reports it late. If the clock did not wait for it, a person would fail because of the robot. An
anchor may never come, if its behavior was dropped. So the wait ends with the block, or after some patience.
"""

import math
from collections.abc import Iterable
from functools import lru_cache

from engage_hri.schemas.behavior_types import canonical_sync
from engage_hri.schemas.references import BLOCK_ITSELF, SyncRef
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.history import Latest

ROUNDING: Seconds = 1e-6
"""Upper limit of the rounding error in sums of times, even on clocks that have run for decades."""
BLOCKS_KEPT = 64
"""Number of blocks with realised points that are remembered, for a request that arrives after them."""


def in_time(at: Seconds, limit: Seconds) -> bool:
    """True if `at` is not later than `limit`, give or take rounding: exactly at the limit is in time."""
    return at <= limit + ROUNDING


@lru_cache(BLOCKS_KEPT)
def anchor(reference: str) -> tuple[str, Seconds] | None:
    """Sync point that a reference means, and its offset: `g:strokeStart+0.5` -> `g:stroke_start`, 0.5.

    None if the reference is bad or means no point of a behavior, but a number of seconds or the block itself.
    """
    try:
        point = SyncRef.parse(reference)
    except ValueError:
        return None
    if point.behavior in ("", BLOCK_ITSELF):
        return None
    return _name(point.behavior, point.sync), point.offset


def _name(behavior: str, sync: str) -> str:
    return f"{behavior}:{canonical_sync(sync)}"


class Blocks:
    """Blocks that run or ran recently: times of their realised points, and of their ends (`ended`)."""

    def __init__(self) -> None:
        self.ended: Latest[str, Seconds] = Latest(BLOCKS_KEPT)
        self._points: Latest[str, dict[str, Seconds]] = Latest(BLOCKS_KEPT)

    def begin(self, block: str, at: Seconds) -> None:
        """Forget what is known of an earlier performance under this id."""
        if self.ended.get(block, at) < at:
            del self.ended[block]
        if block in self._points:
            self._points[block] = {name: time for name, time in self._points[block].items() if time >= at}

    def realised(self, block: str, behavior: str, sync: str, at: Seconds) -> str:
        """Remember a point. Returns its name, `behavior:sync`."""
        name = _name(behavior, sync)
        points = self._points.get(block, {})
        points[name] = at
        self._points[block] = points
        return name

    def point(self, block: str, name: str) -> Seconds | None:
        return self._points.get(block, {}).get(name)


class LimitClock:
    """Clock of a time limit: `limit` seconds from the latest of its beginning and the anchors.

    start: time from which on it may begin. It begins when the target is shown. patience: seconds after the limit for
    which an anchor is waited for, as long as its block has not ended.
    """

    def __init__(
        self, start: Seconds, limit: Seconds, anchors: Iterable[str] = (), patience: Seconds = math.inf
    ) -> None:
        self.limit = limit
        self._patience = patience
        self._from = start
        self._not_before = start
        self._waiting = dict(filter(None, map(anchor, anchors)))
        self.shown_at = None if self._waiting else start
        """Time when the initiator has shown the target; None: not yet. Without anchors nobody knows, so at once."""

    @property
    def waiting(self) -> tuple[str, ...]:
        """Names of the anchors that have not come."""
        return tuple(self._waiting)

    def waits_for(self, name: str) -> bool:
        """True if this anchor has not come."""
        return name in self._waiting

    @property
    def deadline(self) -> Seconds:
        """Time at which the limit passes; while anchors are `waiting`, at which the patience ends, too."""
        if self._waiting:
            return self._from + self.limit + self._patience
        return max(self._from + self.limit, self._not_before)

    def realised(self, name: str, at: Seconds) -> None:
        if name in self._waiting:
            self._from = max(self._from, at + self._waiting.pop(name))
            if not self._waiting:
                self.show(at)

    def stop_waiting(self, at: Seconds) -> None:
        """Give up the anchors that have not come, for the block ended at `at`."""
        if self._waiting:
            self._waiting.clear()
            self._not_before = max(self._not_before, at)
            self.show(at)

    def show(self, at: Seconds) -> Seconds:
        """Take that the target is shown. Returns the time at which it first was."""
        if self.shown_at is None:
            self.shown_at = max(at, self._not_before)
            self._from = max(self._from, self.shown_at)
        return self.shown_at

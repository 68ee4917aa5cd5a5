"""When a time limit starts to run: sync points of blocks as realised, and the clock that waits for its anchors."""

import math
from collections.abc import Iterable

from engage_hri.schemas.behavior_types import canonical_sync
from engage_hri.schemas.syncref import BLOCK_ITSELF, SyncRef
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.events.news import Latest

ROUNDING: Seconds = 1e-6
"""Sums of times are off by less than this, on clocks that have run for decades, too."""
BLOCKS_KEPT = 64
"""Blocks whose realised points are remembered, for a request that arrives after them."""


def in_time(at: Seconds, limit: Seconds) -> bool:
    """Is `at` no later than `limit`? What happens at the very limit still counts, whatever the rounding."""
    return at <= limit + ROUNDING


def anchor(reference: str) -> tuple[str, Seconds] | None:
    """The point a sync reference means, and the offset: `g:strokeStart+0.5` -> `g:stroke_start`, 0.5.

    None for what is no point of a behavior: a bad reference, a number of seconds, the block itself.
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
    """What is known of the blocks that run or ran recently: realised points by `anchor`, and when they ended."""

    def __init__(self) -> None:
        self._points: Latest[str, dict[str, Seconds]] = Latest(BLOCKS_KEPT)
        self._ended: Latest[str, Seconds] = Latest(BLOCKS_KEPT)

    def realised(self, block: str, behavior: str, sync: str, at: Seconds) -> str:
        """Remember a point; its anchor."""
        name = _name(behavior, sync)
        points = self._points.get(block, {})
        points[name] = at
        self._points[block] = points
        return name

    def end(self, block: str, at: Seconds) -> None:
        self._ended[block] = at

    def ended(self, block: str) -> Seconds | None:
        return self._ended.get(block)

    def point(self, block: str, name: str) -> Seconds | None:
        return self._points.get(block, {}).get(name)


class LimitClock:
    """`limit` seconds from the latest of `start` and the anchors.

    patience: how much longer to wait for an anchor that does not come, though nobody says that the block has ended.
    """

    def __init__(
        self, start: Seconds, limit: Seconds, anchors: Iterable[str] = (), patience: Seconds = math.inf
    ) -> None:
        self.limit = limit
        self._patience = patience
        self._from = start
        self._not_before = start
        self._waiting = dict(filter(None, map(anchor, anchors)))

    @property
    def waiting(self) -> tuple[str, ...]:
        return tuple(self._waiting)

    @property
    def deadline(self) -> Seconds:
        """When the limit passes, or the patience, as long as there is somebody `waiting`."""
        if self._waiting:
            return self._from + self.limit + self._patience
        return max(self._from + self.limit, self._not_before)

    def realised(self, name: str, at: Seconds) -> None:
        if name in self._waiting:
            self._from = max(self._from, at + self._waiting.pop(name))

    def stop_waiting(self, at: Seconds) -> None:
        """The block has ended: anchors that have not come never will."""
        if self._waiting:
            self._waiting.clear()
            self._not_before = max(self._not_before, at)

"""When a time limit starts to run: sync points of blocks as realised, and the clock that waits for its anchors."""

from collections import OrderedDict
from collections.abc import Iterable

from schemas.units import Seconds

BLOCKS_KEPT = 64
"""Blocks whose realised points are remembered, for a request that arrives after them."""


def anchor(reference: str) -> str:
    """`block-1:gaze-1:strokeStart+0.5` -> `gaze-1:strokestart`: one spelling for both dialects, no offset."""
    *_, behavior, sync = ["", *reference.split(":")]
    return f"{behavior}:{_plain(sync)}"


def offset(reference: str) -> Seconds:
    """The offset in seconds of a sync reference, 0 if it has none or a strange one."""
    sync = reference.rpartition(":")[2]
    plain = next((index for index, letter in enumerate(sync) if letter in "+-"), len(sync))
    try:
        return float(sync[plain:].replace(" ", "") or 0.0)
    except ValueError:
        return 0.0


def _plain(sync: str) -> str:
    for sign in "+-":
        sync = sync.partition(sign)[0]
    return sync.strip().replace("_", "").lower()


class Blocks:
    """What is known of the blocks that run or ran recently: realised points by `anchor`, and when they ended."""

    def __init__(self) -> None:
        self._points: OrderedDict[str, dict[str, Seconds]] = OrderedDict()
        self._ended: OrderedDict[str, Seconds] = OrderedDict()

    def realised(self, block: str, behavior: str, sync: str, at: Seconds) -> str:
        """Remember a point; its anchor."""
        name = f"{behavior}:{_plain(sync)}"
        self._points.setdefault(block, {})[name] = at
        if len(self._points) > BLOCKS_KEPT:
            self._points.popitem(last=False)
        return name

    def end(self, block: str, at: Seconds) -> None:
        self._ended[block] = at
        if len(self._ended) > BLOCKS_KEPT:
            self._ended.popitem(last=False)

    def ended(self, block: str) -> Seconds | None:
        return self._ended.get(block)

    def point(self, block: str, name: str) -> Seconds | None:
        return self._points.get(block, {}).get(name)


class LimitClock:
    """`limit` seconds from the latest of `start` and the anchors; not running while one of those is still to come."""

    def __init__(self, start: Seconds, limit: Seconds, anchors: Iterable[str] = ()) -> None:
        self.limit = limit
        self._from = start
        self._not_before = start
        self._waiting = {anchor(reference): offset(reference) for reference in anchors}

    @property
    def waiting(self) -> tuple[str, ...]:
        return tuple(self._waiting)

    @property
    def deadline(self) -> Seconds | None:
        return None if self._waiting else max(self._from + self.limit, self._not_before)

    def realised(self, name: str, at: Seconds) -> None:
        if name in self._waiting:
            self._from = max(self._from, at + self._waiting.pop(name))

    def stop_waiting(self, at: Seconds) -> None:
        """The block has ended: anchors that have not come never will."""
        if self._waiting:
            self._waiting.clear()
            self._not_before = max(self._not_before, at)

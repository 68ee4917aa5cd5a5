"""Blocks that ended a short while ago, by id, for blocks that still name them.

A manager that streams blocks cannot know whether the one that it names still runs when its message arrives. So what
has ended stays known for a while; the time and the number are bounded, so that nothing grows.
"""

from collections import OrderedDict
from collections.abc import Callable
from typing import Generic, TypeVar

from engage_hri.schemas.units import Seconds

LASTING: Seconds = 60.0
"""Seconds for which a block is known after its end: longer than a pause within a turn, or than a message is late."""
MOST = 20_000
"""Greatest size of all that is known of the past; a block counts as its elements. Ten of the largest blocks."""

Ended = TypeVar("Ended")


class Past(Generic[Ended]):
    """Blocks that have ended, by id: the latest of each, for `LASTING` seconds, and no more than `MOST` in all."""

    def __init__(self, now: Callable[[], Seconds]) -> None:
        self._now = now
        self._ended: OrderedDict[str, tuple[Seconds, int, Ended]] = OrderedDict()
        """When it ended, its size, and itself; in the order of the ends."""
        self._size = 0

    def add(self, id: str, thing: Ended, size: int = 1) -> list[Ended]:
        """Remember what ends now, in place of another of its id; returns what is forgotten for it."""
        self.take_out(id)
        self._ended[id] = (self._now(), size, thing)
        self._size += size
        gone = list[Ended]()
        while self._ended:
            oldest, (at, _, before) = next(iter(self._ended.items()))
            if at >= self._now() - LASTING and self._size <= MOST:
                break
            self.take_out(oldest)
            gone.append(before)
        return gone

    def take_out(self, id: str) -> Ended | None:
        """Forget what has this id, and return it."""
        if (found := self._ended.pop(id, None)) is None:
            return None
        self._size -= found[1]
        return found[2]

    def get(self, id: str) -> Ended | None:
        """The block of this id; None: nothing is known of it."""
        found = self._ended.get(id)
        return found[2] if found is not None and found[0] >= self._now() - LASTING else None

    def all(self) -> dict[str, Ended]:
        """All that is known, by id."""
        since = self._now() - LASTING
        return {id: thing for id, (at, _, thing) in self._ended.items() if at >= since}

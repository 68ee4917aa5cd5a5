"""Deadlines by name, the earliest first. Pure."""

import heapq
from collections.abc import Callable, Hashable, Iterator
from itertools import count
from math import inf
from typing import Any, Generic, TypeVar

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.sight import LATE, Sight

K = TypeVar("K", bound=Hashable)
SLACK = 64
"""Outdated entries that are always tolerated."""


class Deadlines(Generic[K]):
    """One deadline at most for each name. Setting, clearing and asking for the earliest take logarithmic time.

    order: sort key of names that have equal deadlines; without it the one that was set first comes first.
    look: when to call `due`, not after the earliest deadline; infinite if there is none. It may be too early, since
    `clear` does not change it.
    """

    def __init__(self, order: Callable[[K], Any] | None = None) -> None:
        self.look = inf
        self._at: dict[K, Seconds] = {}
        self._heap: list[tuple[Seconds, Any, int, K]] = []
        """Entries, outdated ones too: these go when they reach the top, or when they outnumber the others by far."""
        self._order = order
        self._count = count()

    def clear(self, name: K) -> None:
        """Remove the deadline of `name`, if it has one."""
        self._at.pop(name, None)

    def set(self, name: K, at: Seconds | None) -> None:
        """Give `name` this deadline instead of any other; None removes it."""
        if at is None:
            self.clear(name)
        elif self._at.get(name) != at:
            self._at[name] = at
            self.look = min(self.look, at)
            heapq.heappush(self._heap, (at, self._order and self._order(name), next(self._count), name))
            if len(self._heap) > SLACK + 4 * len(self._at):
                self._heap = [entry for entry in self._heap if self._at.get(entry[-1]) == entry[0]]
                heapq.heapify(self._heap)

    def __getitem__(self, name: K) -> Seconds | None:
        return self._at.get(name)

    def __iter__(self) -> Iterator[K]:
        return iter(self._at)

    @property
    def earliest(self) -> Seconds | None:
        """The earliest deadline; None if there is none."""
        heap = self._heap
        while heap and self._at.get(heap[0][-1]) != heap[0][0]:
            heapq.heappop(heap)
        return heap[0][0] if heap else None

    @property
    def first(self) -> K | None:
        """The name that has the earliest deadline; None if there is none."""
        return None if self.earliest is None else self._heap[0][-1]

    def due(self, now: Seconds) -> K | None:
        """Remove the earliest deadline that has come and return its name; None if none has come."""
        earliest = self.earliest
        if earliest is None or earliest > now:
            self.look = inf if earliest is None else earliest
            return None
        name = heapq.heappop(self._heap)[-1]
        del self._at[name]
        return name


class Silences(Deadlines[K]):
    """Deadlines of what others are to do.

    Time for which this process stood still does not count against them, and what came meanwhile is heard first: such
    a deadline is put off, once. is_own: deadlines that are no others'.
    """

    def __init__(
        self,
        sight: Sight,
        order: Callable[[K], Any] | None = None,
        is_own: Callable[[K], bool] = lambda name: False,
    ) -> None:
        super().__init__(order)
        self._sight = sight
        self._is_own = is_own
        self._slept: dict[K, Seconds] = {}
        """For each that can still be put off: for how long this process had stood still when it was set."""
        self._kept: dict[K, Seconds] = {}
        """For each that `keep` has set: what was asked for."""

    def clear(self, name: K) -> None:
        super().clear(name)
        self._slept.pop(name, None)
        self._kept.pop(name, None)

    def set(self, name: K, at: Seconds | None) -> None:
        if at is not None and at != self[name]:
            self._slept[name] = self._sight.slept
        super().set(name, at)

    def keep(self, name: K, at: Seconds | None, now: Seconds) -> None:
        """Set a deadline that is computed anew again and again: as long as it comes out the same, it stays put off.

        If it has passed when it first comes out so, it is due now: nobody has stood still meanwhile.
        """
        if at is None:
            self.clear(name)
        elif at != self._kept.get(name):
            self.set(name, max(at, now))
            self._kept[name] = at

    def standing(self, name: K, at: Seconds) -> Seconds:
        """The deadline that stands for `at`: later, if `keep` has it and it was put off."""
        kept = self[name] if self._kept.get(name) == at else None
        return at if kept is None else kept

    def due(self, now: Seconds) -> K | None:
        while (at := self.earliest) is not None and at <= now:
            self._sight.look(now, at)
            name = super().due(now)
            assert name is not None
            before = self._slept.pop(name, None)
            later = now
            if before is not None and not self._is_own(name):
                later = max(at + self._sight.slept - before, self._sight.woke_at + LATE)
            if later <= now:
                self._kept.pop(name, None)
                return name
            super().set(name, later)
        return super().due(now)

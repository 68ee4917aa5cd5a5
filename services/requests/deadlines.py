"""Instants by name, the earliest first. Pure."""

import heapq
from collections.abc import Callable, Hashable
from itertools import count
from math import inf
from typing import Any, Generic, TypeVar

from engage_hri.schemas.units import Seconds

K = TypeVar("K", bound=Hashable)
SLACK = 64
"""So many outdated entries are always tolerated."""


class Deadlines(Generic[K]):
    """At most one instant for each name. Setting, clearing and asking for the earliest take logarithmic time.

    order: of the names whose instants are equal; without it the one that was set first comes first.
    look: when to ask for what is due, not after the earliest instant; infinite if there is none. What was cleared
    may hold it back until then.
    """

    def __init__(self, order: Callable[[K], Any] | None = None) -> None:
        self.look = inf
        self._at: dict[K, Seconds] = {}
        self._heap: list[tuple[Seconds, Any, int, K]] = []
        """Outdated entries stay until they reach the top, or until they are many more than the others."""
        self._order = order
        self._count = count()

    def clear(self, name: K) -> None:
        """It has no instant any more."""
        self._at.pop(name, None)

    def set(self, name: K, at: Seconds | None) -> None:
        """Its instant from now on; None: it has none any more."""
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

    @property
    def earliest(self) -> Seconds | None:
        heap = self._heap
        while heap and self._at.get(heap[0][-1]) != heap[0][0]:
            heapq.heappop(heap)
        return heap[0][0] if heap else None

    @property
    def first(self) -> K | None:
        """The name of the earliest instant."""
        return None if self.earliest is None else self._heap[0][-1]

    def due(self, now: Seconds) -> K | None:
        """The name of the earliest instant that has come, which is cleared; None if there is none."""
        earliest = self.earliest
        if earliest is None or earliest > now:
            self.look = inf if earliest is None else earliest
            return None
        name = heapq.heappop(self._heap)[-1]
        del self._at[name]
        return name

"""Instants by name, the earliest first. Pure."""

import heapq
from collections.abc import Hashable
from math import inf
from typing import Generic, TypeVar

from engage_hri.schemas.units import Seconds

K = TypeVar("K", bound=Hashable)


class Deadlines(Generic[K]):
    """One instant for each name. Setting, clearing and asking for the earliest take logarithmic time.

    look: when to ask for what is due, not after the earliest instant; infinite if there is none. What was cleared
    may hold it back until then.
    """

    def __init__(self) -> None:
        self.look = inf
        self._at: dict[K, Seconds] = {}
        self._heap: list[tuple[Seconds, int, K]] = []
        self._count = 0

    def clear(self, name: K) -> None:
        """It has no instant any more."""
        self._at.pop(name, None)

    def set(self, name: K, at: Seconds) -> None:
        """Its instant from now on."""
        if self._at.get(name) != at:
            self._at[name] = at
            self.look = min(self.look, at)
            self._count += 1
            heapq.heappush(self._heap, (at, self._count, name))
            if len(self._heap) > 64 + 4 * len(self._at):  # mostly instants that do not hold any more
                self._heap = [entry for entry in self._heap if self._at.get(entry[2]) == entry[0]]
                heapq.heapify(self._heap)

    def __getitem__(self, name: K) -> Seconds | None:
        return self._at.get(name)

    @property
    def earliest(self) -> Seconds | None:
        while self._heap and self._at.get(self._heap[0][2]) != self._heap[0][0]:
            heapq.heappop(self._heap)
        return self._heap[0][0] if self._heap else None

    def due(self, now: Seconds) -> K | None:
        """The name of the earliest instant that has come, which is cleared; None if there is none."""
        earliest = self.earliest
        if earliest is None or earliest > now:
            self.look = inf if earliest is None else earliest
            return None
        _, _, name = heapq.heappop(self._heap)
        del self._at[name]
        return name

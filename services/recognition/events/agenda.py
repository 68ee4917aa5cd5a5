"""When something is due, by whom or what it concerns: the first is at hand, however many there are."""

import heapq
from typing import Generic, TypeVar

from engage_hri.schemas.units import Seconds

Key = TypeVar("Key", str, tuple[int, str])
SLACK = 32
"""So many outdated entries are always tolerated."""


class Agenda(Generic[Key]):
    """At most one time for each key. Equal times come in the order of their keys.

    A heap in which outdated entries stay until they reach the top, or until they are more than the valid ones.
    """

    def __init__(self) -> None:
        self._at: dict[Key, Seconds] = {}
        self._heap: list[tuple[Seconds, Key]] = []

    def set(self, key: Key, at: Seconds | None) -> None:
        """at: when it is due now; None: never."""
        if self._at.get(key) == at:
            return
        if at is None:
            del self._at[key]
        else:
            self._at[key] = at
            heapq.heappush(self._heap, (at, key))
        if len(self._heap) > 2 * len(self._at) + SLACK:
            self._heap = [(at, key) for key, at in self._at.items()]
            heapq.heapify(self._heap)

    @property
    def first(self) -> tuple[Seconds, Key] | None:
        """What is due first, and when."""
        heap = self._heap
        while heap and self._at.get(heap[0][1]) != heap[0][0]:
            heapq.heappop(heap)
        return heap[0] if heap else None

    @property
    def deadline(self) -> Seconds | None:
        first = self.first
        return None if first is None else first[0]

    def take_due(self, now: Seconds) -> list[Key]:
        """Whatever is due at `now`; it is due no longer."""
        taken: list[Key] = []
        while (first := self.first) is not None and first[0] <= now:
            taken.append(first[1])
            self.set(first[1], None)
        return taken

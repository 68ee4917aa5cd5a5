"""A line in which each sender has only so many places. Pure."""

from collections import deque
from typing import Generic, TypeVar

PLACES = 64
"""Places of one sender in the common line."""

T = TypeVar("T")


class Turns(Generic[T]):
    """Items of many senders, in the order in which they came, as long as each has few that wait.

    A sender with more than `PLACES` has the rest in a line of its own. When an item of it leaves the common line, its
    next one takes the last place there. So a flood delays the items of others by `PLACES` of its own at most, and the
    items of one sender never change their order.
    """

    def __init__(self) -> None:
        self._line: deque[tuple[str | None, T]] = deque()
        self._places: dict[str, int] = {}
        self._behind: dict[str, deque[T]] = {}
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, sender: str | None, item: T) -> None:
        """Add an item. sender None: it has a place in any case."""
        self._count += 1
        if sender is not None:
            places = self._places.get(sender, 0)
            if places >= PLACES:
                self._behind.setdefault(sender, deque()).append(item)
                return
            self._places[sender] = places + 1
        self._line.append((sender, item))

    def popleft(self) -> T:
        """Take the first item. Raises IndexError if there is none."""
        sender, item = self._line.popleft()
        self._count -= 1
        if sender is not None:
            if (behind := self._behind.get(sender)) is not None:
                self._line.append((sender, behind.popleft()))
                if not behind:
                    del self._behind[sender]
            elif self._places[sender] > 1:
                self._places[sender] -= 1
            else:
                del self._places[sender]
        return item

    def clear(self) -> None:
        for each in (self._line, self._places, self._behind):
            each.clear()
        self._count = 0

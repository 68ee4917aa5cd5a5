"""Things by name, in the order in which they came, as a value: a changed shelf shares with the old one what stays."""

from collections.abc import Hashable, Iterable, Iterator, Sequence
from typing import Generic, TypeVar

K = TypeVar("K", bound=Hashable)
V = TypeVar("V")

BOARD = 64
"""Things that are copied together."""


class Shelf(Generic[K, V]):
    """Things in a row, each with a name. `put` costs about the same however many there are."""

    __slots__ = ("_boards", "_count", "_places")

    def __init__(self, things: Iterable[tuple[K, V]] = ()) -> None:
        self._places: dict[K, int] = {}
        """Place of each name; shared with newer shelves, whose further names do not count here."""
        self._boards: tuple[tuple[V, ...], ...] = ()
        self._count = 0
        if named := dict(things):
            self._places = {name: place for place, name in enumerate(named)}
            values, self._count = tuple(named.values()), len(named)
            self._boards = tuple([values[since : since + BOARD] for since in range(0, len(values), BOARD)])

    def get(self, name: K) -> V | None:
        """The thing of that name; None if there is none."""
        place = self._places.get(name, self._count)
        return self._boards[place // BOARD][place % BOARD] if place < self._count else None

    def put(self, name: K, thing: V) -> "Shelf[K, V]":
        """The shelf with this thing in the place of the one of that name, or at the end."""
        made: Shelf[K, V] = Shelf()
        place = self._places.get(name, self._count)
        if place < self._count:
            made._places, made._count = self._places, self._count
            number, board = place // BOARD, self._boards[place // BOARD]
            changed = (*board[: place % BOARD], thing, *board[place % BOARD + 1 :])
            made._boards = (*self._boards[:number], changed, *self._boards[number + 1 :])
            return made
        is_newest = len(self._places) == self._count
        made._places = self._places if is_newest else dict(zip(self._places, range(self._count), strict=False))
        made._places[name] = self._count
        made._count = self._count + 1
        last = self._boards[-1] if self._count % BOARD else ()
        made._boards = (*(self._boards[:-1] if last else self._boards), (*last, thing))
        return made

    def put_all(self, things: Sequence[tuple[K, V]]) -> "Shelf[K, V]":
        """The shelf with all of these things put. Many at once are put in one go."""
        if len(things) > BOARD:
            return Shelf((*zip(self._places, self, strict=False), *things))
        shelf = self
        for name, thing in things:
            shelf = shelf.put(name, thing)
        return shelf

    def __iter__(self) -> Iterator[V]:
        return (thing for board in self._boards for thing in board)

    def __len__(self) -> int:
        return self._count

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Shelf) and self._boards == other._boards

    def __hash__(self) -> int:
        return hash(self._boards)

    def __repr__(self) -> str:
        return f"Shelf({', '.join(map(repr, self))})"

"""Chance as pure code sees it."""

from collections.abc import MutableSequence, Sequence
from typing import Any, Protocol, TypeVar

T = TypeVar("T")


class Chance(Protocol):
    """What is used of `random.Random`; the trial makes one from its seed."""

    def random(self) -> float: ...
    def uniform(self, a: float, b: float) -> float: ...
    def choice(self, seq: Sequence[T]) -> T: ...
    def randrange(self, start: int, stop: int) -> int: ...
    def shuffle(self, x: MutableSequence[Any]) -> None: ...


def happens(chance: Chance, probability: float) -> bool:
    return chance.random() < probability

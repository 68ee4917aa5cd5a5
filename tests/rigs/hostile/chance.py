"""Random numbers for pure code, which is given their source."""

from collections.abc import MutableSequence, Sequence
from typing import Any, Protocol, TypeVar

T = TypeVar("T")


class Chance(Protocol):
    """Methods of `random.Random` that pure code uses; the trial makes one from its seed."""

    def random(self) -> float: ...
    def uniform(self, a: float, b: float) -> float: ...
    def choice(self, seq: Sequence[T]) -> T: ...
    def randrange(self, start: int, stop: int) -> int: ...
    def shuffle(self, x: MutableSequence[Any]) -> None: ...


def happens(chance: Chance, probability: float) -> bool:
    return chance.random() < probability

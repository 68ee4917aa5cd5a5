"""Source of chance for pure code, and delays drawn from it, with the statistics of Table 2.1 of the thesis."""

from collections.abc import Sequence
from typing import Protocol, TypeVar

from msgspec import Struct

from engage_hri.schemas.units import Seconds

T = TypeVar("T")
CONCENTRATION = 3.0
"""Sum of the two parameters of each Beta distribution. The table has least, mean and most only; 3: broad tails."""


class Chance(Protocol):
    """The part of `random.Random` that is used here; the service makes one from the seed."""

    def random(self) -> float: ...
    def uniform(self, a: float, b: float) -> float: ...
    def gauss(self, mu: float, sigma: float) -> float: ...
    def betavariate(self, alpha: float, beta: float) -> float: ...
    def expovariate(self, lambd: float) -> float: ...
    def choice(self, seq: Sequence[T]) -> T: ...


class Delays(Struct, frozen=True):
    """A Beta distribution stretched from `least` to `most` with the given mean, in seconds."""

    least: Seconds
    mean: Seconds
    most: Seconds

    def __post_init__(self) -> None:
        if not (0 <= self.least < self.mean < self.most or 0 <= self.least == self.mean == self.most):
            raise ValueError(
                f"0 <= least < mean < most, or all equal, does not hold: {self.least}, {self.mean}, {self.most}"
            )

    def draw(self, chance: Chance) -> Seconds:
        width = self.most - self.least
        if width == 0:
            return self.mean
        part = (self.mean - self.least) / width
        return self.least + width * chance.betavariate(CONCENTRATION * part, CONCENTRATION * (1 - part))

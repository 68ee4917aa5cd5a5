"""Paired permutation test: how often chance alone would give a difference as large as that of a study.

Each session is compared with the one of the same seed in the other condition. If the conditions did the same, each
difference could as well have the other sign; the test counts how many choices of signs give a sum as far from zero.
Nothing is assumed about the distribution, and small samples get the large p they deserve. Pure; chance has a fixed
seed.
"""

import math
from collections.abc import Callable, Sequence
from itertools import combinations

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.units import Probability

EXACT = 14
"""Number of pairs up to which all choices of signs are counted."""
DRAWS = 20_000
"""Number of choices of signs that are drawn for more pairs."""
LEVEL = 0.05
"""Level of the test; the interval holds the differences that it does not reject."""
STEPS = 60
"""Halvings in the search for an end of the interval: to the last bit."""

Array = NDArray[np.float64]


class Paired(Struct, frozen=True, kw_only=True):
    """Result of the test for n pairs, with the mean of their differences. None: unknown.

    low, high: all true differences that the test does not reject at 5 %; None when n is too small to reject any.
    effect: mean / standard deviation of the differences (Cohen's d for pairs); None if they do not vary.
    p: two-sided.
    """

    n: int
    mean: float | None = None
    low: float | None = None
    high: float | None = None
    effect: float | None = None
    p: Probability | None = None


def paired(differences: Sequence[float]) -> Paired:
    """Test whether differences have another mean than zero."""
    d = np.asarray(differences, dtype=np.float64)
    n = len(d)
    if n == 0:
        return Paired(n=0)
    mean = float(d.mean())
    test = _SignFlips(d)
    spread = float(d.std(ddof=1)) if n > 1 else 0.0
    varies = spread > 1e-9 * float(np.abs(d).max())
    low, high = (test.end(-1), test.end(+1)) if test.can_reject else (None, None)
    return Paired(n=n, mean=mean, low=low, high=high, effect=mean / spread if varies else None, p=test.p(0.0))


class _SignFlips:
    """Sums of a sample under all choices of signs, or under many, and the sums of the signs alone."""

    def __init__(self, d: Array) -> None:
        n = len(d)
        if n <= EXACT:
            signs = 1.0 - 2.0 * ((np.arange(2**n)[:, None] >> np.arange(n)) & 1)
        else:
            drawn = np.random.default_rng(0).integers(0, 2, (DRAWS, n))
            # The sample itself is one of the choices, so that p is never zero.
            signs = np.vstack([np.ones((1, n)), 1.0 - 2.0 * drawn])
        self._sums = signs @ d
        self._ones = signs.sum(axis=1)
        self._sum, self._n = float(d.sum()), n
        self._d = d

    @property
    def can_reject(self) -> bool:
        """True if a sample of this size can be significant; two choices of signs are always as extreme."""
        return 2.0 / 2.0**self._n < LEVEL

    def p(self, shift: float) -> Probability:
        """Two-sided p of the hypothesis that the true difference is `shift`."""
        slack = 1e-9 * float(np.abs(self._d - shift).sum())  # sums that are equal but for rounding
        extreme = np.abs(self._sums - shift * self._ones) >= abs(self._sum - shift * self._n) - slack
        return float(extreme.mean())

    def end(self, side: int) -> float:
        """Lower (-1) or upper (+1) end of the differences that the test does not reject."""
        inside = self._sum / self._n
        # Beyond the most extreme difference all signs are the same: certainly rejected.
        outside = float(self._d.min() if side < 0 else self._d.max())
        outside += side * 1e-9 * max(1.0, abs(outside))
        if self.p(outside) >= LEVEL:
            return outside
        for _ in range(STEPS):
            middle = (inside + outside) / 2
            if self.p(middle) >= LEVEL:
                inside = middle
            else:
                outside = middle
        return inside


def separate(first: Sequence[float], second: Sequence[float]) -> Paired:
    """Test whether two samples of different people have the same mean; the difference is second - first.

    If the conditions did the same, each person could as well have been in the other. Counted are the divisions into
    groups of these sizes, all of them or `DRAWS`, whose means are as far apart. n: of all together. effect: of the
    deviation within groups (Cohen's d).
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    n = len(a) + len(b)
    if not len(a) or not len(b):
        return Paired(n=n)
    test = _Divisions(a, b)
    mean = float(b.mean() - a.mean())
    within = float(((a - a.mean()) ** 2).sum() + ((b - b.mean()) ** 2).sum())
    spread = (within / (n - 2)) ** 0.5 if n > 2 else 0.0
    varies = spread > 1e-9 * float(np.abs(np.concatenate([a, b])).max())
    low, high = (_end(test.p, mean, test.widest, side) for side in (-1, +1)) if test.can_reject else (None, None)
    return Paired(n=n, mean=mean, low=low, high=high, effect=mean / spread if varies else None, p=test.p(0.0))


class _Divisions:
    """Divisions of two samples into groups of their sizes: all, or many. They are rows of weights of a mean."""

    def __init__(self, a: Array, b: Array) -> None:
        self._a, self._b = a, b
        n, k = len(a) + len(b), len(b)
        self._number = math.comb(n, k)
        if self._number <= DRAWS:
            chosen = np.array(list(combinations(range(n), k)))
        else:
            drawn = np.random.default_rng(0).random((DRAWS, n)).argsort(axis=1)[:, :k]
            # The sample itself is one of the divisions, so that p is never zero.
            chosen = np.vstack([np.arange(n - k, n), drawn])
        self._weights = np.full((len(chosen), n), -1.0 / (n - k))
        np.put_along_axis(self._weights, chosen, 1.0 / k, axis=1)
        self.widest = float(np.ptp(np.concatenate([a, b]))) * 2 + 1.0
        """More than any difference of means that is not rejected."""

    @property
    def can_reject(self) -> bool:
        """True if samples of these sizes can be significant; of equal sizes two divisions are always as extreme."""
        extreme = 2 if len(self._a) == len(self._b) else 1
        return extreme / self._number < LEVEL

    def p(self, shift: float) -> Probability:
        """Two-sided p of the hypothesis that the true difference is `shift`."""
        values = np.concatenate([self._a, self._b - shift])
        slack = 1e-9 * float(np.abs(values).sum() + 1e-12)  # means that are equal but for rounding
        observed = abs(float(self._b.mean() - shift - self._a.mean()))
        return float((np.abs(self._weights @ values) >= observed - slack).mean())


def _end(p: Callable[[float], Probability], middle: float, widest: float, side: int) -> float:
    """Lower (-1) or upper (+1) end of the differences that a test does not reject."""
    inside, outside = middle, middle + side * widest
    if p(outside) >= LEVEL:
        return outside
    for _ in range(STEPS):
        between = (inside + outside) / 2
        if p(between) >= LEVEL:
            inside = between
        else:
            outside = between
    return inside


def holm(ps: Sequence[Probability | None]) -> list[Probability | None]:
    """Correct p for several questions at once (Holm 1979); None stays None and does not count."""
    asked = sorted((p, index) for index, p in enumerate(ps) if p is not None)
    corrected: list[Probability | None] = [None] * len(ps)
    largest = 0.0
    for rank, (p, index) in enumerate(asked):
        largest = max(largest, min(1.0, (len(asked) - rank) * p))
        corrected[index] = largest
    return corrected

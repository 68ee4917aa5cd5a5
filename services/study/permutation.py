"""Paired permutation test: how often chance alone would give a difference as large as that of a study.

Each session is compared with the one of the same seed in the other condition. If the conditions did the same, each
difference could as well have the other sign; the test counts how many choices of signs give a sum as far from zero.
Nothing is assumed about the distribution, and small samples get the large p they deserve. Pure; chance has a fixed
seed.
"""

import math
from collections.abc import Sequence
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
    if n <= EXACT:
        signs = 1.0 - 2.0 * ((np.arange(2**n)[:, None] >> np.arange(n)) & 1)
    else:
        drawn = np.random.default_rng(0).integers(0, 2, (DRAWS, n))
        # The sample itself is one of the choices, so that p is never zero.
        signs = np.vstack([np.ones((1, n)), 1.0 - 2.0 * drawn])
    spread = float(d.std(ddof=1)) if n > 1 else 0.0
    # Two choices of signs are always as extreme.
    return _tested(float(d.mean()), signs / n, d, np.ones(n), 2.0 / 2.0**n, n, spread)


def separate(first: Sequence[float], second: Sequence[float]) -> Paired:
    """Test whether two samples of different people have the same mean; the difference is second - first.

    If the conditions did the same, each person could as well have been in the other. Counted are the divisions into
    groups of these sizes, all of them or `DRAWS`, whose means are as far apart. n: of all together. effect: of the
    deviation within groups (Cohen's d).
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    n, k = len(a) + len(b), len(b)
    if not len(a) or not len(b):
        return Paired(n=n)
    divisions = math.comb(n, k)
    if divisions <= DRAWS:
        chosen = np.array(list(combinations(range(n), k)))
    else:
        drawn = np.random.default_rng(0).random((DRAWS, n)).argsort(axis=1)[:, :k]
        # The sample itself is one of the divisions, so that p is never zero.
        chosen = np.vstack([np.arange(n - k, n), drawn])
    weights = np.full((len(chosen), n), -1.0 / (n - k))
    np.put_along_axis(weights, chosen, 1.0 / k, axis=1)
    within = float(((a - a.mean()) ** 2).sum() + ((b - b.mean()) ** 2).sum())
    spread = (within / (n - 2)) ** 0.5 if n > 2 else 0.0
    # Of equal sizes two divisions are always as extreme.
    least = (2 if len(a) == len(b) else 1) / divisions
    both = np.concatenate([a, b])
    mean = float(b.mean() - a.mean())
    return _tested(mean, weights, both, np.repeat([0.0, 1.0], [len(a), k]), least, n, spread)


def _tested(
    mean: float, weights: Array, sample: Array, moved: Array, least: Probability, n: int, spread: float
) -> Paired:
    """Test a sample against all that it could as well have been.

    mean: that of the sample itself. weights: a row for each that it could have been, with which the sample gives its
    mean. moved: 1 where a true difference would be added. least: the smallest p. spread: standard deviation, for the
    effect.
    """
    widest = 2 * float(np.ptp(sample)) + 1.0  # a difference that far from the mean is certainly rejected

    def p(shift: float) -> Probability:
        """Two-sided p of the hypothesis that the true difference is `shift`."""
        values = sample - shift * moved
        slack = 1e-9 * float(np.abs(values).mean() + 1e-12)  # means that are equal but for rounding
        return float((np.abs(weights @ values) >= abs(mean - shift) - slack).mean())

    def end(side: int) -> float:
        """Lower (-1) or upper (+1) end of the differences that the test does not reject."""
        inside, outside = mean, mean + side * widest
        for _ in range(STEPS):
            middle = (inside + outside) / 2
            inside, outside = (middle, outside) if p(middle) >= LEVEL else (inside, middle)
        return inside

    low, high = (end(-1), end(+1)) if least < LEVEL else (None, None)
    varies = spread > 1e-9 * float(np.abs(sample).max())
    return Paired(n=n, mean=mean, low=low, high=high, effect=mean / spread if varies else None, p=p(0.0))


def holm(ps: Sequence[Probability | None]) -> list[Probability | None]:
    """Correct p for several questions at once (Holm 1979); None stays None and does not count."""
    asked = sorted((p, index) for index, p in enumerate(ps) if p is not None)
    corrected: list[Probability | None] = [None] * len(ps)
    largest = 0.0
    for rank, (p, index) in enumerate(asked):
        largest = max(largest, min(1.0, (len(asked) - rank) * p))
        corrected[index] = largest
    return corrected

"""Measured speed of the parts of a body, to correct its estimates with."""

from collections import deque
from collections.abc import Collection, Mapping
from statistics import median_low

from engage_hri.schemas.body import Estimate
from engage_hri.schemas.units import Seconds

SHORT: Seconds = 0.05
"""A phase shorter than this says nothing about speed."""
PLAUSIBLE = (0.5, 4.0)
"""Least and most ratio of measured to estimated time that says something about speed.

Less, and the part was nearer than believed; more, and it stood still.
"""
NOISE = 0.02
"""Difference of a ratio from 1 below which the estimate counts as right."""
REMEMBERED = 9
"""Number of the latest phases of a part that count, and of the latest words of a speech."""
FINE = 0.01
"""As `NOISE`, for a speech that tells its words: what it has shown itself is worth more than what its part has."""
ALIKE = 0.25
"""Difference from the median of words, as a share of it, from which on one says nothing: the voice stood."""


class Experience:
    """Measured speed of each part. A joint that was twice as slow will be twice as slow in the next phases, too.

    estimates: of the body, by behavior.
    """

    def __init__(self, estimates: Mapping[str, Estimate]) -> None:
        self._parts = {id: estimate.parts for id, estimate in estimates.items()}
        self._users: dict[str, list[str]] = {}
        for id, parts in self._parts.items():
            for part in parts:
                self._users.setdefault(part, []).append(id)
        self._ratios: dict[str, deque[float]] = {}
        self._factor: dict[str, float] = {}
        self._words: dict[str, deque[tuple[Seconds, Seconds]]] = {}
        """Of speeches that tell their words, the seconds that the latest of these took, and those expected."""
        self._paces: dict[str, float] = {}
        """The factor of each of these."""

    def factor(self, behavior: str) -> float:
        """Factor by which the behavior is expected to take longer than estimated."""
        if (pace := self._paces.get(behavior)) is not None:
            return pace
        return max((self._factor.get(part, 1.0) for part in self._parts.get(behavior, ())), default=1.0)

    def learn_words(self, behavior: str, expected: Seconds, took: Seconds) -> Collection[str]:
        """Note that words of a speech took so long, as `learn`; from then on it has a factor of its own.

        It is that of all its latest words together but for those that are no measure: an error in when one word ended
        is the next word's with the other sign, and cancels out.
        """
        known = self.factor(behavior)
        changed = dict.fromkeys(self.learn(behavior, expected, took))
        if expected < SHORT or not PLAUSIBLE[0] <= took / expected <= PLAUSIBLE[1]:
            return tuple(changed)
        words = self._words.setdefault(behavior, deque(maxlen=REMEMBERED))
        words.append((took, expected))
        median = median_low(each / natural for each, natural in words)
        alike = [each for each in words if abs(each[0] / each[1] - median) <= ALIKE * median]
        pace = sum(each for each, _ in alike) / sum(natural for _, natural in alike)
        pace = pace if abs(pace - 1.0) > FINE else 1.0
        self._paces[behavior] = pace if abs(pace - known) > FINE * known else known
        return tuple(changed if self._paces[behavior] == known else {**changed, behavior: None})

    def learn(self, behavior: str, expected: Seconds, took: Seconds) -> Collection[str]:
        """Note that a phase of `behavior` took so long; returns the behaviors that have another `factor` now."""
        if expected < SHORT or not PLAUSIBLE[0] <= took / expected <= PLAUSIBLE[1]:
            return ()
        changed: dict[str, None] = {}
        for part in self._parts.get(behavior, ()):
            ratios = self._ratios.setdefault(part, deque(maxlen=REMEMBERED))
            ratios.append(took / expected)
            known, factor = self._factor.get(part, 1.0), median_low(ratios)
            factor = factor if abs(factor - 1.0) > NOISE else 1.0
            if abs(factor - known) > NOISE * known:
                self._factor[part] = factor
                changed.update(dict.fromkeys(self._users[part]))
        return tuple(changed)

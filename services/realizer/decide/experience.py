"""How fast the parts of a body have been so far: what estimates are corrected with."""

from collections import deque
from collections.abc import Iterable, Mapping
from statistics import median_low

from engage_hri.schemas.body import Estimate
from engage_hri.schemas.units import Seconds

SHORT: Seconds = 0.05
"""A phase shorter than this says nothing about speed."""
PLAUSIBLE = (0.5, 4.0)
"""Times its estimate. Who needs less was nearer than believed, who needs more stood still: neither is a speed."""
NOISE = 0.05
"""Nearer to 1 than this, the estimate is right."""
REMEMBERED = 9
"""Phases of a part that count."""


class Experience:
    """estimates: by behavior. A joint that was twice as slow will be twice as slow in the next phases too."""

    def __init__(self, estimates: Mapping[str, Estimate]) -> None:
        self._parts = {id: estimate.parts for id, estimate in estimates.items()}
        self._users: dict[str, list[str]] = {}
        for id, parts in self._parts.items():
            for part in parts:
                self._users.setdefault(part, []).append(id)
        self._ratios: dict[str, deque[float]] = {}
        self._factor: dict[str, float] = {}

    def factor(self, behavior: str) -> float:
        """How many times longer than estimated it is expected to take."""
        return max((self._factor.get(part, 1.0) for part in self._parts.get(behavior, ())), default=1.0)

    def learn(self, behavior: str, expected: Seconds, took: Seconds) -> Iterable[str]:
        """A phase of `behavior` took so long; the behaviors of which more, or less, is expected now."""
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

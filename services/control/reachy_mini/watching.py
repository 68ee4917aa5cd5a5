"""Patience with joints that are not where they should be, as long as they make way. Pure."""

import math

from engage_hri.schemas.units import Radians, Seconds

WAY: Radians = math.radians(0.3)
"""What counts as way; noise of the encoders does not."""


class Watch:
    """Watches what is left of a way. patience: seconds without any way after which it has ended."""

    def __init__(self, patience: Seconds) -> None:
        self._patience = patience
        self._best = math.inf
        self._since: Seconds = 0.0

    def stuck(self, left: Radians, now: Seconds) -> Seconds | None:
        """Note what is left. Returns the seconds without any way, once these are too many."""
        if left < self._best - WAY:
            self._best, self._since = left, now
        return now - self._since if now - self._since > self._patience else None

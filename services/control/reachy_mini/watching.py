"""Patience with joints that are not where they should be, and with measurements that come too seldom. Pure."""

import math
from collections import deque
from itertools import pairwise

from engage_hri.schemas.units import Radians, Seconds

WAY: Radians = math.radians(0.3)
"""What counts as way; noise of the encoders does not."""
ENOUGH = 8
"""Measurements without way that it takes at least."""
COUNTED = 17
"""Measurements by which it is told how often they come."""
GAP_THAT_COUNTS: Seconds = 0.5
"""A longer one counts as this: it may be the only one."""


class Watch:
    """Watches what is left of a way. patience: seconds without any way after which it has ended.

    Only what is measured says so: time in which no measurements come is no evidence against the joints.
    """

    def __init__(self, patience: Seconds) -> None:
        self._patience = patience
        self._best = math.inf
        self._since: Seconds = 0.0
        self._last: Seconds = -math.inf
        self._seen = 0

    def stuck(self, left: Radians, measured: Seconds) -> Seconds | None:
        """Note what is left, as it was measured at that time. Returns the seconds without way, once too many."""
        if left < self._best - WAY:
            self._best, self._since, self._seen = left, measured, 0
        if measured > self._last:
            self._last, self._seen = measured, self._seen + 1
        waited = measured - self._since
        return waited if waited > self._patience and self._seen > ENOUGH else None


class Rate:
    """Watches how often measurements come. longest: mean seconds from one to the next with which one can move."""

    def __init__(self, longest: Seconds) -> None:
        self._longest = longest
        self._times: deque[Seconds] = deque(maxlen=COUNTED)
        self._is_slow = False

    def fallen(self, now: Seconds) -> float | None:
        """Note a measurement. Returns how many come in a second once these have become too few, and then no more.

        It does so again after there were half as many again as it takes. One long gap alone is no slow stream.
        """
        self._times.append(now)
        if len(self._times) < COUNTED:
            return None
        gaps = [min(b - a, GAP_THAT_COUNTS) for a, b in pairwise(self._times)]
        longest = self._longest / (1.5 if self._is_slow else 1.0)
        was_slow, self._is_slow = self._is_slow, sum(gaps) / len(gaps) > longest
        return len(gaps) / (now - self._times[0]) if self._is_slow and not was_slow else None

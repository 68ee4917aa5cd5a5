"""Patience with joints that are not where they should be, and with measurements that come too seldom. Pure."""

import math

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Radians, Seconds

WAY: Radians = math.radians(0.3)
"""What counts as way; noise of the encoders does not."""
ENOUGH = 8
"""Measurements without way that it takes at least."""
STANDS: Seconds = 0.25
"""Seconds without way after which a joint has come to stand, if it is short of patience."""
COUNTED = 16
"""Measurements whose mean tells how often they come."""
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
        self._note(left, measured)
        waited = measured - self._since
        return waited if waited > self._patience and self._seen > ENOUGH else None

    @property
    def stands(self) -> bool:
        """True if it has come to stand, by what was noted."""
        return self._last - self._since > STANDS and self._seen > ENOUGH

    def _note(self, left: Radians, measured: Seconds) -> None:
        if left < self._best - WAY:
            self._best, self._since, self._seen = left, measured, 0
        if measured > self._last:
            self._last, self._seen = measured, self._seen + 1


def slow(rate: float, longest: Seconds) -> Fault:
    """Say that measurements come too seldom. rate: in a second. longest: from one to the next with which it moves."""
    reason = f"the daemon sends {rate:.1f} measurements a second: the robot moves by fits and starts, and late"
    advice = f"it takes {1.0 / longest:.0f}; is the network slow, or the daemon's machine busy?"
    return Fault(reason=reason, where="reachy_mini", advice=advice, service="control")


class Rate:
    """Watches how often measurements come. longest: mean seconds from one to the next with which one can move."""

    def __init__(self, longest: Seconds) -> None:
        self._longest = longest
        self._mean: Seconds = 0.0
        self._last: Seconds | None = None
        self._is_slow = False

    @property
    def is_slow(self) -> bool:
        """True from when they have become too few until there are enough."""
        return self._is_slow

    def fallen(self, now: Seconds) -> float | None:
        """Note a measurement. Returns how many come in a second once these have become too few, and then no more.

        It does so again after there were half as many again as it takes. One long gap alone is no slow stream.
        """
        gap = now - self._last if self._last is not None else 0.0
        self._last = now
        self._mean += (min(gap, GAP_THAT_COUNTS) - self._mean) / COUNTED
        longest = self._longest / (1.5 if self._is_slow else 1.0)
        was_slow, self._is_slow = self._is_slow, self._mean > longest
        return 1.0 / self._mean if self._is_slow and not was_slow else None

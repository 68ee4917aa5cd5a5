"""Correction of a head that hangs lower than it was told, or aside: from what is measured while it stands. Pure.

The motors are springs: their controllers have no integral part, so the head rests where its weight and they agree.
"""

import math

from engage_hri.schemas.units import Radians

GAIN = 0.08
"""Share of an error that one measurement corrects: slow against the lag of the motors."""
SMOOTH = 0.3
"""Weight of one measurement in the error that is believed."""
LONGEST = math.radians(0.35)
"""The most that one measurement changes: 15 degrees a second."""


class Trim:
    """Angles that are added to yaw and pitch. most: the greatest correction. enough: half of this error stays."""

    def __init__(self, most: Radians, enough: Radians) -> None:
        self.angles: tuple[Radians, Radians] = (0.0, 0.0)
        self._most, self._enough = most, enough
        self._error = (0.0, 0.0)

    def clear(self) -> None:
        """Correct nothing, until errors are seen again."""
        self.angles = self._error = (0.0, 0.0)

    def rest(self) -> None:
        """Keep the correction while the head moves: errors say nothing then."""
        self._error = (0.0, 0.0)

    def see(self, error: tuple[Radians, Radians]) -> bool:
        """Take an error, planned less measured. True if the correction changes."""
        smoothed = [(1.0 - SMOOTH) * old + SMOOTH * new for old, new in zip(self._error, error, strict=True)]
        self._error = (smoothed[0], smoothed[1])
        before = self.angles
        changed = [self._corrected(angle, off) for angle, off in zip(self.angles, self._error, strict=True)]
        self.angles = (changed[0], changed[1])
        return self.angles != before

    def _corrected(self, angle: Radians, off: Radians) -> Radians:
        if abs(off) < self._enough / 2:
            return angle
        return max(-self._most, min(self._most, angle + max(-LONGEST, min(LONGEST, GAIN * off))))

"""Patience with joints that are not where they should be. Pure."""

import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np
from msgspec import Struct

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.motion.path import Path

PATIENCE: Seconds = 1.5
"""Seconds without any way after which joints do not come any more."""
WAY: Radians = math.radians(0.3)
"""What counts as way; noise of the encoders does not."""
ENOUGH = 8
"""Measurements without way that it takes at least."""
SAMPLES = 6
"""Places of a stretch that are looked at."""
STANDS: Seconds = 0.25
"""Seconds without way after which a joint has come to stand, if it is short of patience."""


class Off(Struct, frozen=True):
    """The joint that is farthest off, as a share of what is allowed. here, there: where it is and should be."""

    joint: str
    share: float
    here: Radians
    there: Radians


def farthest(rows: Iterable[tuple[str, Radians, Radians, Radians]]) -> Off:
    """The joint that is off by the greatest share of what is allowed. rows: joint, here, there, allowed."""
    return max((Off(joint, abs(b - a) / limit, a, b) for joint, a, b, limit in rows), key=lambda off: off.share)


def nearest(since: Seconds, until: Seconds, off_at: Callable[[Seconds], Off]) -> Off:
    """Measure how far joints are off the nearest place on a stretch of a path: they may have passed its beginning.

    off_at: measures how far they are off one place.
    """
    places = np.linspace(since, until, SAMPLES).tolist() if until - since > 1e-9 else [since]
    return min(map(off_at, places), key=lambda off: off.share)


def settling(path: Path, mark: Seconds, lag: Seconds, near: Sequence[Radians], every: Seconds) -> Seconds:
    """Time from when the plan is at a place of a path until the joints, which follow it, are measured near it.

    lag: seconds by which they follow. near: how far each may be off. every: seconds between two measurements.
    """
    if mark <= 0.0:
        return 0.0
    steps = 16
    for step in range(1, steps + 1):
        behind = path.position(mark - min(mark, lag * step / steps))
        if (abs(behind - path.position(mark)) > near).any():
            return lag * (1.0 - (step - 1) / steps) + every / 2
    return every / 2


class Watch:
    """Watches joints that are off. They make way as long as one comes nearer to where it should be.

    off: what it saw last. Only measurements count: time in which none come is no evidence against the joints.
    """

    def __init__(self, patience: Seconds = PATIENCE) -> None:
        """patience: seconds without any way after which they are stuck."""
        self.off: Off | None = None
        self._patience = patience
        self._best = math.inf
        self._since: Seconds = 0.0
        self._last: Seconds = -math.inf
        self._seen = 0

    def see(self, off: Off, measured: Seconds) -> None:
        """Note how far they are off, as it was measured at that time."""
        self.off = off
        if (left := abs(off.there - off.here)) < self._best - WAY:
            self._best, self._since, self._seen = left, measured, 0
        if measured > self._last:
            self._last, self._seen = measured, self._seen + 1

    @property
    def is_stuck(self) -> bool:
        """True if they have made no way for too long."""
        return self._last - self._since > self._patience and self._seen > ENOUGH

    @property
    def stands(self) -> bool:
        """True if they have come to stand."""
        return self._last - self._since > STANDS and self._seen > ENOUGH

    def fault(self, where: str, what_for: str = "", advice: str = "") -> Fault:
        """The fault of joints that are stuck. where: what they move for. what_for: the sync point, if one is due."""
        assert self.off is not None
        here, there = (math.degrees(angle) for angle in (self.off.here, self.off.there))
        due = f" for its {what_for}" if what_for else ""
        reason = (
            f"{self.off.joint} stands at {round(here, 1) + 0.0:.1f} degrees, {abs(there - here):.1f} from where it "
            f"should be{due}, and has made no way for {self._last - self._since:.1f} s"
        )
        return Fault(reason=reason, where=where, advice=advice, service="control")

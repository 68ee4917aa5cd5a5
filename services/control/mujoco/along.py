"""Joints and their plan: how far they are off, and for how long they have made no way. Pure."""

import math
from collections.abc import Mapping, Sequence

from msgspec import Struct

from engage_hri.schemas.units import Radians, Seconds

PATIENCE: Seconds = 1.5
"""Seconds without any way towards the plan after which joints do not come any more."""
WAY: Radians = math.radians(0.3)
"""Radians that count as way."""
NEAR: Mapping[str, Radians] = {
    "head": math.radians(0.6), "nod": math.radians(0.6), "torso": math.radians(0.8), "left_arm": math.radians(1.5),
    "right_arm": math.radians(1.5), "face": math.inf,
}  # fmt: skip
"""Radians by which a joint of a part may miss a sync point."""
LAG: Mapping[str, Radians] = {
    "head": math.radians(4.0), "nod": math.radians(4.0), "torso": math.radians(3.0), "left_arm": math.radians(6.0),
    "right_arm": math.radians(6.0), "face": math.inf,
}  # fmt: skip
"""Radians by which a joint of a part may lag behind its plan before the plan waits."""


class Off(Struct, frozen=True):
    """The joint that is farthest off, as a share of what is allowed. here, there: its angle, and the planned one."""

    joint: str
    share: float
    here: Radians
    there: Radians


def farthest(joints: Sequence[str], here: Sequence[float], there: Sequence[float], allowed: Sequence[float]) -> Off:
    """The joint that is off by the greatest share of what is allowed."""
    offs = [
        Off(joint, abs(b - a) / limit, a, b) for joint, a, b, limit in zip(joints, here, there, allowed, strict=True)
    ]
    return max(offs, key=lambda off: off.share)


class Watch:
    """Watches the joints of one run while they are off. They make way as long as one comes nearer to the plan, or
    moves on; the plan waits meanwhile."""

    def __init__(self) -> None:
        self._since: Seconds | None = None
        self._best = math.inf
        self.off: Off | None = None
        """What it saw last; None: they are where they should be."""

    def rest(self) -> None:
        """Note that the joints are where they should be."""
        self._since, self._best, self.off = None, math.inf, None

    def see(self, off: Off, now: Seconds) -> None:
        """Note how far they are off at an instant."""
        left = abs(off.there - off.here)
        if self._since is None or self.off is None or left < self._best - WAY:
            self._since, self._best = now, left
        self.off = off

    def stuck(self, now: Seconds) -> Seconds | None:
        """Seconds for which they have made no way, once that is too long; None: it is not."""
        waited = None if self._since is None else now - self._since
        return waited if waited is not None and waited > PATIENCE else None

"""The mouth of the torso as it speaks: shapes of the lips, in time, added to what an expression makes. Pure."""

from bisect import bisect_right
from collections.abc import Mapping, Sequence

from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import MouthShape
from engage_hri.services.control.contract.extras import smooth

CHANGE: Seconds = 0.09
"""Seconds in which the lips go from one shape to the next, half of them before the next begins, as people's do: as
quickly as the joints of the face may."""
OPEN, PARTED, SPREAD = 0.7, 0.8, 0.35
"""Shares of the way left that jaw and lips take when the mouth is wide open, and its corners when it is spread."""
Shape = tuple[float, float]


class Mouth:
    """The shapes that the lips go through. With new ones it leaves those before where it is."""

    def __init__(self) -> None:
        self._shapes: tuple[MouthShape, ...] = ()
        self._times: list[Seconds] = []
        self._left: Shape = (0.0, 0.0)
        self._since: Seconds = 0.0

    def move(self, shapes: Sequence[MouthShape], now: Seconds) -> None:
        """Go through these shapes from now on, and through no others. Empty: close."""
        self._left, self._since = self.at(now), now
        # What has begun already begins now; what comes later is led up to.
        self._shapes = tuple(MouthShape(max(each.at, now + CHANGE / 2), each.opening, each.width) for each in shapes)
        self._times = [each.at for each in self._shapes]

    def at(self, t: Seconds) -> Shape:
        """Opening and width at t."""
        gone = 1.0 - smooth((t - self._since) / CHANGE)
        opening, width = gone * self._left[0], gone * self._left[1]
        # Changes that overlap add up; those before `first` are over.
        first = max(0, bisect_right(self._times, t - CHANGE / 2) - 1)
        before = (0.0, 0.0)
        for number in range(first, len(self._shapes)):
            each = self._shapes[number]
            come = smooth((t - each.at) / CHANGE + 0.5)
            if come <= 0.0:
                break
            opening += come * (each.opening - before[0])
            width += come * (each.width - before[1])
            before = (each.opening, each.width)
        return opening, width

    def is_moving(self, t: Seconds) -> bool:
        """True while the lips move, or are about to."""
        return t < self._since + CHANGE or bool(self._times and t < self._times[-1] + CHANGE / 2)

    def added(self, t: Seconds, face: Mapping[str, float]) -> dict[str, float]:
        """Tell what is added to the joints of the mouth. face: its joints as an expression has them: its rest."""
        opening, width = self.at(t)
        if not (opening or width):
            return {}
        by = {"jaw": OPEN * opening * (1.0 - face["jaw"]), "lips": PARTED * opening * (1.0 - face["lips"])}
        for corner in ("left_mouth_corner", "right_mouth_corner"):
            by[corner] = SPREAD * width * (1.0 - abs(face[corner]))
        return by

"""Model of how the head of one person points beside what they look at, learned from looks that are sure. Pure.

    looks = SureLooks()
    looks.take(head, aim, spread, at)            # while it is known from elsewhere what is looked at
    direction, deviation = looks.aim(head, spread)

Cameras are off, trackers read the faces of some too high, and heads go a part of the way that the eyes go. Seen from
the line to the robot's face, what is looked at is beside the head by an offset, which is the person's, and a share of
its own angle: by how much the head stays behind. Both are fitted to the looks, to the side and up apart, as far as
they go beyond what chance may do (linear regression with a prior; decision 0240).

What is stated of a head is how much all errors of all people scatter. Half of it, we take, is the same in all looks
of one person. The more looks are known, the less of that is left, and the better is the other half known, too.
"""

from collections.abc import Iterable, Sequence
from math import dist, hypot, sqrt
from typing import NamedTuple

from engage_hri.schemas.recognition import HeadHabit, SureLook
from engage_hri.schemas.units import Degrees, Seconds

Angles = tuple[Degrees, Degrees]
"""To the left and up from the line between the eyes and the robot's face."""
ARRIVED: Seconds = 0.3
"""Time after which a head has come to what it is known to look at."""
PAUSE: Seconds = 0.5
"""Time without news after which the next look is another one."""
SAME_PLACE: Degrees = 3.0
"""Angle by which what is looked at may move within a look."""
KEPT = 24
"""Looks that are remembered of a person, the latest."""
SHARED = 0.5
"""Share of the stated variance that is the same in all looks of a person."""
BEHIND, BEHIND_SPREAD = 0.2, 0.15
"""Share of a look's angle by which heads stay behind, over all people, and its deviation: eyes go the rest."""
STATED = 6
"""Looks for which a stated variance counts beside what the looks themselves show."""
WRONG = 3.0
"""Deviations from which on a look is taken to have been at something else, unless the last such look agrees with it.

Heads of people who attend to a robot point 20 to 23 degrees beside its camera, and by 2 degrees differently from look
to look (recordings of ROS4HRI's hri_engagement). What is stated knows of no such offset.
"""
LEAST: Degrees = 0.5
"""Least deviation that is believed of a head."""


class _Line(NamedTuple):
    """Offset, and share of the angle, by which what is looked at is beside the head; variances of both and together.

    scatter: variance of single looks.
    """

    offset: float
    share: float
    of_offset: float
    of_share: float
    of_both: float
    scatter: float

    def aim(self, head: Degrees) -> Degrees:
        """Angle of what is looked at."""
        return (head + self.offset) / (1 - self.share)

    def deviation(self, aim: Degrees) -> Degrees:
        variance = self.scatter + self.of_offset + 2 * aim * self.of_both + aim * aim * self.of_share
        return sqrt(variance) / (1 - self.share)


class SureLooks:
    """Looks of one person that are sure."""

    def __init__(self) -> None:
        self.looks: list[SureLook] = []
        self._going: SureLook | None = None
        """The look that goes on, once its head has arrived: means so far."""
        self._since: Seconds | None = None
        self._at: Seconds = 0.0
        self._number = 0
        self._lines: dict[tuple[float, float], tuple[_Line, _Line]] = {}
        self._odd: SureLook | None = None
        """The last look that did not count."""

    def take(self, head: Angles, aim: Angles, spread: Angles, at: Seconds) -> None:
        """Take where a head points while it is known what is looked at. spread: deviation of the head, as stated."""
        if self._since is None:
            self._since = at
        self._at = at
        if at - self._since < ARRIVED:
            return
        before, self._number = self._going, self._number + 1
        if before is None:
            self._going = SureLook(head=head, aim=aim, spread=spread)
            return
        share = 1 / self._number
        self._going = SureLook(
            head=_between(before.head, head, share), aim=_between(before.aim, aim, share), spread=spread
        )

    def is_another(self, aim: Angles, at: Seconds) -> bool:
        """Tell whether it would be another look than the one that goes on."""
        if self._since is None:
            return False
        return at - self._at > PAUSE or (self._going is not None and dist(self._going.aim, aim) > SAME_PLACE)

    def remember(self, looks: Iterable[SureLook]) -> None:
        """Take looks of former times, or of another id of this person."""
        self.looks = [*looks, *self.looks][-KEPT:]
        self._lines.clear()

    def rest(self) -> bool:
        """End the look that goes on. True if it counts: it is no outlier, or the last outlier agrees with it."""
        look, self._going, self._number, self._since = self._going, None, 0, None
        if look is None:
            return False
        told, deviation = self.aim(look.head, look.spread)
        odd, self._odd, counting = self._odd, None, [look]
        if hypot(*((a - b) / d for a, b, d in zip(told, look.aim, deviation, strict=True))) > WRONG:
            if odd is None or not _agree(odd, look):
                self._odd = look
                return False
            counting = [odd, look]
        self.looks = [*self.looks, *counting][-KEPT:]
        self._lines.clear()
        return True

    def aim(self, head: Angles, spread: Angles) -> tuple[Angles, Angles]:
        """Tell where somebody looks, by where the head points; and its deviation. spread: stated, of the head."""
        lines = self._fitted(spread)
        aim = lines[0].aim(head[0]), lines[1].aim(head[1])
        return aim, (lines[0].deviation(aim[0]), lines[1].deviation(aim[1]))

    @property
    def at_robot(self) -> Angles | None:
        """Offset of the robot's face from a head that is turned to it; None: no look is known."""
        if not self.looks:
            return None
        left, up = self._fitted(self.looks[-1].spread)
        return left.offset, up.offset

    def habit(self) -> HeadHabit | None:
        """Tell what is known; None: nothing."""
        if not self.looks:
            return None
        left, up = self._fitted(self.looks[-1].spread)
        return HeadHabit(
            offset=(round(left.offset, 2), round(up.offset, 2)), behind=(round(left.share, 3), round(up.share, 3)),
            deviation=(round(left.deviation(0.0), 2), round(up.deviation(0.0), 2)), looks=tuple(self.looks),
        )  # fmt: skip

    def _fitted(self, spread: Angles) -> tuple[_Line, _Line]:
        key = (round(spread[0], 1), round(spread[1], 1))
        if key not in self._lines:
            if len(self._lines) > KEPT:
                self._lines.clear()
            self._lines[key] = _fit(self.looks, 0, spread[0]), _fit(self.looks, 1, spread[1])
        return self._lines[key]


def _agree(one: SureLook, other: SureLook) -> bool:
    """Tell whether heads are beside what is looked at by the same, within what is stated of them."""
    beside = (tuple(a - h - BEHIND * a for a, h in zip(look.aim, look.head, strict=True)) for look in (one, other))
    return hypot(*((a - b) / d for a, b, d in zip(*beside, other.spread, strict=True))) < 1


def _fit(looks: Sequence[SureLook], axis: int, stated: Degrees) -> _Line:
    """Fit the line of one axis. The scatter of single looks is what was stated, mended by what is left over."""
    pairs = [(look.aim[axis], look.aim[axis] - look.head[axis]) for look in looks]
    own = (1 - SHARED) * stated**2
    scatter, line = max(own, LEAST**2), _Line(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    for _ in range(3):
        line = _solved(pairs, scatter, SHARED * stated**2)
        left = sum((beside - line.offset - line.share * aim) ** 2 for aim, beside in pairs)
        scatter = max((STATED * own + left) / (STATED + len(pairs)), LEAST**2)
    return line._replace(scatter=scatter)


def _solved(pairs: Sequence[tuple[float, float]], scatter: float, shared: float) -> _Line:
    """Offset and share by least squares, with what is expected before any look."""
    known = 1 / BEHIND_SPREAD**2
    a = 1 / max(shared, LEAST**2) + len(pairs) / scatter
    b = sum(aim for aim, _ in pairs) / scatter
    c = known + sum(aim * aim for aim, _ in pairs) / scatter
    u = sum(beside for _, beside in pairs) / scatter
    v = known * BEHIND + sum(aim * beside for aim, beside in pairs) / scatter
    whole = a * c - b * b
    share = max(-0.5, min(0.5, (a * v - b * u) / whole))
    return _Line((c * u - b * v) / whole, share, c / whole, a / whole, -b / whole, scatter)


def _between(one: Angles, other: Angles, share: float) -> Angles:
    return one[0] + share * (other[0] - one[0]), one[1] + share * (other[1] - one[1])

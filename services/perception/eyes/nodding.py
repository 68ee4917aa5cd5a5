"""Nods and shakes of a head, from the angles of one picture after the other. Pure.

A nod is a swing to and fro that goes on: at least three in a row, each quick and wide enough, with a rest nowhere
between. A look down at the table and up again has a rest, and is none; a single dip of the head is not told apart
from one, and so it is none either.
"""

from collections import deque
from typing import Literal, NamedTuple

from engage_hri.schemas.units import Radians, Seconds

Gesture = Literal["nod", "shake"]
WIDE: Radians = 0.09
"""Swing below which it is the shaking of a measurement, or breath."""
QUICK: Seconds = 0.5
"""Longest time of one swing: from 1 Hz on."""
REST: Seconds = 0.25
"""Longest time at a turning point."""
SWINGS = 3
OVER: Seconds = 0.7
"""Time without another swing after which the gesture is over."""
KEPT = 90
"""Angles that are remembered: three seconds of a fast camera."""
PURE = 1.5
"""How much wider the swings of a nod are than what the head turns aside meanwhile, and those of a shake than what it
goes up and down."""


class GestureChange(NamedTuple):
    """A beginning or an end. at: when it was."""

    gesture: Gesture
    began: bool
    at: Seconds


class Swing(NamedTuple):
    """A movement between two turning points. since: when it left the one; until: when it reached the other."""

    since: Seconds
    until: Seconds
    wide: Radians


class SwingingAngle:
    """Swings of one angle, as they are over. row: the quick ones that follow one another without a rest."""

    def __init__(self) -> None:
        self.row: list[Swing] = []
        self._recent = deque[tuple[Seconds, Radians]](maxlen=KEPT)
        self._path: list[tuple[Seconds, Radians]] = []
        """The angle since the last turning point."""
        self._sign = 0
        """1: it rises since then, -1: it falls, 0: there was none yet."""

    def feed(self, angle: Radians, at: Seconds) -> None:
        """Take the angle at an instant later than the last."""
        self._path.append((at, angle))
        self._recent.append((at, angle))
        for sign in (self._sign,) if self._sign else (1, -1):
            peak = max(self._path, key=lambda one: one[1] * sign)
            if (peak[1] - angle) * sign > WIDE:
                self._turn(peak[1])
                self._sign = -sign
                break
        if not self._sign:  # nothing has begun: only a swing's length of it is of use
            self._path = [one for one in self._path if at - one[0] <= QUICK]
        if self.row and at - self.row[-1].until > OVER:
            self.row = []

    @property
    def width(self) -> Radians:
        """Average width of the last swings in a row."""
        last = [swing.wide for swing in self.row[-SWINGS:]]
        return sum(last) / len(last)

    def extent(self, since: Seconds) -> Radians:
        """Range of the angle since then, as far as it is remembered."""
        angles = [angle for at, angle in self._recent if at >= since]
        return max(angles) - min(angles)

    def _turn(self, peak: Radians) -> None:
        """Take note of a turning point: where the angle was nearly `peak`, first and last."""
        near = [at for at, angle in self._path if abs(angle - peak) < WIDE / 4]
        begin, first = self._path[0]
        swing = Swing(begin, near[0], abs(peak - first))
        rests = bool(self.row) and swing.since - self.row[-1].until > REST
        if rests or swing.until - swing.since > QUICK:
            self.row = []
        if self._sign and swing.until - swing.since <= QUICK:
            self.row.append(swing)
        self._path = [(at, angle) for at, angle in self._path if at >= near[-1]]


class Nodding:
    """Gestures of one head."""

    def __init__(self) -> None:
        self._pitch, self._yaw = SwingingAngle(), SwingingAngle()
        self._gesture: Gesture | None = None
        self._last: Seconds = 0.0
        """End of the last swing of the gesture that goes on."""

    def feed(self, yaw: Radians, pitch: Radians, at: Seconds) -> list[GestureChange]:
        """Take the angles at an instant later than the last. Returns what has begun or ended, some time back."""
        self._pitch.feed(pitch, at)
        self._yaw.feed(yaw, at)
        changes: list[GestureChange] = []
        gestures: tuple[tuple[Gesture, SwingingAngle, SwingingAngle], ...] = (
            ("nod", self._pitch, self._yaw), ("shake", self._yaw, self._pitch),
        )  # fmt: skip
        for gesture, swinging, other in gestures:
            if len(swinging.row) < SWINGS or swinging.width < PURE * other.extent(swinging.row[-SWINGS].since):
                continue
            if self._gesture is None:
                self._gesture = gesture
                changes.append(GestureChange(gesture, True, swinging.row[0].since))
            if self._gesture == gesture:
                self._last = swinging.row[-1].until
        if self._gesture is not None and at - self._last > OVER:
            changes += self.lose()
        return changes

    def lose(self) -> list[GestureChange]:
        """End what goes on: the head is not seen any more."""
        changes = [] if self._gesture is None else [GestureChange(self._gesture, False, self._last)]
        self._gesture, self._pitch, self._yaw = None, SwingingAngle(), SwingingAngle()
        return changes

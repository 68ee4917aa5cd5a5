"""Idle motion of a figure: it blinks, breathes, its face stirs, and its lips go with its voice. Pure.

All of it is added to the posture that behaviors give it, and enters no estimate, no pose after a behavior, and
nothing that a behavior does or waits in: breath gives way to any motion and any hold of the body, the face to any
behavior of the face. Times are those of the event loop; chance comes from a seed, so that the same seconds look the
same.
"""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Mapping, Sequence
from math import inf, radians, sin, tau

from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.contract.body import MouthShape
from engage_hri.services.control.contract.variability import chance, normal

GIVES_WAY: Seconds = 0.2
COMES_BACK: Seconds = 1.5
"""Seconds in which idle motion stops for a behavior, and in which it comes back."""
BETWEEN_BLINKS: Seconds = 60.0 / 17.0
"""Mean of the time between two blinks: at rest people blink 17 times a minute (Bentivoglio et al., Movement Disorders
12, 1997; rates are log-normal there, and so are the times between blinks here)."""
SPREAD = 0.6
"""Standard deviation of the logarithm of that time."""
CLOSING: Seconds = 0.1
CLOSED: Seconds = 0.03
OPENING: Seconds = 0.22
"""A lid closes more quickly than it opens (Trutoiu et al., ACM Transactions on Applied Perception 8, 2011)."""
BREATH: Seconds = 4.0
"""15 a minute, as of an adult at rest."""
BREATH_LEAN: Radians = radians(0.25)
"""Amplitude of the torso's lean. The neck turns as much against it, so that the eyes stay where they are."""
STIRRING: Mapping[str, tuple[float, Seconds, Seconds]] = {
    "left_brow": (0.04, 7.3, 4.1), "right_brow": (0.04, 7.3, 4.1), "left_mouth_corner": (0.03, 9.1, 5.3),
    "right_mouth_corner": (0.03, 9.1, 5.3), "lips": (0.015, 6.1, 3.7),
}  # fmt: skip
"""Amplitude and the two periods of the motion of each joint of the face, as shares of its way."""
SOON: Seconds = 0.05
"""Targets that come further apart than this are no stream: nobody knows how joints go between them."""


class Gate:
    """Share of the idle motion that is let through: it goes to 0 when something begins, and comes back after it."""

    def __init__(self, *, is_open: bool = True) -> None:
        self._since: Seconds = -inf
        self._from = float(is_open)
        self._is_open = is_open

    def share(self, t: Seconds, *, is_open: bool) -> float:
        """The share at t, of a gate that is open or closed from now on."""
        if is_open != self._is_open:
            self._from, self._since, self._is_open = self._at(t), t, is_open
        return self._at(t)

    def _at(self, t: Seconds) -> float:
        seconds = COMES_BACK if self._is_open else GIVES_WAY
        return self._from + (float(self._is_open) - self._from) * smooth((t - self._since) / seconds)


def smooth(done: float) -> float:
    """Way of a movement of least jerk, 0 to 1, when this share of its time is over."""
    x = min(max(done, 0.0), 1.0)
    return x * x * x * (10.0 + x * (6.0 * x - 15.0))


class Overlay:
    """Motion that is added to the targets of joints, and taken off again from what is measured of them.

    So no estimate, no sync point, no pose and no correction knows of it. shown: what of it was in the last reading,
    by joint.
    """

    def __init__(self, lag: Seconds) -> None:
        """lag: seconds by which what is measured follows what was sent."""
        self._lag = lag
        self._sent: deque[tuple[Seconds, Mapping[str, Radians]]] = deque([(-inf, {})])
        self._read: Mapping[str, Radians] = {}
        self.shown: dict[str, Radians] = {}

    def add(self, now: Seconds, by: Mapping[str, Radians]) -> None:
        """Take note of what is added to the targets from now on."""
        self._sent.append((now, by))

    def off(self, pose: Mapping[str, Radians], now: Seconds) -> dict[str, Radians]:
        """Take it off what is measured now. A reading that comes again is old, and as it was."""
        if pose != self._read:
            self._read, self.shown = pose, self._measured(now - self._lag)
        return {joint: angle - self.shown.get(joint, 0.0) for joint, angle in pose.items()}

    def _measured(self, at: Seconds) -> dict[str, Radians]:
        """Tell what of it joints show by then: they go evenly from one target to the next, if that comes soon."""
        while len(self._sent) > 1 and self._sent[1][0] <= at:
            self._sent.popleft()
        (since, before), (until, after) = self._sent[0], self._sent[min(1, len(self._sent) - 1)]
        share = (at - since) / (until - since) if since < at < until < since + SOON else 0.0
        return {
            joint: (1.0 - share) * before.get(joint, 0.0) + share * after.get(joint, 0.0)
            for joint in (*before, *(after if share else ()))
        }


class Blinks:
    """The blinks of one body, without end. Kept are the one before the instant last asked for, and the next."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._number = 0
        self._last: Seconds = -inf
        self._next = self._pause(0)

    def around(self, t: Seconds) -> tuple[Seconds, Seconds]:
        """Tell when the last blink until t began (-inf: none), and when the first after it does."""
        if t < self._last:
            self._number, self._last, self._next = 0, -inf, self._pause(0)
        while self._next <= t:
            self._number += 1
            self._last, self._next = self._next, self._next + self._pause(self._number)
        return self._last, self._next

    def _pause(self, number: int) -> Seconds:
        drawn = BETWEEN_BLINKS * math.exp(SPREAD * normal(self._seed, "blink", str(number)) - SPREAD * SPREAD / 2)
        return max(drawn, CLOSING + CLOSED + OPENING)


class Alive:
    """Idle motion of one body. born: loop time at which it began."""

    def __init__(self, seed: int, born: Seconds) -> None:
        self._born = born
        self._blinks = Blinks(seed)
        self._face, self._body = Gate(), Gate()
        self._phases = {
            name: tau * chance(seed, "phase", name) for name in ("brow", "mouth_corner", "lips", "breath")
        }

    def added(self, t: Seconds, face: Mapping[str, float], *, face_rests: bool, body_rests: bool) -> dict[str, float]:
        """Tell what is added to each joint at t. face: its joints as they are without that."""
        since, by = t - self._born, dict[str, float]()
        of_face, of_body = self._face.share(t, is_open=face_rests), self._body.share(t, is_open=body_rests)
        if of_face:
            closed = of_face * closure(since - self._blinks.around(since)[0])
            for lid in ("left_lid", "right_lid"):
                by[lid] = (1.0 - face[lid]) * closed
            for joint, (amplitude, one, other) in STIRRING.items():
                phase = self._phases[joint.removeprefix("left_").removeprefix("right_")]
                stirred = (sin(tau * since / one + phase) + sin(tau * since / other + 2 * phase)) / 2
                by[joint] = of_face * amplitude * (abs(stirred) if joint == "lips" else stirred)
        if of_body:
            angle = tau * since / BREATH + self._phases["breath"]
            # In is quicker than out.
            lean = of_body * BREATH_LEAN * sin(angle + 0.4 * sin(angle))
            by |= {"torso_lean": lean, "neck_pitch": lean}
        return {joint: angle for joint, angle in by.items() if angle}

    def quick_at(self, t: Seconds) -> Seconds:
        """Tell when it next moves quickly, as in a blink; t: it does."""
        last, following = self._blinks.around(t - self._born)
        return t if t - self._born < last + CLOSING + CLOSED + OPENING else self._born + following


def closure(since: Seconds) -> float:
    """Share by which the lids are closed so long after a blink began."""
    if since < CLOSING:
        return smooth(since / CLOSING)
    return 1.0 - smooth((since - CLOSING - CLOSED) / OPENING)


CHANGE: Seconds = 0.09
"""Seconds in which the lips go from one shape to the next, half of them before the next begins, as people's do: as
quickly as the joints of the face may."""
OPEN, PARTED, WIDENED = 0.7, 0.8, 0.35
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
            by[corner] = WIDENED * width * (1.0 - abs(face[corner]))
        return by

"""Idle motion of the torso: it blinks, breathes, and its face is never quite still. Pure.

All of it is added to the posture that behaviors give it, and enters no estimate, no pose after a behavior, and
nothing that a behavior does or waits in: breath gives way to any motion and any hold of the body, the face to any
behavior of the face. Times are those of the event loop; chance comes from a seed, so that the same seconds look the
same.
"""

import math
from collections.abc import Mapping
from math import inf, radians, sin, tau

from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.contract.extras import Gate, smooth
from engage_hri.services.control.contract.variability import chance, normal

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

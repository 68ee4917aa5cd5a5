"""Idle motion of Reachy Mini: a breath of its body, and antennas that are never quite still. Pure.

It is added to what the plan has the daemon told, and taken off again from what the daemon measures (`Overlay`). The
breath gives way to anything that head or body do or wait in, the antennas to any behavior of the face. Its own time
goes on with the measurements: after a gap nothing jumps.
"""

from math import radians, sin, tau

from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.figure.alive import BREATH, SOON, Gate, Overlay
from engage_hri.services.control.reachy_mini import joints
from engage_hri.services.control.reachy_mini.joints import Angles

LEAN: Radians = radians(0.5)
"""Amplitude of the breath: 1.5 mm of the head, which looks on where it looks."""
SWAY: Radians = radians(2.5)
"""Greatest angle of an antenna."""
PERIODS: dict[str, tuple[Seconds, Seconds]] = {"right_antenna": (7.3, 4.1), "left_antenna": (8.7, 4.7)}
_RANGES = {limit.joint: limit for limit in joints.LIMITS}


class Idling:
    """Idle motion of one robot. lag: seconds by which what is measured follows what was sent."""

    def __init__(self, lag: Seconds, *, is_alive: bool) -> None:
        """is_alive: False: it never moves."""
        self._is_alive, self._lag = is_alive, lag
        self._time: Seconds = 0.0
        self._seen: Seconds | None = None
        self.stop()

    def stop(self) -> None:
        """Begin anew: nobody knows where the joints are."""
        self._face, self._body = Gate(is_open=False), Gate(is_open=False)
        self.overlay = Overlay(self._lag)

    def added(self, now: Seconds, planned: Angles, busy: set[str]) -> dict[str, Radians]:
        """Tell what to add to the joints now, and take it as sent.

        planned: angles that they are sent to without it. busy: tracks that move, or that a behavior has.
        """
        if not self._is_alive:
            return {}
        # However late a measurement comes, breath is a motion of 0.04 degrees then.
        self._time += min(SOON, now - self._seen) if self._seen is not None else 0.0
        self._seen = now
        of_face = self._face.share(self._time, is_open="face" not in busy)
        of_body = self._body.share(self._time, is_open=not busy - {"face"})
        angle = tau * self._time / BREATH
        found = {"body_lean": of_body * LEAN * sin(angle + 0.4 * sin(angle))}  # in is quicker than out
        for joint, (one, other) in PERIODS.items():
            found[joint] = of_face * SWAY * (sin(tau * self._time / one) + sin(tau * self._time / other)) / 2
        kept = {joint: _within(joint, planned[joint], by) for joint, by in found.items()}
        kept = {joint: by for joint, by in kept.items() if by}
        self.overlay.add(now, kept)
        return kept


def _within(joint: str, planned: Radians, by: Radians) -> Radians:
    """Cut what is added to what the range of a joint leaves; nothing is left for one that is out of it."""
    low, high = _RANGES[joint].low, _RANGES[joint].high
    return max(min(0.0, low - planned), min(max(0.0, high - planned), by))

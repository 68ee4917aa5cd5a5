"""Presence of a person: faces get lost and found again, and reports of it may come late or twice.

A tracker loses a face for half a second whenever a hand or a turn of the head covers it. If that counted as
leaving, each such moment would end all events with the person, and begin their acquaintance anew. So a lost face
counts as gone only after `FACE_GRACE` seconds (decision 0106). Times decide here, not the order of arrival: a loss
that is reported after the person was seen again changes nothing.
"""

from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.reports.action_reports import FACE_GRACE

NEVER: Seconds = float("-inf")


class FacePresence:
    """Presence of one person."""

    def __init__(self) -> None:
        self.here = True
        self.reported = False
        """True if perception has reported that the person is there, and so will report when that is over."""
        self._lost_at: Seconds | None = None
        self.deadline: Seconds = inf
        """Time at which the person has gone, unless it is seen again before; then call `leave`. Infinite: never."""
        self._found_last = self._seen_last = self._lost_last = self.left_at = NEVER

    def seen(self, at: Seconds) -> bool:
        """Take an observation at `at` that shows the person is there. False if it is from before the person left."""
        if at < self.left_at:
            return False
        self._seen_last = max(self._seen_last, at)
        if self._lost_at is None or at >= self._lost_at:
            self.here = True
            self._is_lost_since(self._lost_last if at < self._lost_last else None)
        return True

    def found(self, at: Seconds) -> None:
        if at > self._found_last:
            self._found_last = at
            self.reported = self.seen(at) or self.reported

    def lost(self, at: Seconds) -> None:
        """Take a loss of the face. It changes nothing if it was known, or if the person has been seen since."""
        if at < self._seen_last or at <= self._lost_last:
            return
        self._lost_last = at
        if self.here and self._lost_at is None:
            self._is_lost_since(at)

    def leave(self) -> Seconds:
        """Count the person as gone. Returns the time at which it was last there."""
        assert self._lost_at is not None
        self.here, self.reported, self.left_at = False, False, self._lost_at
        self._is_lost_since(None)
        return self.left_at

    def vanish(self, at: Seconds) -> None:
        """Count the person as lost since `at`, the last report of it; call `leave` next."""
        self._is_lost_since(at)

    def _is_lost_since(self, at: Seconds | None) -> None:
        self._lost_at, self.deadline = at, inf if at is None else at + FACE_GRACE

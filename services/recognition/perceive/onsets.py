"""Onsets and ends of looks and of speech, sample by sample: poses of a head, levels of a voice. Pure.

A look begins after a dwell time on a target and ends after one off it; short sounds are no speech, and short silences
do not end it. The samples' own times decide. A beginning needs evidence: a pose after the dwell that agrees with the
first, a sound that lasts. For the end of speech silence is enough: any of the levels may be lost.
"""

from typing import NamedTuple

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.perceive.gaze_targets import GazeTarget, Targets

DWELL: Seconds = 0.15
"""Time for which the gaze stays on a target before that is a look, and off it before the look is over: a glance in
passing is no look. Decision 0009."""
ROUNDING: Seconds = 1e-9


class Change(NamedTuple):
    """Beginning or end of an action, at `at`."""

    began: bool
    action: Action
    at: Seconds
    targets: Targets = ()
    confidence: Probability = 1.0
    one_of: bool = False


class _Candidate(NamedTuple):
    """A look that may have begun."""

    seen: GazeTarget
    since: Seconds


class Looking:
    """Looks of one person. `nearest`: targets of the gaze at the latest pose, a look or not."""

    def __init__(self) -> None:
        self.target: Targets | None = None
        """Targets of the present look; None if there is none."""
        self.nearest: Targets | None = None
        self._confidence: Probability = 1.0
        self._left: Seconds | None = None
        """Time at which the gaze left the target of a look that may be over."""
        self._candidate: _Candidate | None = None

    @property
    def undecided_since(self) -> Seconds | None:
        """Start of a look, or of the end of one, that is not yet certain."""
        if self._left is not None:
            return self._left
        return None if self._candidate is None else self._candidate.since

    def feed(self, seen: GazeTarget, at: Seconds) -> list[Change]:
        """Take the gaze target at `at`, later than the last. Returns the looks that began and ended."""
        self.nearest = seen.targets
        if seen.targets == self.target:
            self._left = self._candidate = None
            return []
        if self.target is not None and self._left is None:
            self._left = at
        before = self._candidate
        if before is None or before.seen.targets != seen.targets:
            self._candidate = _Candidate(seen, at)
        else:
            self._candidate = _Candidate(min(before.seen, seen, key=lambda one: one.confidence), before.since)
        settled = at - self._candidate.since >= DWELL - ROUNDING
        changes = []
        if settled or (self._left is not None and at - self._left >= DWELL - ROUNDING):
            changes += self.end(at)
        if settled:
            (targets, self._confidence, one_of), since = self._candidate
            self.target, self._candidate = targets, None
            changes.append(Change(True, "look", since, targets, self._confidence, one_of))
        return changes

    def end(self, at: Seconds) -> list[Change]:
        """End the look: when the gaze left its target, or else at `at`."""
        if self.target is None:
            return []
        ended = Change(False, "look", at if self._left is None else self._left, self.target, self._confidence)
        self.target = self._left = None
        return [ended]

    def lose(self, at: Seconds) -> list[Change]:
        """End the look and forget the gaze, because the face is out of sight since `at`."""
        ended = self.end(at)
        self._candidate = self.nearest = None
        return ended


VOICE_ONSET: Seconds = 0.1
"""Shortest sound that counts as speech: a knock or a cough is shorter. Ours."""
VOICE_PAUSE: Seconds = 0.25
"""Shortest silence that ends speech: a stop between two words is shorter. Ours."""
VOICE_LOST: Seconds = 0.5
"""Time without a voice level after which speech has ended, at the time of the last level. Ours."""


class SpeechDetector:
    """Speech of one person."""

    def __init__(self) -> None:
        self.speaks = False
        self._heard: Seconds = float("-inf")
        """Time of the latest level."""
        self._since: Seconds | None = None
        """Start of the sound that is, or may become, speech."""
        self._silent_since: Seconds | None = None
        """Start of the silence that may end it."""
        self._confidence: Probability = 1.0

    @property
    def undecided_since(self) -> Seconds | None:
        return self._silent_since if self.speaks else self._since

    @property
    def deadline(self) -> Seconds | None:
        """Time at which speech, or a sound, is over if nothing more is heard."""
        if self._silent_since is not None:
            return self._silent_since + VOICE_PAUSE
        return None if self._since is None else self._heard + VOICE_LOST

    def feed(self, active: bool, at: Seconds, confidence: Probability) -> list[Change]:
        """Take the level at `at`, later than the last. Returns beginning and end of speech."""
        changes = self.advance(at)
        self._heard = at
        if active:
            changes += self._sounds(at, confidence)
        elif not self.speaks:
            self._since = None
        elif self._silent_since is None:
            self._silent_since = at
        return changes + self.advance(at)

    def _sounds(self, at: Seconds, confidence: Probability) -> list[Change]:
        self._silent_since = None
        if self._since is None:
            self._since, self._confidence = at, confidence
        elif not self.speaks:
            self._confidence = min(self._confidence, confidence)
        if self.speaks or at - self._since < VOICE_ONSET - ROUNDING:
            return []
        self.speaks = True
        return [Change(True, "speak", self._since, (), self._confidence)]

    def advance(self, now: Seconds) -> list[Change]:
        if self.deadline is None or now < self.deadline:
            return []
        return self.lose(self._heard)

    def lose(self, at: Seconds) -> list[Change]:
        """End the speech at the start of the silence, or else at `at`."""
        ended = Change(False, "speak", at if self._silent_since is None else self._silent_since, (), self._confidence)
        spoke, self.speaks = self.speaks, False
        self._since = self._silent_since = None
        return [ended] if spoke else []

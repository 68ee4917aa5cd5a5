"""Speech from voice levels: short sounds do not count, short silences do not end it.

The input is levels, not edges, so any of them may be lost. A beginning needs evidence; for an end silence is enough.
"""

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.recognition.perceive.looks import ROUNDING, Change

VOICE_ONSET: Seconds = 0.1
"""Shortest sound that counts as speech: a knock or a cough is shorter. Ours."""
VOICE_PAUSE: Seconds = 0.25
"""Shortest silence that ends speech: a stop between two words is shorter. Ours."""
VOICE_LOST: Seconds = 0.5
"""Time without a voice level after which speech has ended, at the time of the last level. Ours."""


class Voice:
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

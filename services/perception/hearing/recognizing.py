"""Recognizers of speech, and the desk at which one works: sound of speeches in, words out. Pure.

    class MyRecognizer(SpeechRecognizer):
        def __init__(self, settings: RecognizerSettings) -> None:
            self.model = engine.load(settings.model)

        def listen(self) -> Listening:
            return Whole(self.model.transcribe)

It runs in a process of its own (`listening.py`), and may block. An engine that understands while somebody speaks is a
`Listening` of its own; `Whole` waits for the end.

    [project.entry-points."engage.recognizers"]
    mine = "my_package.words:MyRecognizer"
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator

import numpy as np
from msgspec import Struct

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.units import Probability
from engage_hri.services.perception.hearing.config import HearingConfig
from engage_hri.services.perception.hearing.voice import Samples


class RecognizerSettings(Struct, frozen=True, kw_only=True):
    """The settings of a recognizer; the same as in `HearingConfig`."""

    language: str = "en"
    model: str = ""
    phrases: tuple[str, ...] = ()
    address: str = ""


def settings_of(config: HearingConfig) -> RecognizerSettings:
    """Pick the settings of the recognizer."""
    return RecognizerSettings(
        language=config.language, model=config.model, phrases=config.phrases, address=config.address
    )


class SpeechWords(Struct, frozen=True):
    """Words of a speech. text: empty: there are none in it. confidence: in these words."""

    text: str
    confidence: Probability = 1.0


class Listening(ABC):
    """One speech, as a recognizer hears it."""

    @abstractmethod
    def hear(self, samples: Samples) -> str:
        """Take more of the sound: 16 kHz, one channel. Returns the words as far as they are known now, or nothing."""

    @abstractmethod
    def end(self) -> SpeechWords:
        """Take note that the speech is over. Returns its words."""


class SpeechRecognizer(ABC):
    """A recognizer of speech. It is made once, in the process in which it runs."""

    def __init__(self, settings: RecognizerSettings) -> None:
        """Load what it needs. Raises InputRefused: a package or a model is missing, or a setting is no good."""
        super().__init__()

    @abstractmethod
    def listen(self) -> Listening:
        """Begin with a speech. Several may go on at once."""


class Whole(Listening):
    """A speech that is understood once it is over.

    understand: makes words of the whole sound.
    """

    def __init__(self, understand: Callable[[Samples], SpeechWords]) -> None:
        self._understand = understand
        self._heard: list[Samples] = []

    def hear(self, samples: Samples) -> str:
        self._heard.append(samples)
        return ""

    def end(self) -> SpeechWords:
        return self._understand(np.concatenate([np.zeros(0, np.int16), *self._heard]))


def missing(package: str, error: ImportError) -> InputRefused:
    """Make the error of a recognizer whose package is not installed. package: as it is installed."""
    from engage_hri.services.runtime.installation import packages_command

    return InputRefused(Fault(reason=str(error), where="hearing.recognizer", advice=packages_command(package)))


def no_model(reason: str, advice: str) -> InputRefused:
    """Make the error of a recognizer whose model is not there. advice: how to get one."""
    return InputRefused(Fault(reason=reason, where="hearing.model", advice=advice))


# -- the desk ------------------------------------------------------------------------------------------------------


class SpeechOrder(Struct, frozen=True, tag=True):
    """Order: more sound of a speech. speech: its number. samples: 16 bit, little-endian; empty: none any more."""

    speech: int
    samples: bytes


class KnownWords(Struct, frozen=True, tag=True):
    """Answer: the words of a speech, as far as they are known."""

    speech: int
    words: SpeechWords
    final: bool


class NotUnderstood(Struct, frozen=True, tag=True):
    """Answer: a speech was not understood, for the recognizer has failed."""

    speech: int
    fault: Fault


Answer = KnownWords | NotUnderstood


class Desk:
    """The desk of a recognizer. A speech that fails is given up; the next one begins anew. what: it is, in words."""

    def __init__(self, recognizer: SpeechRecognizer, what: str = "the recognizer") -> None:
        self._recognizer = recognizer
        self._what = what
        self._speeches: dict[int, tuple[Listening | None, str]] = {}
        """By number: who hears it, None if it was given up, and the words that were told."""

    def take(self, order: SpeechOrder) -> Iterator[Answer]:
        """Take an order, and answer if there is news. The last answer of a speech is final, or a failure."""
        try:
            listening, told = self._speeches.get(order.speech) or (self._recognizer.listen(), "")
            self._speeches[order.speech] = listening, told
            if order.samples:
                text = "" if listening is None else _plain(listening.hear(np.frombuffer(order.samples, "<i2")))
                if text and text != told:
                    self._speeches[order.speech] = listening, text
                    yield KnownWords(order.speech, SpeechWords(text), final=False)
            elif listening is not None:
                words = listening.end()
                confidence = float(words.confidence)  # of an engine's own kind of number
                if not 0.0 <= confidence <= 1.0:
                    raise ValueError(f"a confidence of {confidence:g}: expected 0 to 1")
                yield KnownWords(order.speech, SpeechWords(_plain(words.text), confidence), final=True)
        except Exception as error:  # whatever an engine raises: it ends this speech, and no other
            self._speeches[order.speech] = None, ""
            reason = f"{self._what} fails: {type(error).__name__}: {error}"
            yield NotUnderstood(order.speech, error.fault if isinstance(error, EngageError) else Fault(reason=reason))
        if not order.samples:
            del self._speeches[order.speech]


def _plain(text: str) -> str:
    """A text as it can be sent: engines leave spaces, and halves of letters where a model was cut off in one."""
    return " ".join(text.split()).encode(errors="replace").decode()

"""The interface of a speech synthesizer: text in, samples out, with the times that the engine knows.

    class MySynthesizer(Synthesizer):
        rate = 16000

        def say(self, phrase: Phrase) -> Said:
            return Said(engine.speak(phrase.text))

It runs in a process of its own (`studio.py`), and may block. Words and mouth shapes are laid out by `clauses.py`:
from the times of `Said`, or from the sound alone where there are none.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar

from msgspec import Struct

from engage_hri.schemas.documents.prosody import Prosody
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.units import Seconds


class Phrase(Struct, frozen=True):
    """A piece of a text that is said in one go.

    text: without emoji; where one stood there is a space. language: a tag such as `de` or `pt-BR`; empty: the one of
    the settings. prosody: spans of the text, by characters.
    """

    text: str
    language: str = ""
    prosody: tuple[Prosody, ...] = ()


class Heard(Struct, frozen=True, array_like=True):
    """The instant at which the engine begins a word. position: a character of the phrase that is in it.

    at: seconds.
    """

    position: int
    at: Seconds


class Phone(Struct, frozen=True, array_like=True):
    """The instant at which a speech sound begins. name: in IPA; empty: silence. at: seconds."""

    name: str
    at: Seconds


class Said(Struct, frozen=True):
    """A phrase as sound.

    samples: 16-bit integers or floats from -1 to 1, one channel; an array, or the bytes of such integers.
    words: when each begins, in time order; a word of the text may be missing or come twice. Empty: they are aligned
    with the sound. phones: in time order; empty: the mouth follows the loudness.
    """

    samples: Any
    words: Sequence[Heard] = ()
    phones: Sequence[Phone] = ()


class SynthesisFailed(EngageError):
    """The engine cannot say a phrase. The fault says why, and what to do."""


class Synthesizer(ABC):
    """A speech synthesizer. It is made in the process in which it runs.

    rate: samples per second, the same for all it says. Settings: the type of its one argument, as of a `Body`; a
    `VoiceSettings` or a type that inherits from it.
    """

    Settings: ClassVar[type[Struct] | None] = None
    rate: int = 22050

    @abstractmethod
    def say(self, phrase: Phrase) -> Said:
        """Synthesize a phrase. What the engine cannot do of its prosody is left out.

        phrase: what is to be said.

        Raises:
            SynthesisFailed: it cannot be said, as in a language that the engine does not have.
        """


def refused(reason: str, advice: str = "") -> SynthesisFailed:
    """Make the error of a phrase that cannot be said.

    reason: what is wrong. advice: what to do.
    """
    return SynthesisFailed(Fault(reason=reason, advice=advice, service="control"))


class VoiceSettings(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Settings of every voice with a synthesizer.

    device: `auto`: the first player program that is installed; `none`: no sound device; else the name of one of
        `player.PLAYERS`. In virtual time there is no device.
    player: the command of another player program, which takes raw samples on its standard input, 16 bit, little-
    endian, one channel; `{rate}` stands for the samples per second.
    latency: seconds from the moment at which the player gets a sample until it sounds; None: what is usual for it.
    file: a WAV file for all that is said, each at its loop time; empty: none.
    language: a tag such as `de`, where the text does not name its language (`xml:lang`); empty: the voice's own.
    patience: seconds that a plan may wait for a phrase that was never said before. What is not there by then is
        estimated from its length.
    phrase_limit: seconds that the synthesizer may take for one phrase of at most some 240 characters. One that takes
        longer is ended, and the speech that waits for it fails; the next speech has another one.
    """

    device: str = "auto"
    player: tuple[str, ...] = ()
    latency: Seconds | None = None
    file: str = ""
    language: str = ""
    patience: Seconds = 0.1
    phrase_limit: Seconds = 5.0

    def __post_init__(self) -> None:
        if self.latency is not None and not 0.0 <= self.latency <= 1.0:
            raise ValueError(f"latency is {self.latency}: expected 0..1 s")
        if not 0.0 <= self.patience <= 5.0:
            raise ValueError(f"patience is {self.patience}: expected 0..5 s")
        if not 0.1 <= self.phrase_limit <= 60.0:
            raise ValueError(f"phrase_limit is {self.phrase_limit}: expected 0.1..60 s")

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

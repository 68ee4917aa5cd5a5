"""Utterances of one person, told as a recognizer tells them: first that words will come, then more and more. Pure."""

from collections.abc import Iterator
from itertools import count

from engage_hri.schemas.perception import Utterance
from engage_hri.schemas.units import Seconds, Stamp

WORD: Seconds = 0.35
"""Time for which a word is spoken, by and large."""
RECOGNIZING: Seconds = 0.3
"""Time from the end of speech until a recognizer knows its words for good."""


class Utterances:
    """The utterances of one person.

    person: actor id. life: of the one who tells of them, so that no id comes again after a restart.
    """

    def __init__(self, person: str, life: str) -> None:
        self._person = person
        self._life = life
        self._numbers = count(1)

    def typed(self, text: str, at: Stamp, to: tuple[str, ...] = ()) -> Utterance:
        """Make the message of a line that is sent at once."""
        return Utterance(actor=self._person, id=self._id(), text=text, began=at, at=at, to=to)

    def begun(self, began: Stamp, to: tuple[str, ...] = ()) -> Utterance:
        """Make the first message of an utterance: somebody speaks, and the words will come."""
        return Utterance(actor=self._person, id=self._id(), text="", began=began, at=began, final=False, to=to)

    def _id(self) -> str:
        return f"{self._life}-{next(self._numbers)}"


def partial_texts(text: str) -> Iterator[str]:
    """Tell what is known after each word: `put`, `put it`, `put it there`."""
    words = text.split()
    return (" ".join(words[:number]) for number in range(1, len(words) + 1))


def speaking_time(text: str) -> Seconds:
    """Estimate how long the words take: `WORD` each, and at least one."""
    return WORD * max(1, len(text.split()))

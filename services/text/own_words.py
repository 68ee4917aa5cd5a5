"""Words of the robot that come back as somebody's: a recognizer may hear its loudspeaker. Pure.

The body tells each word when the voice has finished it. What the robot says and what a person says after it may be
the same words ("the red one?", "the red one"), so the time decides: an utterance is the robot's echo if its words are
a run of the robot's, and it begins while the first of these is said, or shortly after, and before the last is over.
"""

from collections import deque
from difflib import SequenceMatcher
from math import inf

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.text.listening import plain_words

WORDS_KEPT = 256
"""Number of words of the robot that are remembered: those of about a minute and a half."""
EARLY: Seconds = 0.3
"""Time by which a recognizer may take an echo to begin before the robot's word does. Ours."""
LATE: Seconds = 0.5
"""Time after the end of the first word by which its echo has begun: sound and sensors take their time. Ours."""
LETTER: Seconds = 0.1
"""Longest time for a letter of a word: before a word that took longer the voice has waited. Ours."""
MOST_MISHEARD = 1 / 3
"""Greatest share of the words of an echo that a recognizer may have taken for others. The first and the last are none
of them: otherwise a "stop" after the robot's words would be part of their echo. Ours."""


class _OwnWord(Struct, frozen=True):
    """A word of the robot. began: at the earliest."""

    text: str
    began: Seconds
    ended: Seconds


class OwnWords:
    """The latest words of the robot."""

    def __init__(self) -> None:
        self._words: deque[_OwnWord] = deque(maxlen=WORDS_KEPT)
        self._since: Seconds = -inf
        """When the robot began to speak, or has finished its last word."""

    def begins(self, at: Seconds) -> None:
        """Take the beginning of a speech of the robot."""
        self._since = max(self._since, at)

    def says(self, word: str, at: Seconds) -> None:
        """Take a word that the robot has finished."""
        began = max(self._since, at - LETTER * (3 + len(word)))
        self._words += [_OwnWord(text, min(began, at), at) for text in plain_words(word)]
        self._since = max(self._since, at)

    def are(self, text: str, began: Seconds, *, is_final: bool) -> bool:
        """Tell whether words that begin at `began` are the robot's own.

        is_final: False: the last of several may be half of a word, and more may follow.
        """
        heard = plain_words(text)
        heard = heard if is_final else heard[:-1] or heard
        words, late = list(self._words), 0.0 if is_final else LATE
        return bool(heard) and any(
            each.text == heard[0]
            and each.began - EARLY <= began <= each.ended + LATE
            and _is_echo(heard, words[place : place + len(heard) + len(heard) // 2], began - late)
            for place, each in enumerate(words)
        )


def _is_echo(heard: list[str], said: list[_OwnWord], began: Seconds) -> bool:
    """Tell whether most of what is heard, and the last of it, is in what was said. began: before the end of that."""
    same = SequenceMatcher(None, heard, [word.text for word in said], autojunk=False).get_matching_blocks()
    found = {block.a + n: said[block.b + n] for block in same for n in range(block.size)}
    last = found.get(len(heard) - 1)
    misheard = len(heard) - len(found)
    return last is not None and began <= last.ended and misheard <= MOST_MISHEARD * len(heard)

"""When the voice says what: words and marks of a text on a time line, known before it speaks."""

import re

from msgspec import Struct

from schemas.units import Seconds

BEFORE_WORD: Seconds = 0.12
PER_LETTER: Seconds = 0.05
"""A word of 4.6 letters takes 0.35 s."""
PAUSE = {",": 0.2, ";": 0.25, ":": 0.25, ".": 0.35, "!": 0.35, "?": 0.35, "…": 0.5, "—": 0.25, "–": 0.25}
"""Seconds of silence after punctuation, but for the last of a text."""


class Word(Struct, frozen=True):
    """Said from `start` to `end`, seconds from the utterance's start. position: of its end, punctuation included."""

    text: str
    start: Seconds
    end: Seconds
    position: int


class Utterance(Struct, frozen=True):
    words: tuple[Word, ...]
    seconds: Seconds

    def said_by(self, position: int) -> Seconds:
        """When `position` characters of the text have been said; between two words: as the next begins."""
        previous = Word("", 0.0, 0.0, 0)
        for word in self.words:
            first = word.position - len(word.text)
            if position <= previous.position:
                return previous.end
            if position <= first:
                return word.start if position == first else previous.end
            if position < word.position:
                return word.start + (word.end - word.start) * (position - first) / len(word.text)
            previous = word
        return self.seconds

    def is_gap(self, position: int) -> bool:
        """Is no word being said when `position` characters of the text have been?"""
        return not any(word.position - len(word.text) < position < word.position for word in self.words)


def utter(text: str, pace: float = 1.0) -> Utterance:
    """The time line of `text`; prosody is ignored. pace: 2 takes twice as long."""
    words: list[Word] = []
    now = pause = 0.0
    for match in re.finditer(r"\S+", text):
        token = match.group()
        letters = sum(character.isalnum() for character in token)
        if letters == 0:
            pause = max(pause, PAUSE.get(token[-1], 0.0) * pace)
            continue
        start = now + pause if words else 0.0
        now = start + (BEFORE_WORD + PER_LETTER * letters) * pace
        words.append(Word(token, start, now, match.end()))
        pause = PAUSE.get(token.rstrip("\"'”’)»")[-1:], 0.0) * pace
    return Utterance(tuple(words), now)

"""Cuts text into chunks that can be spoken while the rest is still being written: at the ends of clauses.

    chunks = Chunker()
    for piece in pieces:                      # text as it comes, or whole parts
        for chunk in chunks.feed(piece): ...  # parts for a turn fragment
    chunks.rest()

In the text `[blue-square]` refers to the object of that id, and `[blue-square!]` does so with high certainty. The
words of a `Say` part are cut as text is, but brackets are words there. A part begins and ends between words. Pure.
"""

import re
import unicodedata
from collections.abc import Iterator

from engage_hri.schemas.speakable import UNSPACED, joined, word_count
from engage_hri.schemas.tool import Part, Refer, Say

Chunk = tuple[Part, ...]
"""Parts that are spoken without a pause."""

CLAUSE_WORDS = 4
"""A chunk of fewer words does not end at a comma: so short a fragment would be over before the next one comes."""
WORDS_OF_REFERENCE = 2
"""Words that a reference counts as, such as "the square": which ones will be chosen is not known yet."""
_REFERENCE = r"\[(?P<id>[^\[\]\s!]+)(?P<certain>!?)\]"
_ABBREVIATED = "".join(rf"(?<!\b{word})" for word in ("Mr", "Mrs", "Ms", "Dr", "Prof", "St", "vs", "[A-Z]"))
_CLOSING = "\"'”’)\\]"
_CLOSING_WIDE = f"{_CLOSING}」』）】》〉］｝〕"
_STOPS_WIDE = "。！？｡။។"
_WIDE = f"(?<=[{UNSPACED}])"
"""Behind a character of a script without spaces a stop needs no space after it, either."""
_SENTENCE = rf"{_ABBREVIATED}[.!?…।؟۔]+[{_CLOSING}]*(?=\s)"
_SENTENCE_WIDE = (
    rf"(?:[{_STOPS_WIDE}]|{_WIDE}[.!?])[{_STOPS_WIDE}.!?…]*[{_CLOSING_WIDE}]*(?=[^{_STOPS_WIDE}.!?…{_CLOSING_WIDE}])"
)
_CLAUSE = rf"[,;:–—،؛][{_CLOSING}]*(?=\s)"
_CLAUSE_WIDE = rf"(?:[，、；：､]|{_WIDE}[,;:])[{_CLOSING_WIDE}]*(?=[^\d{_CLOSING_WIDE}])"
_CLAUSE_THAI = "(?<=[\u0e01-\u0ecd])(?=\\s+[\u0e01-\u0ecd])"
"""Thai and Lao have spaces where others have commas and full stops."""
_END = rf"(?P<sentence>{_SENTENCE}|{_SENTENCE_WIDE}|\n\s*\n)|(?P<clause>{_CLAUSE}|{_CLAUSE_WIDE}|{_CLAUSE_THAI})"
_CUT = re.compile(rf"{_REFERENCE}|{_END}")
_CUT_OF_WORDS = re.compile(_END)


class Chunker:
    """The text and parts of one turn that are not spoken yet. clause_words: see `CLAUSE_WORDS`."""

    def __init__(self, clause_words: int = CLAUSE_WORDS) -> None:
        self._clause_words = clause_words
        self._text = ""
        """Text that may still become a reference, or the end of a clause, with what comes."""
        self._is_between_words = True
        """True if the next text begins a new word, even without a space before it."""
        self._parts: list[Part] = []

    def feed(self, piece: str | Part) -> Iterator[Chunk]:
        """Take a piece; returns the chunks that are complete now. A part completes the words before it."""
        if isinstance(piece, str):
            self._text += piece
            yield from self._cut(_CUT)
            return
        yield from self._complete(_CUT)
        if isinstance(piece, Say):
            self._text = piece.say
            yield from self._complete(_CUT_OF_WORDS)
        else:
            self._parts.append(piece)

    def rest(self) -> Chunk:
        """Take out all that is left, when nothing more comes; may be empty."""
        self._say(self._text)
        self._text = ""
        return self._taken()

    def _cut(self, pattern: re.Pattern[str]) -> Iterator[Chunk]:
        while cut := pattern.search(self._text):
            found = cut.groupdict()
            id = found.get("id")
            self._say(self._text[: cut.start() if id else cut.end()])
            self._text = self._text[cut.end() :]
            if id:
                self._parts.append(Refer(refer=id, certainty="high" if found["certain"] else "normal"))
            elif self._parts and (found["sentence"] or self._words >= self._clause_words):
                yield self._taken()

    def _complete(self, pattern: re.Pattern[str]) -> Iterator[Chunk]:
        """Cut the text to its end: the last word is complete, too."""
        self._text += " "
        yield from self._cut(pattern)
        self._say(self._text)
        self._text = ""
        self._is_between_words = True

    @property
    def _words(self) -> float:
        return sum(word_count(part.say) if isinstance(part, Say) else WORDS_OF_REFERENCE for part in self._parts)

    def _say(self, text: str) -> None:
        if not (said := " ".join(text.split())):
            return
        before = self._parts[-1] if self._parts else None
        if isinstance(before, Say):
            together = joined((before.say, text)) if self._is_between_words else f"{before.say}{text}"
            self._parts[-1] = Say(say=" ".join(together.split()))
        elif _means_something(said) or isinstance(before, Refer):
            self._parts.append(Say(say=said))
        self._is_between_words = False

    def _taken(self) -> Chunk:
        taken, self._parts = tuple(self._parts), []
        return taken


def _means_something(text: str) -> bool:
    """True if the text is more than punctuation. An emoji is not spoken, but belongs to what has been said."""
    return any(unicodedata.category(character)[0] in "LNS" for character in text)

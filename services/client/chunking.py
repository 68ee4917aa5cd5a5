"""Cuts text into chunks that can be spoken while the rest is still being written: at the ends of clauses.

    chunks = Chunker()
    for piece in pieces:                      # text as it comes, or whole parts
        for chunk in chunks.feed(piece): ...  # parts for a turn fragment
    chunks.rest()

In the text `[blue-square]` refers to the object of that id, and `[blue-square!]` does so with high certainty. What is
for the eye is left out (services/text). The words of a `Say` part are read and cut as text is, but brackets are words
there. A part begins and ends between words. Pure.
"""

import re
import unicodedata
from collections.abc import Iterator

from engage_hri.schemas.text import joined, word_count
from engage_hri.schemas.tool import Part, Refer, Say
from engage_hri.services.text.ear import heard
from engage_hri.services.text.ends import ends, next_end
from engage_hri.services.text.marks import Ids, Piece, Reader, problems
from engage_hri.services.text.patterns import PUNCTUATION, is_silent

Chunk = tuple[Part, ...]
"""Parts that are spoken without a pause."""

CLAUSE_WORDS = 4
"""A chunk of fewer words does not end at a comma: so short a fragment would be over before the next one comes."""
WORDS_OF_REFERENCE = 2
"""Words that a reference counts as, such as "the square": which ones will be chosen is not known yet."""
_AT_ONCE = 4096
"""Characters that are looked through for ends at once: so the time to read a long text grows with its length only."""
_MARK = re.compile(PUNCTUATION)
UNKNOWN = Ids(None)


class Chunker:
    """The text and parts of one turn that are not spoken yet. clause_words: see `CLAUSE_WORDS`."""

    def __init__(self, clause_words: int = CLAUSE_WORDS) -> None:
        self._clause_words = clause_words
        self._reader = Reader()
        self._text = ""
        """Text for the ear that may still become the end of a clause with what comes."""
        self._since = 0
        """Characters of it in which there is no end."""
        self._is_between_words = True
        """True if the next text begins a new word, even without a space before it."""
        self._parts: list[Part] = []
        self._left: list[Piece] = []

    def feed(self, piece: str | Part, ids: Ids = UNKNOWN) -> Iterator[Chunk]:
        """Take a piece; returns the chunks that are complete now. A part completes the words before it.

        ids: of the objects in the world as it is now. Where nobody knows them, a bracket with one word is taken for a
        reference, if it is not clearly something else.
        """
        if isinstance(piece, str):
            yield from self._take(self._reader.feed(piece, ids))
            return
        yield from self._complete(self._reader.finish(ids))
        if isinstance(piece, Say):
            part = Reader()
            yield from self._complete([*part.feed(piece.say), *part.finish()])
        else:
            self._parts.append(piece)

    def settled(self, ids: Ids = UNKNOWN) -> Iterator[Chunk]:
        """Take out what reads as a whole sentence, when nothing has come for a while."""
        text = f"{self._text}{self._reader.undecided}".rstrip(" \n*_~`")
        if ends(text, len(text)):
            yield from self._complete(self._reader.feed(" ", ids))
            if self._parts:
                yield self._taken()

    def rest(self, ids: Ids = UNKNOWN) -> Chunk:
        """Take out all that is left, when nothing more comes; may be empty."""
        *chunks, last = *self._take(self._reader.finish(ids)), ()
        self._say(self._text)
        self._text, self._since = "", 0
        before = tuple(part for chunk in chunks for part in chunk)
        return (*before, *self._taken(), *last)

    @property
    def left_out(self) -> tuple[str, ...]:
        """Say what of the text was not said, or otherwise than it may have been meant; then forget it."""
        told, self._left = problems(self._left), []
        return told

    def _take(self, pieces: list[Piece]) -> Iterator[Chunk]:
        run: list[str] = []
        for piece in pieces:
            if piece.kind in ("say", "symbol"):
                run.append(piece.text)
            elif piece.kind == "silent":
                run.append(piece.text if piece.text.isprintable() else " ")
            elif piece.kind == "left":
                self._left.append(piece)
            else:
                yield from self._add("".join(run))
                run.clear()
                yield from self._end_at(piece)
        yield from self._add("".join(run))

    def _end_at(self, piece: Piece) -> Iterator[Chunk]:
        """Take a reference, or the end of a paragraph, an item or a cell."""
        if piece.text == "," and piece.kind == "break":
            self._text = self._text.rstrip()
            self._text += "," if self._text[-1:].isalnum() else ""
            return
        if piece.kind == "refer" or self._text.strip() or self._parts:
            self._say(self._text)
            self._text, self._since = "", 0
        if piece.kind == "refer":
            self._parts.append(Refer(refer=piece.text, certainty="high" if piece.certain else "normal"))
        elif self._parts:
            self._is_between_words = True
            yield self._taken()

    def _add(self, text: str) -> Iterator[Chunk]:
        for at in range(0, len(text), _AT_ONCE):
            self._text += text[at : at + _AT_ONCE]
            yield from self._cut()

    def _cut(self) -> Iterator[Chunk]:
        while True:
            end, self._since = next_end(self._text, self._since)
            if end is None:
                return
            words = self._words + word_count(self._text[: end.place])
            if end.kind == "clause" and words < self._clause_words:
                continue
            self._say(self._text[: end.place])
            self._text, self._since = self._text[end.place :], 0
            if self._parts:
                yield self._taken()

    def _complete(self, pieces: list[Piece]) -> Iterator[Chunk]:
        """Take pieces to their end: the last word is complete, too."""
        yield from self._take(pieces)
        yield from self._add(" ")
        self._say(self._text)
        self._text, self._since = "", 0
        self._is_between_words = True

    @property
    def _words(self) -> float:
        return sum(word_count(part.say) if isinstance(part, Say) else WORDS_OF_REFERENCE for part in self._parts)

    def _say(self, text: str) -> None:
        if not (said := " ".join(text.split())):
            return
        before = self._parts[-1] if self._parts else None
        if isinstance(before, Say):
            text = f"{' ' * text[:1].isspace()}{said}"
            together = joined((before.say, text)) if self._is_between_words else f"{before.say}{text}"
            self._parts[-1] = Say(say=" ".join(together.split()))
        elif _means_something(said) or isinstance(before, Refer):
            self._parts.append(Say(say=said))
        self._is_between_words = False

    def _taken(self) -> Chunk:
        taken, self._parts = self._parts, []
        return tuple(Say(say=_written(part.say)) if isinstance(part, Say) else part for part in taken)


def parts_of(text: str, ids: Ids) -> tuple[Chunk, tuple[str, ...]]:
    """Read a text that is known as a whole. Returns its parts, and what of it was left out, in words."""
    chunker = Chunker()
    parts: list[Part] = []
    for part in (*(each for chunk in chunker.feed(text, ids) for each in chunk), *chunker.rest(ids)):
        if isinstance(part, Say) and parts and isinstance(parts[-1], Say):
            parts[-1] = Say(say=joined((parts[-1].say, part.say)))
        else:
            parts.append(part)
    return tuple(parts), chunker.left_out


def _written(words: str) -> str:
    """Write words for the ear so that they are read as they are: with backslashes if they look like marks."""
    plain = "".join(" " if is_silent(each) else each for each in words)
    return words if heard(words).text.split() == plain.split() else _MARK.sub(r"\\\g<0>", words)


def _means_something(text: str) -> bool:
    """True if the text is more than punctuation. An emoji is not spoken, but belongs to what has been said."""
    return any(unicodedata.category(character)[0] in "LNS" for character in text)

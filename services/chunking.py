"""Where speech that is still being written can be spoken already: words and references, cut at ends of clauses.

    chunks = Chunker()
    for piece in pieces:                      # text as it comes, or whole parts
        for chunk in chunks.feed(piece): ...  # parts for a turn fragment
    chunks.rest()

In the text `[blue-square]` refers to the object of that id, and `[blue-square!]` does so with high certainty.
Pure.
"""

import re
from collections.abc import Iterator

from schemas.tool import Part, Refer, Say

Chunk = tuple[Part, ...]
"""Parts that are spoken without a pause."""

CLAUSE_WORDS = 4
"""A chunk of fewer words does not end at a comma: so short a fragment would be over before the next one comes."""
_REFERENCE = r"\[(?P<id>[^\[\]\s!]+)(?P<certain>!?)\]"
_CLOSING = "[\"'”’)\\]]*"
_ABBREVIATED = "".join(rf"(?<!\b{word})" for word in ("Mr", "Mrs", "Ms", "Dr", "Prof", "St", "vs", "[A-Z]"))
_SENTENCE = rf"{_ABBREVIATED}[.!?…]+{_CLOSING}(?=\s)"
_CLAUSE = rf"[,;:–—]{_CLOSING}(?=\s)"
_CUT = re.compile(rf"{_REFERENCE}|(?P<sentence>{_SENTENCE}|\n\s*\n)|(?P<clause>{_CLAUSE})")
_WORD = re.compile(r"\w")
_SPOKEN = re.compile(r"\S*\w\S*")


class Chunker:
    """clause_words: see `CLAUSE_WORDS`."""

    def __init__(self, clause_words: int = CLAUSE_WORDS) -> None:
        self._clause_words = clause_words
        self._text = ""
        """Of which it is not known yet whether it is words or a reference, or where it ends."""
        self._parts: list[Part] = []

    def feed(self, piece: str | Part) -> Iterator[Chunk]:
        """The chunks that are complete now. A part stands where it stands: the words before it are complete."""
        if not isinstance(piece, str):
            self._say(self._text)
            self._text = ""
            self._parts.append(piece)
            return
        self._text += piece
        while cut := _CUT.search(self._text):
            self._say(self._text[: cut.start() if cut["id"] else cut.end()])
            self._text = self._text[cut.end() :]
            if cut["id"]:
                self._parts.append(Refer(refer=cut["id"], certainty="high" if cut["certain"] else "normal"))
            elif self._parts and (cut["sentence"] or self._words >= self._clause_words):
                yield self._taken()

    def rest(self) -> Chunk:
        """What is left when nothing more comes; may be empty."""
        self._say(self._text)
        self._text = ""
        return self._taken()

    @property
    def _words(self) -> int:
        """A reference counts as two: "the square"."""
        return sum(len(_SPOKEN.findall(part.say)) if isinstance(part, Say) else 2 for part in self._parts)

    def _say(self, text: str) -> None:
        said = " ".join(text.split())
        if self._parts and isinstance(last := self._parts[-1], Say):
            self._parts[-1] = Say(say=f"{last.say} {said}".rstrip())
        elif _WORD.search(said) or (said and self._parts and isinstance(self._parts[-1], Refer)):
            self._parts.append(Say(say=said))

    def _taken(self) -> Chunk:
        taken, self._parts = tuple(self._parts), []
        return taken

"""A whole text as a voice says it, with the places of its characters in the text as its author wrote it."""

from bisect import bisect_left
from functools import lru_cache

from msgspec import Struct

from engage_hri.services.text.marks import NO_IDS, Reader, problems
from engage_hri.services.text.patterns import is_silent


class Heard(Struct, frozen=True):
    """A text for the ear. places: for each character the number of characters of the author's text before it.

    length: characters of the author's text. problems: what was left out, in words.
    """

    text: str
    places: tuple[int, ...]
    length: int
    problems: tuple[str, ...] = ()

    def place(self, written: int) -> int:
        """Convert a place in the author's text to the one in this text."""
        return bisect_left(self.places, written)

    def written(self, place: int) -> int:
        """Convert a place in this text to the one in the author's; with the last word all of it is over."""
        if not any(map(str.isalnum, self.text[place:])):
            return self.length
        return self.places[place - 1] + 1 if place > 0 else 0


@lru_cache(256)
def heard(text: str) -> Heard:
    """Read a text for the ear: without what is for the eye. A bracket in it is words, whatever objects there are."""
    if text.isascii() and text.replace(" ", "").replace(",", "").isalpha():
        return Heard(text, tuple(range(len(text))), len(text))
    reader = Reader()
    pieces = [*reader.feed(text), *reader.finish(NO_IDS)]
    said: list[str] = []
    places: list[int] = []
    last = 0
    """Characters up to the last one that is no white space."""
    for each in pieces:
        if each.kind == "break" and last:
            last += _pause(said, places, last)
        elif each.kind == "say":
            said += each.text
            places += range(each.place, each.end)
        elif each.kind in ("symbol", "silent") and each.text:
            said.append(each.text if each.kind == "symbol" else " ")
            places.append(each.place)
        if each.kind in ("say", "symbol") and (text_of := each.text.rstrip()):
            last = len(said) - len(each.text) + len(text_of)
    return Heard("".join(said), tuple(places), len(text), problems(pieces))


def said(text: str, written: int) -> str:
    """Return the words that were said of a text, in the author's spelling. written: characters of it that are over.

    An emoji is not spoken, but belongs to what was said.
    """
    whole = heard(text)
    count = whole.place(written)
    return "".join(map(_as_written, whole.text[:count], (text[place] for place in whole.places[:count])))


def _as_written(character: str, author: str) -> str:
    if is_silent(author):
        return author
    return ("" if character == "," else " ") if author.isspace() else character


def is_spoken(text: str) -> bool:
    """Tell whether a text has something to say, once what is for the eye is left out."""
    return any(map(str.isalnum, heard(text).text))


def _pause(said: list[str], places: list[int], last: int) -> bool:
    """Let a line without punctuation end in a pause: a comma stands before the white space behind its last letter."""
    if is_bare := last < len(said) and said[last - 1].isalnum():
        said.insert(last, ",")
        places.insert(last, places[last])
    return is_bare

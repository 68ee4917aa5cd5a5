"""Pieces of a text that has been read: what is said, what is referred to, and what was left out."""

from collections.abc import Collection, Iterable, Mapping
from functools import cached_property
from typing import Literal, NamedTuple

Kind = Literal["say", "symbol", "silent", "break", "refer", "left"]
Reason = Literal["", "address", "citation", "direction", "tag", "thought", "definition", "bracket", "case"]
"""Why something was left out, or said otherwise than it may have been meant. `bracket`: names no object, and is said
as words. `case`: names an object in other letters, and refers to it."""


class Piece(NamedTuple):
    """A piece of a text.

    kind: `say`: characters to be said. `symbol`: one that stands for others, which are not said as written.
    `silent`: an emoji, or another character without a sound. `break`: a paragraph, an item, a heading or a row ends;
    with the text `,`: a cell of a row. `refer`: the text is the id of an object. `left`: what is to be told.
    place: characters of the author's text before it. end: those up to its end.
    """

    kind: Kind
    text: str
    place: int
    end: int
    reason: Reason = ""
    certain: bool = False


_TOLD: Mapping[Reason, str] = {
    "thought": "thoughts were not said",
    "direction": "stage directions were not said",
    "citation": "citations were not said",
    "address": "addresses were not said in full",
    "definition": "definitions of links were not said",
    "tag": "tags were not said",
    "bracket": "brackets that name no object were said as words",
    "case": "ids were written in other letters than the world has",
}
_MOST = 3
"""Examples in one line."""
_LONGEST = 48
"""Characters of one example."""


def problems(left: Iterable[Piece]) -> tuple[str, ...]:
    """Say in words what was left out of a text: one line a reason, with examples."""
    found: dict[Reason, dict[str, None]] = {}
    for each in left:
        if each.kind == "left":
            found.setdefault(each.reason, {})[_short(each.text)] = None
    return tuple(f"{told}: {_examples(list(found[reason]))}" for reason, told in _TOLD.items() if reason in found)


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def _examples(texts: list[str]) -> str:
    more = f" and {len(texts) - _MOST} more" if len(texts) > _MOST else ""
    return f"{', '.join(texts[:_MOST])}{more}"


class Ids:
    """The ids of objects that a text may name, for a search from a place of it. None: nobody knows the world."""

    def __init__(self, ids: Collection[str] | None) -> None:
        self.ids = frozenset(ids or ())
        self.is_unknown = ids is None

    @cached_property
    def _lengths(self) -> list[int]:
        return sorted({len(each) for each in self.ids}, reverse=True)

    @cached_property
    def _folded(self) -> dict[str, str]:
        """Ids by their lower case; empty where two have the same."""
        found: dict[str, str] = {}
        for each in self.ids:
            found[each.lower()] = "" if each.lower() in found else each
        return found

    @cached_property
    def _prefixes(self) -> frozenset[str]:
        return frozenset(each.lower()[:size] for each in self.ids for size in range(len(each) + 1))

    def named(self, text: str, place: int) -> tuple[str, bool, int] | None:
        """Find the longest id that a bracket names: `id]` or `id!]`. Returns it, whether it is certain, and its end.

        Spelled exactly, or else in other letters if that is but one object's.
        """
        for is_exact in (True, False):
            for length in self._lengths:
                end = place + length
                closes, is_certain = text.startswith("]", end), text.startswith("!]", end)
                if not (closes or is_certain):
                    continue
                written = text[place:end]
                id = (written if written in self.ids else "") if is_exact else self._folded.get(written.lower(), "")
                if id:
                    return id, is_certain, end + 1 + is_certain
        return None

    def may_name(self, text: str, place: int) -> bool:
        """Tell whether the end of a text, from a place, may become an id with a bracket."""
        if not self._lengths or len(text) - place > self._lengths[0] + 1:
            return False
        rest = text[place:].lower()
        return rest in self._prefixes or rest.removesuffix("!") in self._folded

"""Pieces of a text that has been read: what is said, what is referred to, and what was left out."""

from collections.abc import Collection, Iterable, Mapping
from typing import Literal, NamedTuple

import regex

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
    "bracket": "brackets that are no reference were said as words",
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


_ANY = regex.compile(r"\[(?P<id>[^\s!\[\]]+)(?P<certain>!?)\](?=[^(])")


class Ids:
    """The ids of objects that a text may name. None: nobody knows the world, so that any word may be one."""

    def __init__(self, ids: Collection[str] | None) -> None:
        self.ids = frozenset(ids or ())
        self.is_unknown = ids is None
        named = r"\[(?P<id>\L<ids>)(?P<certain>!?)\]"
        self.exact = _ANY if ids is None else regex.compile(named, ids=self.ids)
        """Pattern of a bracket that names an object, `[id]` or `[id!]`; the longest id counts."""
        self.folded = regex.compile(named, regex.I | regex.F, ids=self.ids) if self.ids else self.exact
        """Pattern of one that does in other letters, maybe."""

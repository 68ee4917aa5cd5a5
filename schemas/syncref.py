"""References to sync points, as text and as data.

    [block:]behavior:sync[:n][±offset]      speech-1:end + 0.5     g:stroke:2-1     block-2:gaze-1:start
    [block:]number                          seconds after the block's start
    bml:start, bml:end                      the block itself; `bml` is reserved

Spaces around `:` and the sign mean nothing. Ids and names are case-sensitive and may hold hyphens, so only the end of
a reference can be an offset: `gaze-1:stroke-2` is two seconds before `gaze-1:stroke`. The name of a mark may end in a
hyphen and a number as well (`word-2`): it is read as an offset, unless `parse` is told that such a name exists. The
codecs know the marks of their documents and write such a reference with an explicit offset (`speech-1:word-2+0`),
which everyone reads alike. So it is with a mark that is a number: `s:1` is a second after the start of block `s`,
unless speech `s` is known to have a mark `1`; `s:1+0` is the mark, and so is `block:s:1`.
"""

import math
import re
from collections.abc import Collection
from decimal import Decimal
from typing import Self

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.schemas.utf8 import is_utf8

BLOCK_ITSELF = "bml"
SYNC_POINTS = ("start", "ready", "stroke_start", "stroke", "stroke_end", "relax", "end")
"""Sync points of every behavior but speech, in order, in the drafts' spelling, which all code uses."""
LONGEST_ID = 250
LONGEST = 4 * LONGEST_ID
"""Greatest length of a reference in characters, so that no input keeps a regular expression busy."""

_NUMBER = r"(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)"
_SIGNED = re.compile(rf"([+-]?)\s*({_NUMBER})")
_WITH_OFFSET = re.compile(rf"(.*?)\s*([+-])\s*({_NUMBER})")
_NAMED = r"[^\s:+\x00-\x1f\x7f-\x9f-][^\s:+\x00-\x1f\x7f-\x9f]*"
_PLAIN = re.compile(rf"({_NAMED}):([A-Za-z_]+)")
"""Form of most references, which are read faster so."""
_NAME = re.compile(_NAMED)
_IN_NO_NAME = re.compile(r"[\s:+\x00-\x1f\x7f-\x9f]")


class SyncRef(Struct, frozen=True, omit_defaults=True):
    """A parsed reference. behavior "": `offset` seconds from the start of `block`; block "": this block.

    repetition: which stroke of a repeated behavior, from 1; 0 where the text names none.
    """

    block: str = ""
    behavior: str = ""
    sync: str = ""
    repetition: int = 0
    offset: Seconds = 0.0

    @classmethod
    def parse(cls, text: str, names: Collection[str] = ()) -> Self:
        """Read a reference. Raises ValueError, naming the text and what is wrong with it.

        names: sync points known to exist though they look like an offset (`word-2`).
        """
        if len(text) > LONGEST:
            raise _bad(text, f"longer than {LONGEST} characters")
        if (plain := _PLAIN.fullmatch(text)) and plain[1] != BLOCK_ITSELF:
            return cls("", plain[1], plain[2])
        # Collapsed, so that no run of spaces keeps the expressions below busy.
        *heads, tail = (" ".join(part.split()) for part in text.split(":"))
        if len(heads) > 3:
            raise _bad(text, "more than four parts")
        for head in heads:
            if not is_id(head):
                raise _bad(text, f"{head!r} is not an id: {objection(head)}" if head else "an empty part")
        if len(heads) < 2 and not (heads and tail in names) and (number := _signed(tail)) is not None:
            return cls(block=heads[0] if heads else "", offset=_finite(text, number))
        if not heads:
            raise _bad(text, "expected behavior:sync or a number of seconds")
        last, offset = _split_offset(tail, names)
        parts = [*heads, last]
        repetition = 0
        if len(parts) > 2 and re.fullmatch("[0-9]+", last) and (len(parts) > 3 or parts[-2] in SYNC_POINTS):
            repetition = int(parts.pop())
            if parts[-1] != "stroke" or repetition < 1:
                raise _bad(text, "a repetition counts from 1 and is legal only after 'stroke'")
        elif len(parts) > 2 and parts[-2] in SYNC_POINTS and _SIGNED.fullmatch(last):
            raise _bad(text, "a repetition is a whole number")
        elif len(parts) == 4:
            raise _bad(text, "the fourth part is the number of a repetition")
        *block, behavior, sync = parts
        if not is_id(sync):
            why = ": ".join(filter(None, (f"{sync!r} is not a sync point", objection(sync))))
            raise _bad(text, why if sync else "no sync point")
        if behavior == BLOCK_ITSELF and sync not in ("start", "end"):
            raise _bad(text, "a block has only 'start' and 'end'")
        return cls(block[0] if block else "", behavior, sync, repetition, _finite(text, offset))

    def __str__(self) -> str:
        """The canonical text: no spaces, no needless offset. Parses to an equal reference."""
        block = f"{self.block}:" if self.block else ""
        if not self.behavior:
            return f"{block}{_plain(self.offset)}"
        name = f"{self.sync}:{self.repetition}" if self.repetition else self.sync
        is_number = not self.block and _SIGNED.fullmatch(name) is not None
        needs_offset = self.offset != 0 or is_number or _WITH_OFFSET.fullmatch(name) is not None
        offset = f"{'-' if self.offset < 0 else '+'}{_plain(abs(self.offset))}" if needs_offset else ""
        return f"{block}{self.behavior}:{name}{offset}"


def is_id(text: str) -> bool:
    """Tell whether a text can be the id of a block or behavior."""
    return len(text) <= LONGEST_ID and _NAME.fullmatch(text) is not None and is_utf8(text)


def objection(text: str) -> str:
    """Reason why a text is no id, for a message; empty: it is one."""
    if is_id(text):
        return ""
    if (found := _IN_NO_NAME.search(text)) is not None:
        held = "a space" if found[0] == " " else repr(found[0])
        return f"it holds {held}"
    if text.startswith("-"):
        return "it begins with '-'"
    return f"it is longer than {LONGEST_ID} characters" if len(text) > LONGEST_ID else "it is empty or no UTF-8"


def _split_offset(tail: str, names: Collection[str]) -> tuple[str, float]:
    if tail not in names and (match := _WITH_OFFSET.fullmatch(tail)):
        name, sign, number = match.groups()
        return name, float(f"{sign}{number}") + 0.0
    return tail, 0.0


def _signed(text: str) -> float | None:
    match = _SIGNED.fullmatch(text)
    return float(f"{match[1]}{match[2]}") + 0.0 if match else None  # + 0.0: no negative zero


def _finite(text: str, number: float) -> float:
    if not math.isfinite(number):
        raise _bad(text, "the number is too large")
    return number


def _plain(number: float) -> str:
    """Write a number exactly, without exponent and without a needless fraction."""
    text = format(Decimal(repr(number)), "f")
    return text.removesuffix(".0")


def _bad(text: str, reason: str) -> ValueError:
    shown = text if len(text) <= 80 else f"{text[:77]}..."
    return ValueError(f"sync reference {shown!r}: {reason}")

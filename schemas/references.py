"""References to sync points, as text and as data; all those of a block or fragment: to find and to rewrite them.

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
from collections.abc import Callable, Collection, Iterator, Mapping, Set
from decimal import Decimal
from typing import Literal, NamedTuple, Self, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import SYNC_POINTS, canonical_sync
from engage_hri.schemas.behaviors import Behavior, Constraint, Event, Speech, Synchronize, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.text import is_utf8
from engage_hri.schemas.units import Seconds

BLOCK_ITSELF = "bml"
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


Input = Block | TurnFragment
AnyInput = TypeVar("AnyInput", Block, TurnFragment)
AnyBehavior = TypeVar("AnyBehavior", bound=Behavior)


SYNC_NAMES = frozenset({*SYNC_POINTS, "strokeStart", "strokeEnd", "attackPeak"})
"""Sync points of behaviors in either spelling."""


class Site(NamedTuple):
    """One reference in a document. path: JSON path. name: id of the behavior or constraint that holds it."""

    text: str
    path: str
    name: str
    line: int


def type_name(behavior: Behavior | type[Behavior]) -> str:
    """Name of a behavior's BML element, and `type` of its JSON form: `gazeShift`."""
    return str(behavior.__struct_config__.tag)


def marks(thing: Input) -> dict[str, frozenset[str]]:
    """Names of the marks of each speech, by the speech's id."""
    return {
        behavior.id: frozenset(mark.id for mark in behavior.marks)
        for behavior in thing.behaviors
        if isinstance(behavior, Speech)
    }


def sites(thing: Input) -> Iterator[Site]:
    """Find all references, in document order: behaviors, then constraints."""
    for index, behavior in enumerate(thing.behaviors):
        path = f"$.behaviors[{index}]"
        for number, timing in enumerate(behavior.timing):
            yield Site(timing.ref, f"{path}.timing[{number}].ref", behavior.id, behavior.line)
        if isinstance(behavior, Event):
            for number, anchor in enumerate(behavior.anchors):
                yield Site(anchor, f"{path}.anchors[{number}]", behavior.id, behavior.line)
    for index, constraint in enumerate(thing.constraints):
        for number, operator in enumerate(constraint.operators):
            path = f"$.constraints[{index}].operators[{number}]"
            name, line = constraint.id or "constraint", operator.line or constraint.line
            if operator.ref or not isinstance(operator, Synchronize):
                yield Site(operator.ref, f"{path}.ref", name, line)
            for place, sync in enumerate(operator.syncs):
                yield Site(sync, f"{path}.syncs[{place}]", name, line)


def rewritten(thing: AnyInput, change: Callable[[str], str]) -> AnyInput:
    """Apply `change` to every reference of a block or fragment."""
    behaviors = tuple(_with_references(behavior, change) for behavior in thing.behaviors)
    constraints = tuple(_constraint(constraint, change) for constraint in thing.constraints)
    return replace(thing, behaviors=behaviors, constraints=constraints)


def _with_references(behavior: AnyBehavior, change: Callable[[str], str]) -> AnyBehavior:
    if behavior.timing:
        behavior = replace(behavior, timing=tuple(Timing(each.sync, change(each.ref)) for each in behavior.timing))
    if isinstance(behavior, Event) and behavior.anchors:
        behavior = replace(behavior, anchors=tuple(change(anchor) for anchor in behavior.anchors))
    return behavior


def _constraint(constraint: Constraint, change: Callable[[str], str]) -> Constraint:
    operators = tuple(
        replace(
            operator,
            ref=change(operator.ref) if operator.ref else "",
            syncs=tuple(change(sync) for sync in operator.syncs),
        )
        for operator in constraint.operators
    )
    return replace(constraint, operators=operators)


def with_names(block: Block, names: Mapping[str, str]) -> Block:
    """Give a block, and the blocks that it refers to, other names. names: by id; ids that are not among them stay.

    A reference that cannot be read stays as it is.
    """

    def renamed(text: str) -> str:
        try:
            id = SyncRef.parse(text).block
        except ValueError:
            return text  # schemas.check says what is wrong, and where
        return f"{names[id]}:{text.partition(':')[2]}" if id in names else text

    return replace(rewritten(block, renamed), id=names.get(block.id, block.id))


def disambiguated(thing: AnyInput) -> AnyInput:
    """Make plain what a reference means by what the document has.

    A mark that looks like an offset or a number gets an explicit offset: `s:word-2` -> `s:word-2+0`, `s:1` ->
    `s:1+0`.
    A behavior's own point without its name gets that: `end="start+3"` of `g` is `g:start+3`.
    """
    known = marks(thing)
    owned = tuple(_with_own_names(behavior, known.get(behavior.id, frozenset())) for behavior in thing.behaviors)
    thing = replace(thing, behaviors=owned) if owned != thing.behaviors else thing
    if not any(known.values()):
        return thing
    return rewritten(thing, lambda text: _explicit(text, known))


def _with_own_names(behavior: AnyBehavior, marks: frozenset[str]) -> AnyBehavior:
    own = {*SYNC_NAMES, *marks}
    timing = tuple([Timing(each.sync, _own(behavior.id, each.ref, own)) for each in behavior.timing])
    return replace(behavior, timing=timing) if timing != behavior.timing else behavior


def _own(behavior: str, text: str, own: Set[str]) -> str:
    name = text.partition("+")[0].rpartition("-")[0] or text.partition("+")[0]
    return f"{behavior}:{text}" if ":" not in text and name.strip() in own else text


def _explicit(text: str, known: Mapping[str, frozenset[str]]) -> str:
    try:
        plain = SyncRef.parse(text)
        meant = SyncRef.parse(text, known.get(plain.behavior or plain.block, ()))
    except ValueError:
        return text  # schemas.check says what is wrong, and where
    return text if meant == plain else str(meant)


def respelled(
    thing: AnyInput, name: Callable[[str, str], str], elsewhere: Mapping[str, Block] | None = None
) -> AnyInput:
    """Rename every sync point to `name(sync, type)`. type: of its behavior; "" if that is unknown.

    elsewhere: other blocks that the references may name, by id.
    """
    known: list[Input] = [*(elsewhere or {}).values(), thing]
    types = {(each.id, behavior.id): type_name(behavior) for each in known for behavior in each.behaviors}

    def change(text: str) -> str:
        try:
            reference = SyncRef.parse(text)
        except ValueError:
            return text
        sync = name(reference.sync, types.get((reference.block or thing.id, reference.behavior), ""))
        return text if sync == reference.sync else str(replace(reference, sync=sync))

    def renamed(behavior: AnyBehavior) -> AnyBehavior:
        timing = tuple(Timing(name(each.sync, type_name(behavior)), each.ref) for each in behavior.timing)
        return replace(behavior, timing=timing) if timing != behavior.timing else behavior

    return rewritten(replace(thing, behaviors=tuple(renamed(each) for each in thing.behaviors)), change)


def in_draft_spelling(
    thing: AnyInput, dialect: Literal["draft", "bml-1.0"], elsewhere: Mapping[str, Block] | None = None
) -> AnyInput:
    """Translate every sync point to the drafts' spelling (`canonical_sync`)."""
    return respelled(thing, lambda sync, type: canonical_sync(sync, type, dialect), elsewhere)

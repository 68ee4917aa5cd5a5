"""Sync references inside a block or turn fragment: find them all, and rewrite them all."""

from collections.abc import Callable, Iterator, Mapping, Set
from typing import Literal, NamedTuple, TypeVar

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import canonical_sync
from engage_hri.schemas.behaviors import Behavior, Constraint, Event, Speech, Synchronize, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.syncref import SYNC_POINTS, SyncRef

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

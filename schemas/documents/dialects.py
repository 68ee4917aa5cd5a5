"""Translation of a block to another dialect, with or without our extension: for realizers that know only BML 1.0.

The translated block means the same, point for point: `tests/conformance` plans both to the same net.
"""

from collections.abc import Callable, Collection, Iterator, Mapping

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import ROWS, SYNC_POINTS, dialect_sync, same_instant
from engage_hri.schemas.behaviors import After, Before, Behavior, Constraint, Speech, Synchronize, Timing
from engage_hri.schemas.blocks import Block, Dialect
from engage_hri.schemas.references import BLOCK_ITSELF, SyncRef, in_draft_spelling, respelled, sites

EXTENSIONS = tuple([row.kind for row in ROWS if not row.is_standard])
"""Behaviors that no other realizer knows."""
Operator = Synchronize | Before | After


def core(block: Block) -> Block:
    """Remove connection events, turn signals and all else that is not BML, with every constraint to them."""
    removed = {behavior.id for behavior in block.behaviors if isinstance(behavior, EXTENSIONS)}

    def stays(reference: str) -> bool:
        named = SyncRef.parse(reference)
        return named.block not in ("", block.id) or named.behavior not in removed

    behaviors = tuple(
        replace(behavior, timing=tuple(each for each in behavior.timing if stays(each.ref)), needs=())
        for behavior in block.behaviors
        if behavior.id not in removed
    )
    remaining = (replace(each, operators=tuple(_remaining(each.operators, stays))) for each in block.constraints)
    constraints = tuple(each for each in remaining if each.operators)
    made = replace(block, behaviors=behaviors, constraints=constraints)
    # A behavior without any constraint waits for the one before it of its series. One that had some, but only to
    # removed behaviors, must not: it is tied to the block's start.
    before, after = _mentioned(block), _mentioned(made)
    freed = [behavior.id for behavior in behaviors if behavior.id in before - after]
    if not freed:
        return made
    start = After(ref=f"{BLOCK_ITSELF}:start", syncs=tuple(f"{id}:start" for id in freed))
    return replace(made, constraints=(*constraints, Constraint(operators=(start,))))


def _mentioned(block: Block) -> set[str]:
    """Ids of the behaviors with inline timing, and of those that a reference names."""
    timed = {behavior.id for behavior in block.behaviors if behavior.timing}
    named = (SyncRef.parse(site.text) for site in sites(block))
    return timed | {reference.behavior for reference in named if reference.block in ("", block.id)}


def _remaining(operators: Collection[Operator], stays: Callable[[str], bool]) -> Iterator[Operator]:
    for operator in operators:
        members = (operator.ref, *operator.syncs) if operator.ref else operator.syncs
        left = tuple(member for member in members if stays(member))
        if left == members:
            yield operator
        elif isinstance(operator, Synchronize) and len(left) > 1:
            yield Synchronize(syncs=left, line=operator.line)
        elif not isinstance(operator, Synchronize) and len(left) > 1 and left[0] == operator.ref:
            yield replace(operator, syncs=left[1:])


def in_dialect(block: Block, dialect: Dialect, elsewhere: Mapping[str, Block] | None = None) -> Block:
    """Translate a block to `dialect`. elsewhere: other blocks that it refers to, by id, in any dialect.

    In BML 1.0 a gaze has no `stroke_start`, and a synchronize has no `ref`: a missing point gets the name of another
    of the same instant, and if that is timed already, a constraint takes the place of the inline timing.
    """
    draft = replace(in_draft_spelling(block, block.dialect, elsewhere), dialect="draft")
    if dialect == "draft":
        return draft
    named = respelled(draft, _bml_1_0, elsewhere)
    ties = [tie for behavior in named.behaviors for tie in _ties(behavior)]
    behaviors = tuple(
        replace(behavior, timing=_inline(behavior)) if behavior.timing else behavior for behavior in named.behaviors
    )
    constraints = tuple(
        replace(constraint, operators=tuple(_without_ref(operator) for operator in constraint.operators))
        for constraint in named.constraints
    )
    return replace(named, behaviors=behaviors, constraints=(*constraints, *ties), dialect="bml-1.0")


def _bml_1_0(sync: str, type: str) -> str:
    if sync not in SYNC_POINTS or type == "speech":
        return sync
    return dialect_sync(same_instant(sync, type), type, "bml-1.0") or sync


def _inline(behavior: Behavior) -> tuple[Timing, ...]:
    """Timing that can stand in the behavior itself: each point once, marks last, in their written order."""
    once = {timing.sync: timing for timing in reversed(behavior.timing)}
    order = [mark.id for mark in behavior.marks] if isinstance(behavior, Speech) else []
    kept = (timing for timing in behavior.timing if once[timing.sync] is timing)
    return tuple(sorted(kept, key=lambda timing: order.index(timing.sync) if timing.sync in order else -1))


def _ties(behavior: Behavior) -> Iterator[Constraint]:
    """Constraints for the rest of the timing, of points that are timed twice under one name of BML 1.0."""
    inline = _inline(behavior)
    for timing in behavior.timing:
        if not any(timing is each for each in inline):
            here = str(SyncRef(behavior=behavior.id, sync=timing.sync))
            tie = Synchronize(syncs=(here, timing.ref), line=behavior.line)
            yield Constraint(operators=(tie,), required=behavior.required, line=behavior.line)


def _without_ref(operator: Operator) -> Operator:
    if isinstance(operator, Synchronize) and operator.ref:
        return replace(operator, ref="", syncs=(operator.ref, *operator.syncs))
    return operator

"""Points of each behavior, the seconds between them, and the parts that the behavior moves."""

from collections.abc import Mapping

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import BlockBehavior, Event, Gesture, Hand, Head, Pointing
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.relations import Relations
from engage_hri.services.realizer.points import ON_TARGET, Point, Segment, family, frozen, segments

ARMS: Mapping[Hand, tuple[str, ...]] = {
    "LEFT_HAND": ("left_arm",), "RIGHT_HAND": ("right_arm",), "BOTH_HANDS": ("left_arm", "right_arm"),
}  # fmt: skip
"""Parts of the body that are meant by each hand."""


class Chain(Struct, frozen=True):
    """A behavior with the seconds between its points.

    longest: of each segment; None: without limit. parts: those that it takes from a behavior that has them.
    """

    behavior: BlockBehavior
    type: str
    points: tuple[Point, ...]
    segments: tuple[Segment, ...]
    longest: tuple[Seconds | None, ...]
    parts: tuple[str, ...] = ()


RESERVE = 0.5
"""Share of its way to the stroke by which a movement sets out before it must: it may be slow, and words fast."""


def with_planned_hand(chain: Chain) -> BlockBehavior:
    """The behavior of a chain, with the hand that it is planned for: the body would choose anew as it begins."""
    behavior = chain.behavior
    if isinstance(behavior, Gesture | Pointing) and behavior.mode is None:
        arms = tuple(part for part in ARMS["BOTH_HANDS"] if part in chain.parts)
        hand = next((hand for hand, parts in ARMS.items() if tuple(parts) == arms), None)
        return behavior if hand is None else replace(behavior, mode=hand)
    return behavior


def chain(behavior: BlockBehavior, estimate: Estimate | None) -> Chain:
    """`behavior` as the body estimates it; nominal where it does not."""
    longest = {(phase.since, phase.to): phase.longest for phase in estimate.phases} if estimate else {}
    parts = segments(behavior, estimate)
    if isinstance(behavior, Head) and estimate is not None:
        parts = _stroke_by_stroke(parts, estimate)
    return Chain(
        behavior,
        type_name(behavior),
        tuple([Point(behavior.id, sync) for sync in ("start", *(part.to for part in parts))]),
        parts,
        tuple([longest.get((part.since, part.to)) for part in parts]) if longest else (None,) * len(parts),
        _parts(behavior, estimate),
    )


def _stroke_by_stroke(parts: tuple[Segment, ...], estimate: Estimate) -> tuple[Segment, ...]:
    """The phases with each repetition of a movement, if the body says that it will tell of them: `stroke:2` etc."""
    syncs = [phase.since for phase in estimate.phases]
    if "stroke" not in syncs or "stroke_end" not in syncs:
        return parts
    first, last = syncs.index("stroke"), syncs.index("stroke_end")
    strokes = [
        Segment(phase.since, phase.to, min(phase.shortest, phase.natural), phase.natural, phase.to == "stroke_end")
        for phase in estimate.phases[first:last]
    ]
    number = next(number for number, part in enumerate(parts) if part.since == "stroke")
    return (*parts[:number], *strokes, *parts[number + 1 :])


def _parts(behavior: BlockBehavior, estimate: Estimate | None) -> tuple[str, ...]:
    type = type_name(behavior)
    if not TYPES[type].takes_over:
        return ()
    if isinstance(behavior, Pointing | Gesture) and behavior.mode is not None:
        return ARMS[behavior.mode]
    parts = estimate.parts if estimate and estimate.parts else (family(type),)
    # A nod is on top of whatever else the head does.
    return tuple([f"nod of {part}" for part in parts]) if type == "head" else parts


def natural_ends(chains: Mapping[str, Chain], relations: Relations) -> frozenset[str]:
    """Behaviors that last until something takes their place or all ends: the block does not say when they end."""
    constrained = relations.constrained | relations.untied
    return frozen(
        id
        for id, each in chains.items()
        if each.type in ON_TARGET
        and not any(Point(id, sync) in constrained for sync in ("stroke_end", "relax", "end"))
    )


def unawaited_events(chains: Mapping[str, Chain], relations: Relations) -> frozenset[str]:
    """Events with a decision that nothing in the block waits for."""
    events = {id for id, each in chains.items() if isinstance(each.behavior, Event)}
    awaited = {point.behavior for point in relations.constrained if point.sync == "end"} if events else ()
    return frozenset(events.difference(awaited))

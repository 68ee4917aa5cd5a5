"""What the planner knows of each behavior: its points, the seconds between them, and the parts it moves."""

from collections.abc import Mapping

from msgspec import Struct

from schemas.behaviors import BlockBehavior, Gesture, Pointing
from schemas.body import Estimate
from schemas.units import Seconds
from services.realizer.points import ON_TARGET, Point, Segment, family, segments, sync_points, type_of
from services.realizer.relations import Relations

_ARMS = {"LEFT_HAND": ("left_arm",), "RIGHT_HAND": ("right_arm",), "BOTH_HANDS": ("left_arm", "right_arm")}
_HANDED_OVER = ON_TARGET | {"pointing", "gesture"}
"""Types that another behavior of the same part cuts short. A nod is on top of whatever the head does."""


class Chain(Struct, frozen=True):
    """A behavior with the seconds between its points.

    longest: of each segment; None: it can be stretched without limit. parts: what it takes from another that has it.
    """

    behavior: BlockBehavior
    type: str
    points: tuple[Point, ...]
    segments: tuple[Segment, ...]
    longest: tuple[Seconds | None, ...]
    parts: tuple[str, ...] = ()


def chain(behavior: BlockBehavior, estimate: Estimate | None) -> Chain:
    """`behavior` as the body estimates it; nominal where it does not."""
    longest = {(phase.since, phase.to): phase.longest for phase in estimate.phases} if estimate else {}
    parts = segments(behavior, estimate)
    return Chain(
        behavior,
        type_of(behavior),
        tuple([Point(behavior.id, sync) for sync in sync_points(behavior)]),
        parts,
        tuple([longest.get((part.since, part.to)) for part in parts]) if longest else (None,) * len(parts),
        _parts(behavior, estimate),
    )


def _parts(behavior: BlockBehavior, estimate: Estimate | None) -> tuple[str, ...]:
    if type_of(behavior) not in _HANDED_OVER:
        return ()
    if isinstance(behavior, Pointing | Gesture) and behavior.mode is not None:
        return _ARMS[behavior.mode]
    return estimate.parts if estimate and estimate.parts else (family(type_of(behavior)),)


def natural_ends(chains: Mapping[str, Chain], relations: Relations) -> frozenset[str]:
    """Behaviors that last until something else takes their place or all ends: nobody has said when they end."""
    named = relations.named
    return frozenset(
        id
        for id, each in chains.items()
        if each.type in ON_TARGET and not any(Point(id, sync) in named for sync in ("stroke_end", "relax", "end"))
    )

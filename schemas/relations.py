"""Relations of pieces that touch, from their poses: which piece is on which side of which other.

Pure. Two pieces touch where edges of theirs are parallel, of equal length and on one another, within a tolerance
(thesis Appendix A). Sides are named as the human sees them.
"""

from collections.abc import Iterable
from itertools import permutations

from msgspec import Struct

from engage_hri.schemas.footprints import Side, edges, touches
from engage_hri.schemas.world import Entity


class Relation(Struct, frozen=True):
    """`piece` touches the `side` of `landmark`."""

    piece: str
    side: Side
    landmark: str


def relation(piece: Entity, landmark: Entity) -> Relation | None:
    """The relation in which `piece` touches `landmark`; None if it does not."""
    for place in edges(landmark):
        if any(touches(edge, place) for edge in edges(piece)):
            return Relation(piece.id, place.side, landmark.id)
    return None


def relations(pieces: Iterable[Entity]) -> frozenset[Relation]:
    """Every relation among the pieces, both ways."""
    pairs = permutations(pieces, 2)
    return frozenset(found for piece, landmark in pairs if (found := relation(piece, landmark)) is not None)

"""The tangram task: what belongs where, what comes next, and whether it was done. Thesis 5.2.1.

Pure. The figure is known by its pieces' poses alone: which pieces touch is computed, for the figure and for the table
as it is. Pieces count as placed from the base outward: a piece beside a misplaced one does not.
"""

from collections.abc import Collection, Iterable

from msgspec import Struct

from engage_hri.schemas.tables import Relation, relation, relations
from engage_hri.schemas.world import Entity
from engage_hri.services.tangram.collaboration.pieces_in_view import TRUSTED
from engage_hri.services.tangram.table import TangramTable


class Instruction(Struct, frozen=True, kw_only=True):
    """A placement that the human is asked for.

    deictic: a word with which the piece may be pointed out instead of named. also: other relations that will do.
    """

    wanted: Relation
    deictic: str = ""
    also: tuple[Relation, ...] = ()


class Placement(Struct, frozen=True):
    """Result of an instruction. right: the piece lies as wanted. found: its relations to other pieces now.

    seen: the piece is in view; if not, `right` and `found` are from when it last was.
    """

    right: bool
    found: tuple[Relation, ...] = ()
    seen: bool = True


def check(instruction: Instruction, pieces: Iterable[Entity]) -> Placement:
    """Check whether the piece lies where it was to be laid."""
    lying = {piece.id: piece for piece in pieces}
    piece = lying.pop(instruction.wanted.piece, None)
    if piece is None:
        return Placement(False, seen=False)
    found = tuple(rel for other in lying.values() if (rel := relation(piece, other)) is not None)
    right = any(rel in found for rel in (instruction.wanted, *instruction.also))
    return Placement(right, found, seen=piece.confidence >= TRUSTED)


class Goal:
    """The figure to be made."""

    def __init__(self, table: TangramTable) -> None:
        self.base = table.base
        self.order = tuple(piece.id for piece in table.pieces)
        self.relations = relations(table.figure())

    def placed(self, pieces: Iterable[Entity]) -> frozenset[str]:
        """The pieces that are where they belong, the base included."""
        held = self.relations & relations(pieces)
        placed = {self.base}
        while grown := {rel.piece for rel in held if rel.landmark in placed} - placed:
            placed |= grown
        return frozenset(placed)

    def next(self, pieces: Collection[Entity], given_up: Collection[str] = ()) -> Instruction | None:
        """The next piece to ask for, beside one that is placed; None when none is left that could be asked for.

        Pieces nearest the base come first, then the order of the table's file. given_up: not to be asked for.
        """
        placed, steps = self.placed(pieces), self._steps_from_base()
        done = placed.union(given_up)
        candidates = [rel for rel in self.relations if rel.landmark in placed and rel.piece not in done]

        def rank(rel: Relation) -> tuple[int, int, int]:
            return (steps[rel.piece], self.order.index(rel.piece), self.order.index(rel.landmark))

        return Instruction(wanted=min(candidates, key=rank)) if candidates else None

    def _steps_from_base(self) -> dict[str, int]:
        steps = {self.base: 0}
        while next_to := {rel.piece for rel in self.relations if rel.landmark in steps} - steps.keys():
            steps |= dict.fromkeys(next_to, max(steps.values()) + 1)
        return steps

"""The tangram on the table: its pieces, where they lie, and the figure they make.

Simulation and the collaboration manager both read `table.toml` through this file, so that there is one table.
"""

from functools import cache
from pathlib import Path

import msgspec
from msgspec import Struct

from engage_hri.schemas.tables import Form, PiecePose, TableTop, TaskTable
from engage_hri.schemas.units import Vector
from engage_hri.schemas.world import Entity


class Piece(Form, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A piece. start: its pose when the human comes. goal: in the finished figure."""

    goal: PiecePose


class TablePerson(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    id: str
    face: Vector
    left_hand: Vector
    right_hand: Vector


class Surface(TableTop, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The table top. free: where nothing is ever laid; people who look at the table and at no piece look there."""

    free: Vector


class TangramTable(TaskTable, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The table with all its pieces. base: the piece that is never moved; the figure grows around it."""

    base: str
    surface: Surface
    person: TablePerson
    pieces: tuple[Piece, ...]

    def piece(self, id: str) -> Piece:
        """Find a piece. Raises KeyError if there is none with that id."""
        return {piece.id: piece for piece in self.pieces}[id]

    def figure(self) -> tuple[Entity, ...]:
        """Every piece at its place in the finished figure."""
        return tuple(self.lying(piece, piece.goal) for piece in self.pieces)


@cache
def tangram_table() -> TangramTable:
    """The table of the study, from the file beside this one."""
    source = Path(__file__).with_suffix(".toml").read_bytes()
    return msgspec.toml.decode(source, type=TangramTable)

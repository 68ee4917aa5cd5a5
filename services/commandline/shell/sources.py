"""Reading of the files on the command line: fragments, blocks, worlds. All are checked before anything moves."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import msgspec
from msgspec import Struct

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents import json_codec
from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.references import is_id
from engage_hri.schemas.world import World
from engage_hri.services.runtime.service import Service

Thing = Block | TurnFragment
STDIN = Path("-")
"""Stands for standard input."""
NAME_OF_STDIN = Path("standard input")


class InputFile(Struct, frozen=True, kw_only=True):
    """A file with its blocks and fragments, in order."""

    path: Path
    things: tuple[Thing, ...]

    @contextmanager
    def naming_file(self) -> Iterator[None]:
        """Add this file to the place of each InputRefused in the body of `with`, but for those of the robot."""
        try:
            yield
        except InputRefused as error:
            fault = error.fault
            if fault.service != "control" and not fault.where.startswith(str(self.path)):
                where = ": ".join(part for part in (str(self.path), fault.where) if part)
                fault = msgspec.structs.replace(fault, where=where)
            raise InputRefused(fault) from error


def read_source(path: Path) -> InputFile:
    """Read a file; `-` is standard input. Raises InputRefused with file, line or JSON path, and the reason."""
    data, path = _bytes(path), NAME_OF_STDIN if path == STDIN else path
    unnamed = path.stem if is_id(path.stem) else json_codec.UNNAMED
    things = json_codec.read(data, str(path), unnamed)
    if not things:
        raise InputRefused(Fault(reason="holds nothing to perform", where=str(path)))
    return InputFile(path=path, things=things)


def read_world(path: Path | None) -> World:
    """Read a world from a JSON file; a table with ten pieces without one. Raises InputRefused with the JSON path.

    A file without people gets the person of that table, so that there is somebody to speak to.
    """
    from engage_hri.services.simulation.still import load_world, table_world

    if path is None:
        return table_world()
    world = load_world(path)
    return world if world.people else World(entities=(*world.entities, *table_world().people))


def still(world: World, *, is_attentive: bool = False) -> Service:
    """Perception of a world in which nothing moves by itself. is_attentive: its person reacts to the robot."""
    from engage_hri.services.simulation.still import show_world

    return partial(show_world, world=world, is_attentive=is_attentive)


def _bytes(path: Path) -> bytes:
    with raised_as(InputRefused, OSError, path, advice="check the path"):
        if path != STDIN:
            return path.read_bytes()
        return b"" if sys.stdin is None else sys.stdin.buffer.read()

"""Reading the files people name: fragments, blocks, worlds. Everything is read and checked before anything moves."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import msgspec
from msgspec import Struct

from schemas import json_codec
from schemas.blocks import Block
from schemas.faults import Fault, InputRefused
from schemas.fragments import TurnFragment
from schemas.world import Entity, World
from services.runtime import Service

Thing = Block | TurnFragment


class Source(Struct, frozen=True, kw_only=True):
    """A file and what it holds, in order."""

    path: Path
    things: tuple[Thing, ...]

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """A refusal inside the body of `with` names this file."""
        try:
            yield
        except InputRefused as error:
            fault = error.fault
            if not fault.where.startswith(str(self.path)):
                where = ": ".join(part for part in (str(self.path), fault.where) if part)
                fault = msgspec.structs.replace(fault, where=where)
            raise InputRefused(fault) from error


def read_source(path: Path) -> Source:
    """Raises InputRefused with the file, the line or JSON path, and the reason."""
    things = json_codec.read(_bytes(path), str(path))
    if not things:
        raise InputRefused(Fault(reason="holds nothing to perform", where=str(path)))
    return Source(path=path, things=things)


class _World(Struct, frozen=True, forbid_unknown_fields=True):
    entities: tuple[Entity, ...]


def read_world(path: Path | None) -> World:
    """The entities of a JSON file; the tangram table without one. Raises InputRefused with the JSON path."""
    if path is None:
        from services.simulation.still import tangram_world

        return tangram_world()
    try:
        entities = msgspec.json.decode(_bytes(path), type=_World).entities
    except (msgspec.DecodeError, RecursionError) as error:
        advice = '{"entities": [{"id": "cup", "kind": "object", "position": [0.5, 0.1, 0.8]}]}'
        raise InputRefused(Fault(reason=str(error), where=str(path), advice=advice)) from error
    seen: set[str] = set()
    for entity in entities:
        if not entity.id or entity.id in seen:
            reason = f"duplicate entity id {entity.id!r}" if entity.id else "an entity without an id"
            raise InputRefused(Fault(reason=reason, where=str(path), advice="give each entity its own id"))
        seen.add(entity.id)
    return World(entities=entities)


def _bytes(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputRefused(Fault(reason=error.strerror or str(error), where=str(path))) from error


def still(world: World) -> Service:
    """Perception for a world in which nothing moves by itself."""
    from services.simulation.still import stand_still

    return partial(stand_still, world=world)

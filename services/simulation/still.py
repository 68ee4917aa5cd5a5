"""A world in which nothing happens: from a file, or the tangram table with a person who just sits there."""

import asyncio
from pathlib import Path
from typing import Literal

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActorFound
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import FARTHEST, Stamp
from engage_hri.schemas.utf8 import utf8
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.runtime.service import Ready
from engage_hri.services.simulation.config import SimulationConfig
from engage_hri.services.simulation.table import Table
from engage_hri.services.tangram.table import tangram_table

EXAMPLE = '{"entities": [{"id": "cup", "kind": "object", "position": [0.5, 0.1, 0.8], "category": "cup"}]}'
ADVICE = f"for example {EXAMPLE}; places are in metres, at most {FARTHEST:.0e}"


class _File(Struct, frozen=True, forbid_unknown_fields=True):
    """As a `World` on the bus, so that one from there can be kept in a file."""

    entities: tuple[Entity, ...]
    type: Literal["world"] = "world"
    at: Stamp | None = None


async def show_world(bus: Bus, ready: Ready, world: World) -> None:
    """Be perception in a world that never changes, until cancelled. Its people are found at once."""
    ready()
    bus.publish(keys.WORLD, msgspec.structs.replace(world, at=bus.stamp()))
    for person in world.people:
        bus.publish(keys.PERCEIVED_ACTION, ActorFound(actor=person.id, at=bus.stamp()))
    await asyncio.get_running_loop().create_future()


def tangram_world() -> World:
    """The tangram table as it is at the start, with the person before it."""
    defaults = SimulationConfig()
    table = Table(tangram_table(), hand_speed=defaults.hand_speed, shortest_movement=defaults.shortest_movement)
    table.seated = True
    return World(entities=table.entities(0.0))


def load_world(path: Path) -> World:
    """The world in a JSON file. Raises InputRefused with the file, the JSON path and the reason."""
    try:
        entities = msgspec.json.decode(utf8(path.read_bytes(), str(path)), type=_File).entities
    except OSError as error:
        raise InputRefused(Fault(reason=error.strerror or str(error), where=str(path))) from error
    except (msgspec.DecodeError, RecursionError) as error:
        raise InputRefused(Fault(reason=str(error), where=str(path), advice=ADVICE)) from error
    seen: dict[str, int] = {}
    for index, entity in enumerate(entities):
        where = f"{path}: $.entities[{index}].id"
        if entity.kind == "person" and (not keys.is_chunk(entity.id) or entity.id == "all"):
            advice = f"a person's id has {keys.CHUNK}, and is not 'all'"
            raise InputRefused(Fault(reason=f"{entity.id!r} can't be a person's id", where=where, advice=advice))
        if entity.id in seen:
            reason = f"duplicate id {entity.id!r}, of $.entities[{seen[entity.id]}] already"
            raise InputRefused(Fault(reason=reason, where=where, advice="give each entity its own id"))
        seen[entity.id] = index
    return World(entities=entities)

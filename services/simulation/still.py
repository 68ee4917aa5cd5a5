"""A world in which nothing moves, as from a file. Its people sit there, and one may attend."""

from functools import cache
from pathlib import Path
from typing import Literal

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.schemas.perception import ActorFound, Utterance
from engage_hri.schemas.text import utf8
from engage_hri.schemas.units import FARTHEST, Stamp
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.people.perceived_person import PerceivedActions
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.runtime.service import Ready
from engage_hri.services.simulation.company import AttentiveHuman, Company
from engage_hri.services.simulation.human import FACE, Human, LookAt

EXAMPLE = '{"entities": [{"id": "cup", "kind": "object", "position": [0.5, 0.1, 0.8], "category": "cup"}]}'
ADVICE = f"for example {EXAMPLE}; places are in metres, at most {FARTHEST:.0e}"


class _File(Struct, frozen=True, forbid_unknown_fields=True):
    """Content of a world file: the fields of a `World` on the bus, so that one from there can be kept in a file."""

    entities: tuple[Entity, ...]
    type: Literal["world"] = "world"
    at: Stamp | None = None


async def show_world(bus: Bus, ready: Ready, world: World, *, is_attentive: bool = False) -> None:
    """Publish a world in which nothing moves, as perception would, until cancelled. Its people are found at once.

    is_attentive: the first person follows the robot's gaze and answers it; else all just sit there.
    """
    humans: dict[str, Human] = {}
    if is_attentive and world.people:
        person = world.people[0].id
        humans[person] = AttentiveHuman(person, frozenset(each.id for each in world.objects), bus.robot)
        humans[person].schedule((LookAt(FACE),), bus.now())
    await show_company(bus, ready, world, Company(humans, bus.robot, bus.run) if humans else None)


async def show_company(bus: Bus, ready: Ready, world: World, company: Company | None) -> None:
    """Publish such a world and what its people do, until cancelled. company: None: they just sit there."""
    patterns = (keys.ROBOT_ACTION, keys.SYNC_POINT, keys.FEEDBACK, keys.BODY_FAULTS) if company else ()
    with bus.subscribe(*patterns, keys.WORLD, keys.ANY_ROBOT_ALIVE) as inbox:
        ready()
        shared = SharedWorld(bus.name)

        def tell_world() -> None:
            bus.publish(keys.WORLD, World(entities=shared.tell(world.entities, bus.now()), at=bus.stamp()))

        tell_world()
        perceived = PerceivedActions(bus)
        perceived.tell(*(ActorFound(actor=person.id, at=bus.stamp()) for person in world.people))
        company = company or Company({}, bus.robot)
        while not inbox.is_over:
            due = [at for at in (company.deadline, shared.deadline) if at is not None]
            received = await inbox.next(min(due, default=None))
            now = bus.now()
            message, source = (received.message, received.source) if received else (None, "")
            if shared.take(message, source, now):
                tell_world()
            if received is not None:
                company.feed(received.message, now)
            for told in company.advance(bus.now(), bus.stamp()):
                if isinstance(told, Utterance):
                    bus.publish(keys.UTTERANCE, told)
                else:
                    perceived.tell(told)


@cache
def table_world() -> World:
    """The world where no other is given: a table with ten pieces, and a person who sits at it."""
    return load_world(Path(__file__).with_name("table.json"))


def load_world(path: Path) -> World:
    """The world in a JSON file. Raises InputRefused with the file, the JSON path and the reason."""
    with raised_as(InputRefused, OSError, path):
        text = utf8(path.read_bytes(), str(path))
    with raised_as(InputRefused, (msgspec.DecodeError, RecursionError), path, advice=ADVICE):
        entities = msgspec.json.decode(text, type=_File).entities
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

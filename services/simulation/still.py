"""A world in which nothing moves: from a file, or the tangram table. Its people sit there, and one may attend."""

import asyncio
from collections.abc import Iterator
from pathlib import Path
from typing import Literal

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.actions import ActionBegan, ActionEnded, ActorFound
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.units import FARTHEST, Stamp
from engage_hri.schemas.utf8 import utf8
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.perceived_actions import PerceivedActions
from engage_hri.services.runtime.service import Ready
from engage_hri.services.simulation.attentive import AttentiveHuman
from engage_hri.services.simulation.config import SimulationConfig
from engage_hri.services.simulation.hearing import Ears
from engage_hri.services.simulation.human import FACE, Act, LookAt, Pause, Start, Stop
from engage_hri.services.simulation.table import Table
from engage_hri.services.tangram.table import tangram_table

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
    with bus.subscribe(keys.ROBOT_ACTION, keys.SYNC_POINT, keys.FEEDBACK, keys.BODY_FAULTS) as inbox:
        ready()
        bus.publish(keys.WORLD, msgspec.structs.replace(world, at=bus.stamp()))
        perceived = PerceivedActions(bus)
        perceived.tell(*(ActorFound(actor=person.id, at=bus.stamp()) for person in world.people))
        if not (is_attentive and world.people):
            await asyncio.get_running_loop().create_future()
        sees = frozenset(entity.id for entity in world.objects)
        human = AttentiveHuman(world.people[0].id, sees, bus.robot)
        body, ears = Bystander(world.people[0].id, bus.robot), Ears()
        human.schedule((LookAt(FACE),), bus.now())
        while not inbox.is_over:
            received = await inbox.next(human.deadline)
            if received is not None and ears.hear(received.message):
                human.feed(received.message, bus.now())
            while acts := human.due(bus.now()):
                perceived.tell(*body.does(acts[0], bus.stamp()))
                human.schedule(acts[1:], bus.now() + (acts[0].seconds if isinstance(acts[0], Pause) else 0.0))


class Bystander:
    """Actions of a person who looks, gestures and speaks, and moves nothing. Pure."""

    def __init__(self, person: str, robot: str) -> None:
        self._person = person
        self._robot = robot
        self._look: tuple[str, ...] | None = None

    def does(self, act: Act, at: Stamp) -> Iterator[ActionBegan | ActionEnded]:
        match act:
            case LookAt(target=target):
                look = (self._robot if target == FACE else target,) if target else ()
                if look == self._look:
                    return
                if self._look is not None:
                    yield ActionEnded(actor=self._person, action="look", targets=self._look, at=at)
                self._look = look
                yield ActionBegan(actor=self._person, action="look", targets=look, at=at)
            case Start(action=action, target=target) | Stop(action=action, target=target):
                kind = ActionBegan if isinstance(act, Start) else ActionEnded
                yield kind(actor=self._person, action=action, targets=(target,) if target else (), at=at)


def tangram_world() -> World:
    """The tangram table as it is at the start, with the person sitting at it."""
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

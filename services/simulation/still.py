"""A world in which nothing moves, as from a file. Its people sit there, and one may attend."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Literal

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.perception import ActorFound, Utterance
from engage_hri.schemas.text import utf8
from engage_hri.schemas.units import FARTHEST, Stamp
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.client.people.actions import PersonActions
from engage_hri.services.client.people.perceived_person import PerceivedActions
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.reports.ongoing_actions import ActionEvent
from engage_hri.services.runtime.service import Ready
from engage_hri.services.simulation.human import FACE, Act, Human, LookAt, Pause, Start, Stop
from engage_hri.services.simulation.listening import AttentiveHuman
from engage_hri.services.simulation.speech import Ears, SpokenWords

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
    patterns = (keys.ROBOT_ACTION, keys.SYNC_POINT, keys.FEEDBACK, keys.BODY_FAULTS) if is_attentive else ()
    with bus.subscribe(*patterns, keys.WORLD, keys.ANY_ROBOT_ALIVE) as inbox:
        ready()
        shared = SharedWorld(bus.name)

        def tell_world() -> None:
            bus.publish(keys.WORLD, World(entities=shared.tell(world.entities, bus.now()), at=bus.stamp()))

        tell_world()
        perceived = PerceivedActions(bus)
        perceived.tell(*(ActorFound(actor=person.id, at=bus.stamp()) for person in world.people))
        human = Human(())
        ears = Ears()
        if is_attentive and world.people:
            human = AttentiveHuman(world.people[0].id, frozenset(each.id for each in world.objects), bus.robot)
            human.schedule((LookAt(FACE),), bus.now())
            body = Bystander(world.people[0].id, bus.robot, bus.run)
        while not inbox.is_over:
            due = [at for at in (human.deadline, shared.deadline) if at is not None]
            received = await inbox.next(min(due, default=None))
            now = bus.now()
            message, source = (received.message, received.source) if received else (None, "")
            if shared.take(message, source, now):
                tell_world()
            if received is not None and ears.hear(received.message):
                human.feed(received.message, now)
            while acts := human.due(bus.now()):
                for told in body.does(acts[0], bus.stamp()):
                    if isinstance(told, Utterance):
                        bus.publish(keys.UTTERANCE, told)
                    else:
                        perceived.tell(told)
                human.schedule(acts[1:], bus.now() + (acts[0].seconds if isinstance(acts[0], Pause) else 0.0))


class Bystander:
    """Actions and words of a person who looks, gestures and speaks, and moves nothing. Pure.

    life: of the program that tells of the person.
    """

    def __init__(self, person: str, robot: str, life: str = "") -> None:
        self._robot = robot
        self._actions = PersonActions(person)
        self._actions.is_here = True
        self._words = SpokenWords(person, life)

    def does(self, act: Act, at: Stamp) -> Iterator[ActionEvent | Utterance]:
        yield from self._words.does(act, at)
        match act:
            case LookAt(target=target):
                yield from self._actions.looks((self._robot if target == FACE else target,) if target else (), at)
            case Start(action=action, target=target):
                yield from self._actions.begins(action, (target,) if target else (), at)
            case Stop(action=action, target=target):
                yield from self._actions.ends(action, (target,) if target else (), at)


@cache
def table_world() -> World:
    """The world where no other is given: a table with ten pieces, and a person who sits at it."""
    return load_world(Path(__file__).with_name("table.json"))


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

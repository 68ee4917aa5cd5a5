"""One id for each person, for all who read what perception tells. Pure.

Recognition finds out which ids are one person, and tells it (`SamePeople`). Who reads the world or the actions of
people gives each message the names as it comes in, so that nobody is there twice:

    names = PeopleNames()
    names.take(message)                  # any message; True: people have other names from now on
    message = names.named(message)       # its ids of people are their names
"""

from collections.abc import Callable
from typing import TypeVar

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.perception import ActorFound
from engage_hri.schemas.recognition import SamePeople
from engage_hri.schemas.world import Entity, World

_IDS = frozenset({
    "actor", "initiator", "responder", "answered_by", "target", "targets", "to", "owner", "addressee", "others",
    "interruptible", "looking_at", "delay_target",
})  # fmt: skip
"""Fields with ids of people, or of things, which have one id each."""
AnyStruct = TypeVar("AnyStruct", bound=Struct)


class PeopleNames:
    """The names of people who have several ids."""

    def __init__(self) -> None:
        self._names: dict[str, str] = {}

    def take(self, message: object) -> bool:
        """Take any message. True: people have other names from now on."""
        if not isinstance(message, SamePeople):
            return False
        before, self._names = self._names, {each.actor: each.name for each in message.people}
        return self._names != before

    def parted(self, message: SamePeople) -> list[tuple[str, str]]:
        """List who is somebody else by this message: their id, and the name that they had by mistake."""
        names = {each.actor: each.name for each in message.people}
        return [(id, name) for id, name in self._names.items() if names.get(id, id) != names.get(name, name)]

    def name(self, id: str) -> str:
        """Return the name of the person with this id; of a thing its id."""
        return self._names.get(id, id)

    def named(self, message: AnyStruct) -> AnyStruct:
        """Return a message with the names of people in place of their other ids; nobody is in a world twice."""
        return renamed(message, self.name) if self._names else message

    def by_any_id(self, world: World) -> World:
        """Return a world that has each person by all ids, for who looks up those at whom the robot is to look."""
        named, known = self.named(world), {entity.id for entity in world.entities}
        ids = {**self._names, **{name: name for name in self._names.values()}}
        people = {person.id: person for person in named.people}
        more = [replace(people[ids[id]], id=id) for id in ids.keys() - known if ids[id] in people]
        return replace(world, entities=(*world.entities, *more)) if more else world


def renamed(message: AnyStruct, name: Callable[[str], str]) -> AnyStruct:
    """Return the message with other ids of people. name: the new one of each.

    Of a world with several entities that get one id the one that had another before is left: it was found later.
    """
    changes: dict[str, object] = {}
    is_person = isinstance(message, Entity) and message.kind == "person"
    for field in message.__struct_fields__:
        held = getattr(message, field)
        new = _renamed(held, name, is_id=field in _IDS or (is_person and field == "id"))
        if new is not held:
            changes[field] = new
    if not changes:
        return message
    if isinstance(message, ActorFound):
        changes["same_as"] = ""  # that was said of the other id
    changed = replace(message, **changes)
    if isinstance(message, World) and isinstance(changed, World):
        return replace(changed, entities=_one_each(message, changed))
    return changed


def joined(message: AnyStruct, other: str, name: str) -> AnyStruct:
    """Return the message with `name` in place of another id of the same person."""
    return renamed(message, lambda id: name if id == other else id)


def _one_each(before: World, after: World) -> tuple[Entity, ...]:
    latest: dict[str, Entity] = {}
    for was, entity in zip(before.entities, after.entities, strict=True):
        if entity.id not in latest or was.id != entity.id:
            latest[entity.id] = entity
    return tuple(latest.values())


def _renamed(held: object, name: Callable[[str], str], *, is_id: bool) -> object:
    match held:
        case str() if is_id:
            return name(held)
        case Struct():
            return renamed(held, name)
        case tuple() | frozenset() if held and not hasattr(held, "_fields"):
            new = [_renamed(each, name, is_id=is_id) for each in held]
            is_same = all(one is other for one, other in zip(new, held, strict=True))
            return held if is_same else type(held)(new)
    return held

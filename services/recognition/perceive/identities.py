"""Ids of people: several that trackers of faces give to one person, and the one by which events tell of them. Pure.

    for join in identities.take(message, at): ...        # two ids have turned out to be one person
    message = identities.inward(message)                 # its ids are those by which recognition knows people
    event = identities.outward(event)                    # its ids are those by which people are told of

Recognition knows a person by one id for as long as it remembers them; nothing within is ever renamed. Messages get
that id as they come in, and what is told gets the person's name as it goes out. So an event that is open when
`face_3` turns out to be `ann` goes on as it is, and is told as ann's from then on.

Two ids are one person if perception says so (`ActorFound.same_as`), or if the second is first seen where the first
was lost. That is a guess, and ends as soon as both are seen in turn.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeVar

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.perception import ActorFound, ActorLost, HeadPose
from engage_hri.schemas.units import Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.reports.action_reports import FACE_GRACE

SAME_PLACE = 0.3
"""Metres between the place where a person was lost and that where another id is found. Ours."""
PLACED_WITHIN: Seconds = 0.5
"""Time from the first sign of a new id until its place counts no more: it was found somewhere. Ours."""
IDS_KEPT = 256
"""Number of ids that are remembered as another of somebody, and of those of whom it is known where they were."""
_IDS = frozenset({"actor", "initiator", "responder", "answered_by", "target", "targets", "to", "owner"})
"""Fields with ids of people, or of things, which are never joined."""
AnyStruct = TypeVar("AnyStruct", bound=Struct)


class Join(NamedTuple):
    """Two ids, as recognition knows people, are one person. name: by which this person is told of from now on.

    They are the same id if only the name is new.
    """

    newer: str
    former: str
    name: str


class _Sighting(Struct):
    """Last sign of an id. since: time of the first one. lost: when the id was lost; None: it is there.

    reported: a loss would be told, by `ActorLost` or by a world without it. Else silence may be one.
    """

    since: Seconds
    at: Seconds
    place: Vector | None = None
    lost: Seconds | None = None
    found: bool = False
    in_world: bool = False

    def lost_at(self, now: Seconds) -> Seconds | None:
        """Time at which it was lost, as far as can be known at `now`."""
        is_silent = not self.found and not self.in_world and self.at < now
        return self.at if self.lost is None and is_silent else self.lost


class Identities:
    """The ids of all people around `robot`."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._inside: dict[str, str] = {}
        """The id by which recognition knows a person, by each other id of this person. The longest known first."""
        self._names: dict[str, str] = {}
        """The id by which a person is told of, where recognition knows them by another."""
        self._guessed: set[str] = set()
        """Ids that were joined by their place."""
        self._apart: Latest[str, None] = Latest(IDS_KEPT)
        """Ids that were joined so by mistake."""
        self._seen: Latest[str, _Sighting] = Latest(IDS_KEPT)

    def inside(self, id: str) -> str:
        """Return the id by which recognition knows a person. id: as perception tells it, or as it was told."""
        return self._inside.get(id, id)

    def name(self, id: str) -> str:
        """Return the id by which a person is told of. id: by which recognition knows them."""
        return self._names.get(id, id)

    def inward(self, message: AnyStruct) -> AnyStruct:
        return renamed(message, self.inside) if self._inside else message

    def outward(self, message: AnyStruct) -> AnyStruct:
        return renamed(message, self.name) if self._names else message

    def join(self, kept: str, other: str, name: str) -> None:
        """Take two ids by which recognition knows people for one. kept: the one by which it goes on to do so."""
        for id, inside in tuple(self._inside.items()):
            if inside == other:
                self._inside[id] = kept
        self._inside |= {id: kept for id in (other, name) if id != kept}
        self._inside.pop(kept, None)
        self._names |= {kept: name, other: name}
        oldest = [id for id, inside in self._inside.items() if self.name(inside) != id]
        for id in oldest[: max(0, len(self._inside) - IDS_KEPT)]:
            self._drop(id)

    def is_other(self, id: str) -> bool:
        """True of an id by which recognition knew somebody whom it knows by another now."""
        return id in self._inside

    def forget(self, id: str) -> None:
        """Forget all ids of a person. id: by which recognition knew them."""
        if id in self._inside:
            return  # the person is known by another
        for each in [each for each, inside in self._inside.items() if inside == id]:
            self._drop(each)
        self._names.pop(id, None)
        self._guessed.discard(id)

    def _drop(self, id: str) -> None:
        del self._inside[id]
        self._names.pop(id, None)
        self._guessed.discard(id)

    # -- what perception tells ----------------------------------------------------------------------------------

    def take(self, message: object, at: Seconds) -> list[Join]:
        """Take a message as it came, of what was seen at `at`. Returns which ids are one person by it."""
        match message:
            case ActorFound(actor=actor, same_as=former):
                self._see(actor, at).found = True
                return self._told(actor, former) if former else []
            case ActorLost(actor=actor) if actor in self._seen:
                self._seen[actor].lost, self._seen[actor].found = at, False
            case HeadPose(actor=actor, position=place):
                return self._place(actor, place, at)
            case World(people=people):
                there = {person.id for person in people}
                for id, seen in self._seen.items():
                    if seen.in_world and id not in there:
                        seen.in_world = False
                        seen.lost = at if seen.lost is None and not seen.found else seen.lost
                joins = [join for person in people for join in self._place(person.id, person.position, at)]
                for id in there & self._seen.keys():
                    self._seen[id].in_world = True
                return joins
        return []

    def _told(self, actor: str, former: str) -> list[Join]:
        newer, known = self.inside(actor), self.inside(former)
        self._guessed -= {actor, former}
        name = former if newer == known else self.name(known)
        return [] if newer == known and self.name(known) == name else [Join(newer, known, name)]

    def _see(self, id: str, at: Seconds) -> _Sighting:
        """Take a sign of an id."""
        seen = self._seen.get(id)
        if seen is None:
            self._seen[id] = seen = _Sighting(at, at)
            return seen
        is_guess = id in self._guessed and id in self._inside
        former = self._seen.get(self.inside(id)) if is_guess else None
        if former is not None and former.lost is None and seen.lost is None and former.at >= seen.at:
            self._apart[id] = None  # both are there
            self._drop(id)
        self._seen[id] = seen  # the latest
        seen.at, seen.lost = max(at, seen.at), None
        return seen

    def _place(self, id: str, place: Vector, at: Seconds) -> list[Join]:
        """Take where an id is. Returns whose it is, too, if it is new."""
        if id == self._robot:
            return []
        seen = self._see(id, at)
        is_new, seen.place = seen.place is None and at <= seen.since + PLACED_WITHIN, place
        if not is_new or id in self._inside or id in self._names or id in self._apart:
            return []
        lost = [
            other for other, one in self._seen.items() if other != id and self._is_lost_at(one, place, seen.since)
        ]
        known = {self.inside(other) for other in lost} - {id}
        if len(known) != 1:
            return []
        former = known.pop()
        self._guessed.add(id)
        return [Join(id, former, self.name(former))]

    def _is_lost_at(self, one: _Sighting, place: Vector, at: Seconds) -> bool:
        """True if this one was lost by `at`, not long before, and near this place."""
        lost = one.lost_at(at)
        is_recent = lost is not None and lost <= at < lost + FACE_GRACE
        return is_recent and one.place is not None and math.dist(one.place, place) <= SAME_PLACE


def renamed(message: AnyStruct, name: Callable[[str], str]) -> AnyStruct:
    """Return the message with other ids of people. name: the new one of each."""
    changes: dict[str, object] = {}
    is_person = isinstance(message, Entity) and message.kind == "person"
    for field in message.__struct_fields__:
        held = getattr(message, field)
        new = _renamed(held, name, is_id=field in _IDS or (is_person and field == "id"))
        if new is not held:
            changes[field] = new
    return replace(message, **changes) if changes else message


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

"""Ids of people: several that trackers of faces give to one person, and the one by which events tell of them. Pure.

    for join in identities.take(message, at): ...        # two ids have turned out to be one person
    message = identities.inward(message)                 # its ids are those by which recognition knows people
    event = identities.outward(event)                    # its ids are those by which people are told of

Recognition knows a person by one id for as long as it remembers them; nothing within is ever renamed. Messages get
that id as they come in, and what is told gets the person's name as it goes out. So an event that is open when
`face_3` turns out to be `ann` goes on as it is, and is told as ann's from then on.

Two ids are one person if perception says so (`ActorFound.same_as`), or if the second is first seen where the first
was lost. That is a guess, and ends as soon as both are seen. Each id is another of one at most: what perception says
later of it corrects what it said, or what was guessed. From then on the two are two people again, each by its own id.
"""

import math
from typing import NamedTuple

from msgspec import Struct

from engage_hri.schemas.perception import ActorFound, ActorLost, HeadPose
from engage_hri.schemas.recognition import SamePerson
from engage_hri.schemas.units import Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.reports.action_reports import FACE_GRACE
from engage_hri.services.reports.same_people import AnyStruct, renamed

SAME_PLACE = 0.3
"""Metres between the place where a person was lost and that where another id is found. Ours."""
PLACED_WITHIN: Seconds = 0.5
"""Time from the first sign of a new id until its place counts no more: it was found somewhere. Ours."""
IDS_KEPT = 256
"""Number of ids that are remembered as another of somebody, and of those of whom it is known where they were."""


class Join(NamedTuple):
    """Two ids, as recognition knows people, are one person. name: by which this person is told of from now on.

    They are the same id if only the name is new.
    """

    newer: str
    former: str
    name: str
    before: str
    """The id by which the person of the newer id was told of until now."""


class Parting(NamedTuple):
    """An id that was taken for somebody else's is of a person of its own. name: by which it was told of.

    leaving: the ids of those of the two whom recognition knows by another id from now on: by `new` instead of `old`.
    """

    id: str
    name: str
    leaving: frozenset[str]
    old: str
    new: str


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
        self._same: dict[str, str] = {}
        """The id of the same person of which each was said, or guessed, to be another; never in a circle."""
        self._guessed: dict[str, frozenset[str]] = {}
        """Ids that were joined by their place, each with those that the person had before."""
        self._apart: Latest[str, None] = Latest(IDS_KEPT)
        """Ids that were joined by mistake."""
        self._seen: Latest[str, _Sighting] = Latest(IDS_KEPT)
        self.things: frozenset[str] = frozenset()
        """Ids of what is in the world and no person."""

    def inside(self, id: str) -> str:
        """Return the id by which recognition knows a person. id: as perception tells it, or as it was told."""
        return self._inside.get(id, id)

    def name(self, id: str) -> str:
        """Return the id by which a person is told of. id: any of theirs."""
        while id in self._same:
            id = self._same[id]
        return id

    def inward(self, message: AnyStruct) -> AnyStruct:
        return renamed(message, self.inside) if self._inside else message

    def outward(self, message: AnyStruct) -> AnyStruct:
        return renamed(message, self.name) if self._same else message

    def join(self, kept: str, other: str) -> None:
        """Take two ids by which recognition knows people for one. kept: the one by which it goes on to do so."""
        for id in self._all(other) - {kept}:
            self._inside[id] = kept
        self._inside.pop(kept, None)
        oldest = [id for id in self._same if id in self._inside]
        for id in oldest[: max(0, len(self._inside) - IDS_KEPT)]:
            former = self._same[id]
            self._same |= {later: former for later, one in self._same.items() if one == id}
            self._drop(id)

    def others(self) -> tuple[SamePerson, ...]:
        """All ids by which people are not told of."""
        return tuple(SamePerson(actor=id, name=self.name(id), is_guess=id in self._guessed) for id in self._same)

    def resume(self, people: tuple[SamePerson, ...]) -> None:
        """Go on with the ids that a former life has told of."""
        for actor, name, is_guess in ((each.actor, each.name, each.is_guess) for each in people):
            if is_guess:
                self._guessed[actor] = self._all(name)
            self._same[actor] = name
            self.join(name, actor)

    def _all(self, inside: str) -> frozenset[str]:
        """All ids of a person."""
        return frozenset({inside, *(id for id, at in self._inside.items() if at == inside)})

    def is_other(self, id: str) -> bool:
        """True of an id by which recognition knew somebody whom it knows by another now."""
        return id in self._inside

    def forget(self, id: str) -> bool:
        """Forget all ids of a person; True if there were several. id: by which recognition knew them."""
        if id in self._inside:
            return False  # the person is known by another
        ids = self._all(id)
        for each in ids:
            self._drop(each)
        return len(ids) > 1

    def _drop(self, id: str) -> None:
        self._inside.pop(id, None)
        self._same.pop(id, None)
        self._guessed.pop(id, None)

    def _is_of(self, id: str, other: str) -> bool:
        """True if an id is this other one, or has come to its person by it."""
        while id != other and id in self._same:
            id = self._same[id]
        return id == other

    def _part(self, id: str) -> Parting:
        """Take an id that was joined for one of a person of its own; those that are joined by it are of it, too.

        Recognition knows the person by the same id as before: who that is tells what is open with them.
        """
        inside, name = self.inside(id), self.name(id)
        everybody = self._all(inside)
        own = frozenset(each for each in everybody if self._is_of(each, id))
        del self._same[id]
        self._guessed.pop(id, None)
        self._apart[id] = None
        leaving, new = (everybody - own, name) if inside in own else (own, id)
        for each in leaving:
            self._inside.pop(each, None)
        self._inside |= {each: new for each in leaving if each != new}
        return Parting(id, name, leaving, inside, new)

    # -- what perception tells ----------------------------------------------------------------------------------

    def take(self, message: object, at: Seconds) -> list[Join | Parting]:
        """Take a message as it came, of what was seen at `at`. Returns who turns out to be one person, or two."""
        match message:
            case ActorFound(actor=actor, same_as=former):
                told = self._told(actor, former) if former else []
                parted = self._see(actor, at)
                self._seen[actor].found = True
                return [*told, *parted]
            case ActorLost(actor=actor, left=has_left) if (lost := self._seen.get(actor)) is not None:
                lost.lost, lost.found = at, False
                lost.place = None if has_left else lost.place
            case HeadPose(actor=actor, position=place):
                return self._place(actor, place, at)
            case World(people=people, entities=entities):
                self.things = frozenset(entity.id for entity in entities if entity.kind != "person")
                there = {person.id for person in people}
                for id, seen in self._seen.items():
                    if seen.in_world and id not in there:
                        seen.in_world = False
                        seen.lost = at if seen.lost is None and not seen.found else seen.lost
                placed = ((each.id, None if each.placeless else each.position) for each in people)
                changes = [change for id, place in placed for change in self._place(id, place, at)]
                for id in there & self._seen.keys():
                    self._seen[id].in_world = True
                return changes
        return []

    def _told(self, actor: str, former: str) -> list[Join | Parting]:
        """Take the word of perception that an id is somebody's who has another, or, by its own id, nobody else's."""
        newer, known, before = self.inside(actor), self.inside(former), self.name(actor)
        if newer == known and actor != former:
            for id in (actor, former):
                self._guessed.pop(id, None)  # it was right
            if self._is_of(former, actor):  # which of the two is the other's is said the other way round
                del self._same[former]
                if actor in self._same:
                    self._same[former] = self._same[actor]
            self._same[actor] = former
            name = self.name(actor)
            return [Join(newer, known, name, before)] if name != before else []
        changes: list[Join | Parting] = [self._part(actor)] if actor in self._same else []
        if actor != former:
            changes.append(self._joined(actor, former))
        return changes

    def _joined(self, id: str, former: str) -> Join:
        """Take an id that has come to nobody for another of a person."""
        self._same[id] = former
        return Join(self.inside(id), self.inside(former), self.name(former), id)

    def _see(self, id: str, at: Seconds) -> list[Join | Parting]:
        """Take a sign of an id. Returns who is somebody else after all: both are there."""
        seen = self._seen.get(id)
        if seen is None:
            self._seen[id] = _Sighting(at, at)
            return []
        before = seen.at
        self._seen[id] = seen  # the latest
        seen.at, seen.lost = max(at, seen.at), None
        return [
            self._part(guessed)
            for guessed, former in tuple(self._guessed.items())
            if (id == guessed and any(self._is_with(each, before) for each in former & self._all(self.inside(id))))
            or (id in former and self.inside(id) == self.inside(guessed) and self._is_with(guessed, before))
        ]

    def _is_with(self, id: str, before: Seconds) -> bool:
        """True if this one has been seen since the last sign of another, which came `before`, and has not gone."""
        seen = self._seen.get(id)
        return seen is not None and seen.lost is None and (seen.found or seen.in_world or seen.at >= before)

    def _place(self, id: str, place: Vector | None, at: Seconds) -> list[Join | Parting]:
        """Take where an id is; None: nobody knows. Returns whose it is, too, if it is new."""
        if id == self._robot:
            return []
        parted, seen = self._see(id, at), self._seen[id]
        is_new, seen.place = seen.place is None and at <= seen.since + PLACED_WITHIN, place
        if place is None or not is_new or id in {*self._same, *self._same.values(), *self._apart}:
            return parted
        lost = [
            (one.lost_at(seen.since) or 0.0, other)
            for other, one in self._seen.items()
            if other != id and self._is_lost_at(one, place, seen.since)
        ]
        known = {self.inside(other) for _, other in lost} - {id}
        if len(known) != 1:
            return parted
        former = known.pop()
        self._guessed[id] = self._all(former)
        return [*parted, self._joined(id, max(lost)[1])]

    def _is_lost_at(self, one: _Sighting, place: Vector, at: Seconds) -> bool:
        """True if this one was lost by `at`, not long before, and near this place."""
        lost = one.lost_at(at)
        is_recent = lost is not None and lost <= at < lost + FACE_GRACE
        return is_recent and one.place is not None and math.dist(one.place, place) <= SAME_PLACE

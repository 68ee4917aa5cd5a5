"""A person as a program tells of it: presence, looks, gestures, manipulations and words."""

import asyncio
import math
from collections.abc import Collection, Iterable, Iterator
from contextlib import contextmanager
from itertools import count, islice
from typing import Annotated

from msgspec import Meta
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ANOTHER_ID, LONGEST_ID, LONGEST_TEXT, ActorFound, Utterance
from engage_hri.schemas.text import is_utf8
from engage_hri.schemas.units import A_DAY, Seconds, Stamp, Vector, between, plus
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.client.inputs import taken
from engage_hri.services.client.people.actions import (
    RECOGNIZING,
    PersonActions,
    Utterances,
    partial_texts,
    speaking_time,
)
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.reports.ongoing_actions import ActionEvent, OngoingActionTracker

Duration = Annotated[float, Meta(ge=0.0, le=A_DAY)]
"""Seconds that something takes."""
GESTURE: Seconds = 0.5
MANIPULATION: Seconds = 1.5
FRAME: Seconds = 0.1
"""Time between two reports of the world while a hand moves."""
SEAT: Vector = (1.2, 0.0, 1.2)
"""Place of the face of a person opposite the robot; a second one sits beside."""
BESIDE = 0.6
LAP: Vector = (-0.2, 0.0, -0.5)
"""Place of a hand that does nothing, from the face, in metres."""


class PerceivedPerson:
    """A person of whom this program tells. Made by `perceive`.

    Every method raises RunFailed once the person has left, and InputRefused for what the world does not know.
    Cancelling one ends the action or the words where they are.
    """

    def __init__(self, person: str, bus: Bus) -> None:
        self.id = person
        self._bus = bus
        self._actions = PersonActions(person)
        self._perceived = PerceivedActions(bus)
        # Somebody of this name may have been here before, and told by the same program.
        self._utterances = Utterances(person, f"{bus.run}-{round(bus.now() * 1000)}")
        self._world = SharedWorld(bus.name)
        self._own: dict[str, Entity] = {}
        """What this program brought into the world: the person, if nobody else tells of it, hands, things."""
        self._has_left = False

    # -- presence -----------------------------------------------------------------------------------------------

    @property
    def robot(self) -> str:
        """The robot's actor id: its face, as a target."""
        return self._bus.robot

    @property
    def world(self) -> tuple[Entity, ...]:
        """All entities that are known now, of whoever told of them."""
        return self._world.entities

    async def leave(self) -> None:
        """Let the person leave, and end everything that the person does. The end of `async with` does this, too."""
        self._leaves()

    def _leaves(self) -> None:
        if self._has_left:
            return
        self._has_left = True
        if self._own:
            self._own.clear()
            self._show()
        self._tell(self._actions.leaves(self._bus.stamp()))

    def same_as(self, other: str) -> None:
        """Tell that this person is one who was told of by another id: events of both are told under that from now on.

        The later call corrects the earlier: this person is then no longer who that one said.

        other: that id, as a tracker of faces had it, or the name of whom it has recognized; this person's own id
            takes back what was said before.

        Raises:
            InputRefused: `other` can be no person's id: it is no name, the robot's, or a thing's of the world.
        """
        self._check()
        thing = self._entity(taken(other, str, f"{self.id}: same_as"))
        is_thing = other == self.robot or (thing is not None and thing.kind != "person")
        if is_thing or not keys.is_chunk(other):
            reason = f"{other!r} can't be another id of {self.id!r}"
            reason += f": the world has it as of kind {thing.kind!r}" if thing is not None and is_thing else ""
            raise InputRefused(Fault(reason=reason, where=self.id, advice=ANOTHER_ID))
        self._tell([ActorFound(actor=self.id, at=self._bus.stamp(), same_as=other)])

    async def move_to(self, position: Vector) -> None:
        """Move the face to another place.

        position: metres, in the robot's frame.

        Raises:
            InputRefused: `position` is not a place.
        """
        self._check()
        place = taken(position, Vector, f"{self.id}: position")
        self.bring(replace(self._body, position=place, placeless=False))

    def bring(self, *entities: Entity) -> None:
        """Put entities into the world, or change them there: things, hands, the person.

        entities: as they are now; each replaces what has its id.

        Raises:
            InputRefused: an entity is not one that a world can hold.
        """
        self._check()
        taken(World(entities=entities), World, f"{self.id}: entities")
        for each in entities:
            if each.id in (self.id, self.robot) and each.kind != "person":
                fault = Fault(
                    reason=f"{each.id!r} is an actor, and cannot be: {each.kind}", where=f"{self.id}: entities"
                )
                raise InputRefused(fault)
        self._own.update((entity.id, entity) for entity in entities)
        self._show()

    # -- what the person does -----------------------------------------------------------------------------------

    async def look_at(self, target: str) -> None:
        """Look at an entity, until the next look. Repeating it changes nothing.

        target: id of an entity, a person's or the robot's for the face; empty: away from everything.
        """
        self.begin("look", target)

    async def look_away(self) -> None:
        """Look at nothing that the robot knows of."""
        self.begin("look")

    async def nod(self, seconds: Seconds = GESTURE) -> None:
        """Let the person nod; returns when it is over.

        seconds: how many it takes.
        """
        await self._do("nod", "", seconds)

    async def shake(self, seconds: Seconds = GESTURE) -> None:
        """Shake the head; returns when it is over.

        seconds: how many it takes.
        """
        await self._do("shake", "", seconds)

    async def point_at(self, target: str, seconds: Seconds = 2 * GESTURE) -> None:
        """Point at an entity; returns when it is over.

        target: its id.
        seconds: for how many the arm is there.
        """
        await self._do("point", target, seconds)

    async def act(self, target: str, *, to: Vector | None = None, seconds: Seconds = MANIPULATION) -> None:
        """Manipulate a thing; returns when it is over.

        target: its id.
        to: place where it is laid, in a straight line, metres; None: it stays where it is.
        seconds: how many it takes.

        Raises:
            InputRefused: `seconds` is not a duration, or `to` not a place.
        """
        taken(seconds, Duration, f"{self.id}: seconds")
        place = None if to is None else taken(to, Vector, f"{self.id}: to")
        thing = self._entity(target)
        try:
            with self._doing("act", target):
                if place is None or thing is None:
                    await asyncio.sleep(seconds)
                else:
                    await self._carry(thing, place, seconds)
        finally:
            self._rest()

    async def say(
        self,
        text: str,
        *,
        to: Collection[str] = (),
        seconds: Seconds | None = None,
        partial: bool = True,
        delay: Seconds = RECOGNIZING,
    ) -> None:
        """Say words aloud; returns when they are known for good.

        text: the words.
        to: ids of those to whom it is said; empty: unknown.
        seconds: that the speech takes; None: as long as such words do.
        partial: tell the words also while they are spoken, as a recognizer does.
        delay: seconds from the end of the speech until the words are known for good.

        Raises:
            InputRefused: `text` is not text, or `seconds` not a duration.
        """
        self._check_text(text)
        duration = speaking_time(text) if seconds is None else taken(seconds, Duration, f"{self.id}: seconds")
        taken(delay, Duration, f"{self.id}: delay")
        said = self._utterances.begun(self._bus.stamp(), _ids(to))
        try:
            self.tell(said)  # first, so that whoever waits for the speech knows that its words will come
            with self._doing("speak"):
                pieces = [*partial_texts(text)] if partial else [text]
                for piece in pieces:
                    await asyncio.sleep(duration / len(pieces))
                    said = replace(said, text=piece, at=self._bus.stamp())
                    if partial:
                        self.tell(said)
            said = replace(said, text=text, ended=self._bus.stamp())
            await asyncio.sleep(delay)
        finally:
            if not self._has_left:
                now = self._bus.stamp()
                self.tell(replace(said, at=now, ended=said.ended or now, final=True))

    async def type(self, text: str, *, to: Collection[str] = ()) -> None:
        """Send a line that was typed. It is speech by itself: it opens a pair, or answers one.

        text: the line.
        to: ids of those to whom it is said; empty: unknown.
        """
        self._check_text(text)
        self.tell(self._utterances.typed(text, self._bus.stamp(), _ids(to)))

    # -- beginnings and ends ------------------------------------------------------------------------------------

    def stamp(self, ago: Seconds = 0.0) -> Stamp:
        """Return the instant that it is now, as messages have it, for the words of `tell`.

        ago: seconds by which the instant is earlier.

        Raises:
            InputRefused: `ago` is no time.
        """
        return self._bus.stamp(self._bus.now() - taken(ago, Seconds, f"{self.id}: ago"))

    def begin(self, action: Action, *targets: str) -> None:
        """Begin an action, which goes on until its `end`; a look until the next one.

        action: `look`, `speak`, `nod`, `shake`, `point` or `act`.
        targets: ids of entities; an actor's id means the face.

        Raises:
            InputRefused: `action` is not one of these, or a target is not an id.
        """
        taken(action, Action, f"{self.id}: action")
        self._check(*taken(targets, tuple[str, ...], f"{self.id}: targets"))
        self._tell(self._actions.begins(action, tuple(filter(None, targets)), self._bus.stamp()))

    def end(self, action: Action, *targets: str) -> None:
        """End an action that goes on; nothing if it does not.

        action: as it was begun.
        targets: as it was begun.
        """
        self._check()
        self._tell(self._actions.ends(action, tuple(filter(None, targets)), self._bus.stamp()))

    def tell(self, utterance: Utterance) -> None:
        """Tell words as a recognizer has them, at any time; speech itself is begun and ended as an action.

        utterance: with an id of your own; `actor` is this person's.

        Raises:
            InputRefused: a text or an id that no reader takes.
        """
        self._check()
        if not isinstance(utterance, Utterance):
            raise InputRefused(Fault(reason=f"{type(utterance).__name__!r} is no Utterance", where=self.id))
        self._check_length(utterance.text)
        if not 0 < len(utterance.id) <= LONGEST_ID:
            reason = f"the id of an utterance has 1 to {LONGEST_ID} letters, not {len(utterance.id)}"
            raise InputRefused(Fault(reason=reason, where=self.id))
        taken(utterance, Utterance, self.id)
        self._bus.publish(keys.UTTERANCE, replace(utterance, actor=self.id))

    async def _do(self, action: Action, target: str, seconds: Seconds) -> None:
        taken(seconds, Duration, f"{self.id}: seconds")
        with self._doing(action, target):
            await asyncio.sleep(seconds)

    @contextmanager
    def _doing(self, action: Action, *targets: str) -> Iterator[None]:
        self.begin(action, *targets)
        try:
            yield
        finally:
            if not self._has_left:
                self.end(action, *targets)

    def _tell(self, events: Iterable[ActionEvent]) -> None:
        if told := tuple(events):
            self._perceived.tell(*told)

    # -- the world ----------------------------------------------------------------------------------------------

    @property
    def _body(self) -> Entity:
        return self._own.get(self.id) or self._entity(self.id) or Entity(id=self.id, kind="person", position=SEAT)

    def _entity(self, id: str) -> Entity | None:
        return next((entity for entity in self._world.entities if entity.id == id), None)

    def _hand(self, position: Vector) -> Entity | None:
        """The person's hand at a place; None if another tells of this person's hands."""
        if self.id not in self._own:
            return None
        return Entity(id=f"{self.id}-hand", kind="hand", owner=self.id, position=position)

    async def _carry(self, thing: Entity, to: Vector, seconds: Seconds) -> None:
        began = self._bus.now()
        while (left := began + seconds - self._bus.now()) > 0:
            self._hold(thing, between(thing.position, to, 1 - left / seconds))
            await asyncio.sleep(min(FRAME, left))
        self._hold(thing, to)

    def _hold(self, thing: Entity, position: Vector) -> None:
        """Show a thing in the hand."""
        hand = self._hand(position)
        self.bring(replace(thing, position=position), *([hand] if hand is not None else []))

    def _rest(self) -> None:
        if not self._has_left and (hand := self._hand(plus(self._body.position, LAP))) is not None:
            self.bring(hand)

    def _show(self) -> None:
        entities = self._world.tell(self._own.values(), self._bus.now())
        self._bus.publish(keys.WORLD, World(entities=entities, at=self._bus.stamp()))

    def _take(self, received: Received | None) -> None:
        """Take a message about the world or about who is there, or none by the deadline; `perceive` calls this."""
        message, source = (received.message, received.source) if received else (None, "")
        if self._world.take(message, source, self._bus.now()) and not self._has_left and self._own:
            self._show()

    @property
    def _deadline(self) -> Seconds | None:
        """Loop time at which `_take` has something to do without a message."""
        return self._world.deadline

    def _enter(self, position: Vector | None) -> None:
        """Let the person come; `perceive` calls this.

        position: of the face; None: a free seat, unless the world has the person. Raises InputRefused: it has a thing
        with this id.
        """
        not_a_thing(self.id, World(entities=self._world.entities))
        if position is not None or self._entity(self.id) is None:
            place = position or free_seat([each.position for each in self._world.entities if each.kind == "person"])
            self._own[self.id] = Entity(id=self.id, kind="person", position=place, placeless=position is None)
            self._own[f"{self.id}-hand"] = Entity(
                id=f"{self.id}-hand", kind="hand", owner=self.id, position=plus(place, LAP)
            )  # fmt: skip
            self._show()
        self._tell(self._actions.comes(self._bus.stamp()))

    # -- checks -------------------------------------------------------------------------------------------------

    def _check(self, *targets: str) -> None:
        """Refuse what cannot be told. Without any world every id is good: nobody knows better."""
        if self._has_left:
            raise RunFailed(Fault(reason="this person has left", where=self.id, advice="`perceive` brings it back"))
        known = {entity.id for entity in self._world.entities}
        for target in filter(None, targets):
            if known - self._own.keys() and target not in known | {self._bus.robot}:
                reason = f"the world does not know {target!r}"
                raise InputRefused(
                    Fault(reason=reason, where=self.id, advice=suggestion(target, known | {self._bus.robot}))
                )

    def _check_text(self, text: str) -> None:
        self._check()
        if isinstance(text, str) and not text.strip():
            raise InputRefused(Fault(reason="no words", where=self.id, advice="give it what the person says"))
        self._check_length(text)

    def _check_length(self, text: str) -> None:
        if not isinstance(text, str):
            taken(text, str, f"{self.id}: text")
        if not is_utf8(text):
            advice = "half a character is in it: decode its bytes with errors='replace'"
            raise InputRefused(Fault(reason="the words are not UTF-8", where=self.id, advice=advice))
        if len(text) > LONGEST_TEXT:
            reason = f"{len(text)} letters; an utterance has {LONGEST_TEXT} at most"
            raise InputRefused(Fault(reason=reason, where=self.id, advice="split it into several"))


def _ids(to: Collection[str]) -> tuple[str, ...]:
    return (to,) if isinstance(to, str) else tuple(to)


def free_seat(taken: Collection[Vector], skip: int = 0) -> Vector:
    """Place of a face opposite the robot, as far to the left and right as it takes to be beside the others.

    skip: so many free places, for those who sit down at the same time.
    """
    seats = (_seat(number) for number in count())
    free = (seat for seat in seats if not any(math.dist(seat, other) < BESIDE / 2 for other in taken))
    return next(islice(free, skip, None))


def not_a_thing(person: str, world: World) -> None:
    """Refuse a person who has the id of a thing, or whose hand would: it would take that thing out of the world.

    Raises InputRefused.
    """
    for entity in world.entities:
        is_own = (entity.id == person and entity.kind == "person") or (
            entity.id == f"{person}-hand" and entity.kind == "hand" and entity.owner == person
        )
        if entity.id in (person, f"{person}-hand") and not is_own:
            reason = f"{person!r} can't be a person's id: the world has {entity.id!r}, of kind {entity.kind!r}"
            raise InputRefused(Fault(reason=reason, advice="give the person another id"))


def _seat(number: int) -> Vector:
    side = (number + 1) // 2 * BESIDE * (-1 if number % 2 else 1)
    return (SEAT[0], SEAT[1] + side, SEAT[2])


class PerceivedActions:
    """The actions of people that one participant perceives.

        perceived = PerceivedActions(bus)
        perceived.tell(ActorFound(actor="ann", at=bus.stamp()))
        perceived.tell(ActionBegan(actor="ann", action="look", targets=("robot",), at=bus.stamp()))

    bus: its view of the bus; its name is the reporter's.
    """

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._tracker = OngoingActionTracker()

    def tell(self, *events: ActionEvent) -> None:
        """Publish what has begun and ended, and what goes on after it. Events of one instant belong in one call.

        events: in their order, that of their stamps for each person.
        """
        for event in events:
            self._bus.publish(keys.PERCEIVED_ACTION, event)
        self.follow(events)

    def follow(self, published: Iterable[Message]) -> None:
        """Publish what goes on after events that have been published already.

        published: other messages among them are ignored.
        """
        for state in self._tracker.feed(published, self._bus.stamp()):
            if keys.is_chunk(state.actor):
                self._bus.publish(keys.perceived_ongoing(self._bus.name, state.actor), state)
        forgotten = self._tracker.forget(self._bus.now())
        self._bus.withdraw(*(keys.perceived_ongoing(self._bus.name, actor) for actor in forgotten))

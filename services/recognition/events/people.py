"""People with the robot: those who are here, the times at which they are due, and those to be forgotten.

A step concerns one person, or all who are here. People who have gone have no open events; they are remembered for a
while, in case they come back.
"""

from collections.abc import Callable
from functools import partial
from math import inf
from typing import TypeVar

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.bus.deadlines import FORGOTTEN_AFTER, Deadlines
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import EventWriter, Mishap, OngoingEvent, PersonForgotten
from engage_hri.services.recognition.events.person import Part, PersonRecognition
from engage_hri.services.recognition.events.scene import SessionScene, TakenUp

Value = TypeVar("Value")
Step = Callable[[PersonRecognition], object]


class People:
    """The persons of a session. strict: a bug with one raises; else it ends that person's events (see `Session`)."""

    def __init__(self, scene: SessionScene, config: RecognitionConfig, writer: EventWriter, *, strict: bool) -> None:
        self.persons: dict[str, PersonRecognition] = {}
        self._here: dict[str, PersonRecognition] = {}
        """Persons who are here, in the order of acquaintance."""
        self.agenda: Deadlines[str] = Deadlines(lambda id: self.persons[id].number if id in self.persons else 0)
        """Times at which the persons are due, and the robot, who comes first."""
        self._unseen: dict[str, Seconds] = {}
        """Time of the last sign of each person who has gone or is not reported as present. The longest ago first."""
        self._met = 0
        self._may_go_on = False
        """True if `scene.unknown` or `scene.asked` has changed since those were asked whether their talk goes on."""
        self._contacts: dict[str, Probability | None] = {}
        """Contact of each person with the robot."""
        self._new_contacts: dict[str, Probability | None] = {}
        self._new_presences: dict[str, bool] = {}
        """Those that have changed since somebody has asked for them."""
        self._silences = 0
        """`scene.silences` when the deadlines of all were last updated."""
        self._scene = scene
        self._config = config
        self._writer = writer
        self._strict = strict

    # -- acquaintances ------------------------------------------------------------------------------------------

    def person(self, id: str) -> PersonRecognition:
        """The person with this id, made if it is new."""
        person = self.persons.get(id)
        if person is None:
            self._met += 1
            person = PersonRecognition(id, self._met, self._scene, self._config, self._writer)
            self.persons[id] = self._here[id] = person
            self._scene.present.add(id)
            self._scene.call(id, id)
        return person

    def see(self, world: World, at: Seconds) -> None:
        """Take a view of the world: people in it are here, those that are missing now may have gone."""
        before = self._scene.people_in_world
        is_news = self._scene.see(world, at)
        self._scene.forget_others(at - FORGOTTEN_AFTER)
        if before != self._scene.people_in_world:
            for person in [self.person(id) for id in sorted(before ^ self._scene.people_in_world)]:
                self._note(person, at)
        if is_news:
            self._looks_may_direct(at)

    def _note(self, person: PersonRecognition, at: Seconds) -> None:
        """Note a sign of the person, or its leaving, at `at`."""
        self._unseen.pop(person.id, None)
        if not person.presence.reported and person.id not in self._scene.people_in_world:
            self._unseen[person.id] = at

    def forget(self, now: Seconds) -> None:
        """Drop persons without a sign for long. No deadline wakes for that: it happens at the next step."""
        while self._unseen:
            id, since = next(iter(self._unseen.items()))
            if since + FORGOTTEN_AFTER > now:
                return
            self._drop(id, since, now)

    def _drop(self, id: str, since: Seconds, now: Seconds) -> None:
        """Forget a person who was last seen at `since`."""
        person = self.persons[id]
        if person.presence.here:
            person.presence.vanish(since)
            self._apply(person, now, lambda person: person.leave(now))
        self.agenda.clear(id)
        self._here.pop(id, None)
        self._unseen.pop(id, None)
        self._scene.forget_person(id)
        self._may_go_on = True
        self._contacts.pop(id, None)
        self._new_contacts.pop(id, None)
        self._new_presences.pop(id, None)
        del self.persons[id]
        self._writer.effects.append(PersonForgotten(id))
        self._follow(now)

    def join(self, other: str, kept: str, at: Seconds, *, speaks: bool) -> None:
        """Take two persons for one, who is `kept` from now on.

        What is open with the other is lost, but for what they have said and is not decided. speaks: they go on.
        """
        before = self.persons.get(other)
        if before is None:
            return
        self._scene.join(other, kept)
        self._writer.join(other, kept)
        self.lose_track(before, at)
        is_found = before.presence.here and before.presence.reported
        self._drop(other, at, at)
        self._contacts.pop(kept, None)  # what was told of the other may be taken for it
        gazes = [self._scene.gaze, *(person.gazes.gaze for person in self.persons.values())]
        for person in self.persons.values():
            person.talk.speeches.rename(other, kept)
        for gaze in gazes:
            gaze.targets = tuple(kept if target == other else target for target in gaze.targets)
        if is_found:
            self.observe(kept, at, lambda person: person.presence.found(at))
        self.observe(kept, at, lambda person: person.talk.take_over(before.talk, at, goes_on=speaks))

    def lose_track(self, person: PersonRecognition, at: Seconds) -> None:
        """Begin anew with a person: its open events end as lost, and its actions have to be observed again."""
        fresh = PersonRecognition(person.id, person.number, self._scene, self._config, self._writer)
        fresh.presence, fresh.history = person.presence, person.history
        self.persons[person.id] = fresh
        if person.id in self._here:
            self._here[person.id] = fresh
        self._writer.lose(person.id, at)
        self._scene.stops(person.id, at)
        self._update(fresh)
        self._follow(at)

    def presences(self) -> dict[str, bool]:
        """Presence of each person who has come, or left, since the last call: true if they are here."""
        changed, self._new_presences = self._new_presences, {}
        return changed

    def contacts(self) -> dict[str, Probability | None]:
        """Contact of each person for whom it has changed since the last call."""
        changed, self._new_contacts = self._new_contacts, {}
        return changed

    # -- steps ---------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Take the step that is due first, of a person."""
        id, at = self.agenda.first, self.agenda.earliest
        assert id is not None
        assert at is not None
        self.apply(id, at, lambda person: person.pass_time(at))

    def observe(self, id: str, at: Seconds, step: Step, part: Part = "all") -> None:
        """Apply a step that an observation asks for, to a person who may be new. part: what it may change."""
        person = self.person(id)
        self._apply(person, at, step, part)
        self._follow(at)
        if person.presence.here or id not in self._unseen:
            self._note(person, at)

    def apply(self, id: str, at: Seconds, step: Step, part: Part = "all") -> None:
        """Apply a step to one person. part: what it may change."""
        self._apply(self.persons[id], at, step, part)
        self._follow(at)

    def apply_to_all(
        self,
        at: Seconds,
        step: Step,
        part: Part = "all",
        where: Callable[[PersonRecognition], object] = lambda person: True,
    ) -> None:
        """Apply a step to all who are here. part: what it may change. where: for whom it does."""
        for person in [person for person in self._here.values() if where(person)]:
            self._apply(person, at, step, part)
        self._follow(at)

    def _follow(self, at: Seconds) -> None:
        """Tell the others what follows for them from a step.

        Those who were asked are told that somebody else has answered in their place, or may yet do so. What has
        waited until it is known to whom somebody else speaks goes on, the earliest first. And all are told that
        others are silent: while one speaks, looks of all but that one direct nothing.
        """
        scene = self._scene
        if scene.taken_up or self._writer.answered:
            self._tell_taken_up(at)
        while self._may_go_on:
            self._may_go_on, unknown = False, {**scene.unknown}
            for id in [*scene.questions]:
                self._update(self.persons[id])
            for id in sorted(unknown, key=lambda id: scene.place(id, unknown[id])):
                if self.persons[id].talk.may_go_on(at):
                    self._apply(self.persons[id], at, lambda person: person.talk.go_on(at))
                    self._tell_taken_up(at)
        if self._silences != scene.silences:
            self._silences = scene.silences
            self._looks_may_direct(at)

    def _tell_taken_up(self, at: Seconds) -> None:
        """Tell those who were asked that somebody else has answered in their place, or for all who were asked."""
        scene = self._scene
        while scene.taken_up:
            taken_up = scene.taken_up.pop()
            if taken_up.asked in self.persons:
                self._apply(self.persons[taken_up.asked], at, partial(_answered_by_other, taken_up))
        while answered := self._writer.answered:
            # The end of a turn decides several answers in one instant: the first is that of who was silent.
            first = min(range(len(answered)), key=lambda n: answered[n].place)
            if any(person.talk.may_answer_before(answered[first]) for person in self.persons.values()):
                return
            told = partial(_answered_for_all, *answered.pop(first))
            self._may_go_on = True  # what has waited for it
            for person in list(self.persons.values()):  # who has left meanwhile was asked, too
                self._apply(person, at, told)

    def _looks_may_direct(self, at: Seconds) -> None:
        """Update the deadlines of those whose looks may direct the robot's now, for what all share has changed."""
        for person in list(self._here.values()):
            if person.gazes.look_directs_at() < inf:
                self._apply(person, at, lambda person: None, "looks")

    def _apply(self, person: PersonRecognition, at: Seconds, step: Step, part: Part = "all") -> None:
        """Apply a step to one person; a bug that shows in it does not affect the others. part: what it may change."""
        try:
            step(person)
            self._update(person, part)
        except Exception as error:
            if self._strict:
                raise
            self._writer.effects.append(Mishap(person.id, at, error))
            self.lose_track(person, at)

    def _update(self, person: PersonRecognition, part: Part = "all") -> None:
        """Note when the person is due, whether it is asked, its contact with the robot, and whether it is here."""
        id, scene, presence = person.id, self._scene, person.presence
        if part != "looks":
            asked_since = person.talk.asked_since
            if asked_since < inf or id in scene.asked:
                _keep(scene.questions, id, person.talk.question)
                self._may_go_on |= _keep(scene.asked, id, asked_since if asked_since < inf else None)
            self._may_go_on |= _keep(scene.unknown, id, person.talk.undecided_since)
        person.settle(part)
        self.agenda.set(id, None if person.due == inf else person.due)
        if person.contact != self._contacts.get(id):
            self._contacts[id] = self._new_contacts[id] = person.contact
        if presence.here is not (id in self._here) or presence.reported is not (id in scene.found):
            self._comes_or_goes(person)

    def _comes_or_goes(self, person: PersonRecognition) -> None:
        """Note whether the person is here, and whether that is reported."""
        id, scene, presence = person.id, self._scene, person.presence
        here, was_here = presence.here, id in self._here
        (scene.found.add if presence.reported else scene.found.discard)(id)
        if was_here and not here:
            del self._here[id]
            scene.present.discard(id)
            self._new_presences[id] = False
            self._note(person, presence.left_at)
        elif here and not was_here:
            self._here[id] = person
            scene.present.add(id)
            self._new_presences[id] = True
            person.talk.person_back()
            self._here = dict(sorted(self._here.items(), key=lambda one: one[1].number))


def _keep(kept: dict[str, Value], id: str, value: Value | None) -> bool:
    """Keep what is known of a person; None: nothing. True if that is a change."""
    before = kept.get(id)
    if value is not None:
        kept[id] = value
    elif before is not None:
        del kept[id]
    return value != before


def _answered_by_other(taken_up: TakenUp, asked: PersonRecognition) -> None:
    """Tell the person who was asked that somebody else has answered."""
    asked.talk.take_early(taken_up.at, lambda talk: talk.exchange.pair.other_answers(*taken_up[1:]))


def _answered_for_all(answered: OngoingEvent, at: Seconds, asked: PersonRecognition) -> None:
    """Tell a person that the robot's question to several people, maybe to this one, has been answered."""
    asked.talk.take_early(at, lambda talk: talk.exchange.pair.answered_for_all(answered, at))

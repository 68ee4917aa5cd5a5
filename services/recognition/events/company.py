"""Everybody with the robot: who is here, whose turn it is when time passes, and who has been gone for long enough.

A step touches those whom it concerns: one person, or all who are here. Those who have gone have nothing open; they
are remembered for a while, in case they come back.
"""

from collections.abc import Callable

from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.machine import EventWriter, Forgotten, Mishap
from engage_hri.services.recognition.events.person import Person
from engage_hri.services.recognition.events.scene import SessionScene
from engage_hri.services.requests.deadlines import Deadlines


class Company:
    """strict: a bug with one person raises; otherwise it costs that person's events (see `Session`)."""

    def __init__(self, scene: SessionScene, config: RecognitionConfig, writer: EventWriter, *, strict: bool) -> None:
        self.persons: dict[str, Person] = {}
        self._here: dict[str, Person] = {}
        """In the order of acquaintance."""
        self._agenda: Deadlines[str] = Deadlines(lambda id: self.persons[id].number)
        self._unseen: dict[str, Seconds] = {}
        """Since when nobody has told of those who have gone, or of whom nobody says that they are there. The longest
        ago first."""
        self._met = 0
        self._speech = 0
        """As of the scene, when the times of all were last arranged."""
        self._scene = scene
        self._config = config
        self._writer = writer
        self._strict = strict

    # -- who there is -------------------------------------------------------------------------------------------

    def person(self, id: str) -> Person:
        """An acquaintance, old or new."""
        if id not in self.persons:
            self._met += 1
            person = Person(id, self._met, self._scene, self._config, self._writer)
            self.persons[id] = self._here[id] = person
        return self.persons[id]

    def see(self, world: World, at: Seconds) -> None:
        """Who is in the world is there; who is in it no longer may have gone."""
        before = self._scene.people_in_world
        self._scene.see(world, at)
        self._scene.forget_others(at - self._config.forgotten_after)
        for id in sorted(self._scene.people_in_world):
            self.person(id)
        for id in sorted(before ^ self._scene.people_in_world):
            self._note(self.persons[id], at)
        self.let_all(at, lambda person: None)  # what is an object may have changed

    def _note(self, person: Person, at: Seconds) -> None:
        """Somebody has told of the person, or it has left."""
        self._unseen.pop(person.id, None)
        told = person.presence.here and person.presence.told
        if not told and person.id not in self._scene.people_in_world:
            self._unseen[person.id] = at

    def forget(self, now: Seconds) -> None:
        """Drop those of whom nobody has told for long. Nothing waits for that, so it is done on occasion."""
        while self._unseen:
            id, since = next(iter(self._unseen.items()))
            if since + self._config.forgotten_after > now:
                return
            person = self.persons[id]
            if person.presence.here:
                person.presence.vanish(since)
                self._let(person, now, lambda person: person.leave(now))
            self._agenda.clear(id)
            self._here.pop(id, None)
            del self.persons[id], self._unseen[id]
            self._writer.effects.append(Forgotten(id))
            self._follow_speech(now)

    def lose_track(self, person: Person, at: Seconds) -> None:
        """Begin anew with somebody: open events end as lost, and what the person does has to be seen again."""
        fresh = Person(person.id, person.number, self._scene, self._config, self._writer)
        fresh.presence, fresh.news = person.presence, person.news
        self.persons[person.id] = fresh
        if person.id in self._here:
            self._here[person.id] = fresh
        self._writer.lose(person.id, at)
        self._scene.stops(person.id, at)
        self._arrange(fresh)
        self._follow_speech(at)

    # -- what happens to them -----------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        """When something happens by itself."""
        return self._agenda.earliest

    def advance(self) -> None:
        """Let happen what is due first."""
        id, at = self._agenda.first, self._agenda.earliest
        assert id is not None
        assert at is not None
        self._let(self.persons[id], at, lambda person: person.pass_time(at))
        self._follow_speech(at)

    def hear(self, id: str, at: Seconds, happen: Callable[[Person], object]) -> None:
        """Let happen what is told of one person, who may be new."""
        person = self.person(id)
        self.let(id, at, happen)
        if person.presence.here or id not in self._unseen:
            self._note(person, at)

    def let(self, id: str, at: Seconds, happen: Callable[[Person], object]) -> None:
        """Let it happen to one person."""
        self._let(self.persons[id], at, happen)
        self._follow_speech(at)

    def let_all(self, at: Seconds, happen: Callable[[Person], object]) -> None:
        """Let it happen to all who are here."""
        self._speech = self._scene.speech
        for person in list(self._here.values()):
            self._let(person, at, happen)
        self._follow_speech(at)

    def _follow_speech(self, at: Seconds) -> None:
        """While somebody speaks the looks of the others direct nobody: their times change."""
        if self._speech != self._scene.speech:
            self.let_all(at, lambda person: None)

    def _let(self, person: Person, at: Seconds, happen: Callable[[Person], object]) -> None:
        """A bug that shows with one person costs the others nothing."""
        try:
            happen(person)
            self._arrange(person)
        except Exception as error:
            if self._strict:
                raise
            self._writer.effects.append(Mishap(person.id, at, error))
            self.lose_track(person, at)

    def _arrange(self, person: Person) -> None:
        """Know when the person is due, and whether it is here."""
        self._agenda.set(person.id, person.deadline)
        here, was_here = person.presence.here, person.id in self._here
        if was_here and not here:
            del self._here[person.id]
            self._note(person, person.presence.left_at)
        elif here and not was_here:
            self._here[person.id] = person
            self._here = dict(sorted(self._here.items(), key=lambda one: one[1].number))

"""State of robot, people and world besides the events: gazes, speakers, things on the table."""

from collections import deque
from math import inf
from typing import Any, NamedTuple

from msgspec import Struct

from engage_hri.schemas.behaviors import Action
from engage_hri.schemas.fragments import Claim
from engage_hri.schemas.recognition import InterjectionReading
from engage_hri.schemas.units import Probability, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.recognition.config import GazeResolution
from engage_hri.services.recognition.events.addressing import (
    LONGEST_UNKNOWN,
    LONGEST_UNTOLD,
    Addressees,
    Spoken,
    renamed_in,
)
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.recognition.events.limits import BLOCKS_KEPT, in_time

LINES_KEPT = 256
SPOKEN_KEPT = 32
"""Number of speeches of all that are remembered with their addressees."""
ENDED_TOLD = 4
"""Number of speeches that are told once more when they are over: as many may end before it is known to whom the first
was. Ours."""
TOLD_MARGIN: Seconds = 0.1
"""Difference of the beginnings of a speech and of words that are told just before it. Ours."""
SAME_INSTANT: Seconds = 0.001
"""Longest gap between two looks at the same target that count as one."""


class Covering(NamedTuple):
    """A person's hand hides a piece, and may be moving it. left: the hand has gone on, maybe with the piece."""

    actor: str
    piece: str
    left: bool


class Covered(Struct, frozen=True):
    """Observation of all pieces under hands, from raw perception alone."""

    by: frozenset[Covering]


class Worded(Struct, frozen=True, kw_only=True):
    """Observation: all that is known of the words of a person's speech. since: local time at which that began.

    is_alone: nothing but the words tells of this speech, and it is told next. is_line: it was typed in no time.
    is_announced: words of it have been told that are not final, or are the robot's. is_echo: they are the robot's.
    """

    actor: str
    since: Seconds
    text: str
    is_alone: bool = False
    is_line: bool = False
    is_announced: bool = False
    is_echo: bool = False
    to: Addressees | None = None
    """Addressees, if perception knows them."""


class Question(NamedTuple):
    """A question of the robot that waits. since: end of its turn. until: time by which an answer has to begin.

    known_until: time from which on it is not known whether the person who was asked has answered.
    """

    accept: tuple[Action, ...]
    since: Seconds
    until: Seconds
    known_until: Seconds = inf


class TakenUp(NamedTuple):
    """Answer to the robot in another's place. asked: who was asked. person: who has answered."""

    asked: str
    person: str
    action: Action
    at: Seconds


class GazeState(Struct):
    """Look of an actor, and its start.

    ended: time at which it ended, unless the same look begins again at once; infinite: it goes on.
    """

    targets: tuple[str, ...] = ()
    since: Seconds = 0.0
    ended: Seconds = inf
    confidence: Probability = 1.0
    one_of: bool = False
    """True if it is at one of the targets, and it is not known at which."""
    spent: bool = False
    """True if this look answers the robot, or has directed it already: it does not direct it (again)."""

    def begin(
        self, targets: tuple[str, ...], at: Seconds, confidence: Probability = 1.0, *, one_of: bool = False
    ) -> bool:
        """Begin a look at `targets`. True if that is a change; a look older than the present one is ignored."""
        if at < self.since:
            return False
        if targets == self.targets and at - self.ended <= SAME_INSTANT:
            self.ended = inf
            return False
        self.targets, self.since, self.ended, self.spent = targets, at, inf, False
        self.confidence, self.one_of = confidence, one_of
        return True

    def sureness(self, entities: tuple[str, ...]) -> Probability:
        """Confidence that the look is at one of these: of a look at one of several each has its part."""
        meant = sum(target in entities for target in self.targets)
        return self.confidence * meant / len(self.targets) if self.one_of and meant else self.confidence

    def end(self, targets: tuple[str, ...], at: Seconds) -> None:
        """End the look at `targets`; effective only if the same look does not begin again at once."""
        if self.targets and targets in ((), self.targets) and at >= self.since:
            self.ended = at

    @property
    def deadline(self) -> Seconds:
        return self.ended + SAME_INSTANT

    def expire(self) -> Seconds:
        """Let the ended look be over. Returns the time of its end."""
        at = self.ended
        self.targets, self.since, self.ended, self.spent = (), at, inf, False
        return at


class SessionScene:
    """State of the robot and the world, shared by all persons of a session."""

    def __init__(self, robot: str, resolution: GazeResolution) -> None:
        self.robot = robot
        self.resolution = resolution
        self.gaze = GazeState()
        self.robot_spoken: Spoken | None = None
        """What the robot says now."""
        self.turn: tuple[str, Addressees] | None = None
        """The robot's turn that has not ended, and to whom it is."""
        self.head_owner = Claim(kind="none", priority=0)
        self.people_in_world: frozenset[str] = frozenset()
        self.covered = Covered(frozenset())
        self.acting: set[str] = set()
        """People who are manipulating something."""
        self._objects: set[str] = set()
        self._surfaces: set[str] = {"table"}
        self._others: dict[str, Seconds] = {}
        """People and hands with the time when they were last seen; the longest ago first."""
        self._speakers: set[str] = set()
        self.lines: Latest[str, Seconds] = Latest(LINES_KEPT)
        """When each person last sent a line that was typed."""
        self.present: set[str] = set()
        """People who are here, as far as is known."""
        self.found: set[str] = set()
        """Those of whom perception reports that it sees them."""
        self.names: dict[str, str] = {robot.casefold(): robot}
        """Actor ids by what people call them."""
        self.is_worded = False
        """True once somebody has told spoken words, of whomever: a recognizer hears all voices."""
        self.echoes: Latest[tuple[str, Seconds], None] = Latest(SPOKEN_KEPT)
        """Speeches of which nothing but the robot's own words is known, by speaker and start."""
        self.tells_addressees = False
        """True if perception has ever told to whom somebody speaks."""
        self.told_addressees: Latest[tuple[str, Seconds], Addressees] = Latest(SPOKEN_KEPT)
        """To whom a speech is by perception, by speaker and start, if that is told before the speech."""
        self.spoken: deque[Spoken] = deque(maxlen=SPOKEN_KEPT)
        """The latest speeches whose addressees are known, of all."""
        self.questions: dict[str, Question] = {}
        """Questions of the robot that wait for an answer, by the person who was asked."""
        self.asked: dict[str, Seconds] = {}
        """Since when people are asked, as far as is known: they may have answered already."""
        self.taken_up: list[TakenUp] = []
        """Answers to them by somebody else, which the person who was asked has yet to be told of."""
        self.unknown: dict[str, Seconds] = {}
        """Start of the first speech of each person of which it is not known yet to whom it is."""
        self.listening_blocks: Latest[str, None] = Latest(BLOCKS_KEPT)
        """Blocks under way that the robot has announced as backchannels: they answer nobody."""
        self.silences = 0
        """Number of times that all, or all but one, have fallen silent."""
        self.floor_changes = 0
        """Number of times that speech of any actor has begun or ended, or that its addressees became known."""
        self._fell_silent: list[tuple[Seconds, str]] = []
        """The two actors that fell silent last. Two are enough: the actor that asks is at most one of them."""

    def see(self, world: World, at: Seconds) -> bool:
        """Take a view of the world. Objects once seen stay known: a covered piece has not gone (thesis 5.4.2).

        True if something may count as an object now that did not before, or no longer.
        """
        people, known, others = set(), len(self._objects), self._others
        for entity in world.entities:
            id, kind = entity.id, entity.kind
            if kind == "object":
                self._objects.add(id)
            elif kind == "surface":
                self._surfaces.add(id)
            else:
                others.pop(id, None)
                others[id] = at
                if kind == "person" and id != self.robot:
                    people.add(id)
                    if entity.name:
                        self.call(id, entity.name)
        if people != self.people_in_world:
            self.people_in_world = frozenset(people)
        return not known or len(self._objects) > known

    def call(self, id: str, *names: str) -> None:
        """Note names by which people call somebody: as an id is written, and as it is spoken."""
        for name in names:
            plain = name.casefold()
            self.names |= {plain: id, " ".join(plain.replace("_", " ").split()): id}

    def told_to(self, person: str, since: Seconds) -> Addressees | None:
        """Addressees of a speech by perception, if they were told before the speech; None: they were not."""
        told = ((at, to) for (who, at), to in reversed(self.told_addressees.items()) if who == person)
        return next((to for at, to in told if abs(at - since) <= TOLD_MARGIN), None)

    def forget_others(self, before: Seconds) -> None:
        """Forget the people and hands that have not been seen since `before`."""
        while self._others and (oldest := next(iter(self._others))) and self._others[oldest] < before:
            del self._others[oldest]

    def company(self, person: str) -> set[str]:
        """People who are seen here besides this one. Who is only heard of may be a name that a recognizer made up."""
        return (self.present & (self.people_in_world | self.found)) - {person}

    def forget_person(self, person: str) -> None:
        self.present.discard(person)
        self.found.discard(person)
        self.unknown.pop(person, None)
        self.names = {name: id for name, id in self.names.items() if id != person}

    def join(self, other: str, kept: str) -> None:
        """Take two persons for one, who is `kept` from now on."""
        if other in self.people_in_world:
            self.people_in_world = self.people_in_world - {other} | {kept}
        for remembered in (self.echoes, self.told_addressees):
            for person, since in [each for each in remembered if each[0] == other]:
                told: Any = remembered.pop((person, since))
                remembered[kept, since] = told
        for spoken in self.spoken:
            spoken.actor = kept if spoken.actor == other else spoken.actor
            spoken.to = renamed_in(spoken.named, other, kept) or spoken.to
        self.floor_changes += 1

    @property
    def longest_unknown(self) -> Seconds:
        """Time after which it is decided what a sound that goes on is, and for whom."""
        return LONGEST_UNTOLD if self.tells_addressees else LONGEST_UNKNOWN

    def is_face(self, target: str) -> bool:
        """True if a look at `target` is one at the face of a person or of the robot."""
        return target == self.robot or target in self.present

    def note_spoken(self, spoken: Spoken, at: Seconds) -> None:
        """Remember a speech whose addressees are known at `at`."""
        self.floor_changes += 1
        if spoken.noted_at == inf:
            spoken.noted_at = at
            self.spoken.append(spoken)

    def decide(self, spoken: Spoken, at: Seconds, *, is_noise: bool = False) -> None:
        """Note what a sound is: it counts for what others say since then."""
        spoken.noted_at = max(at, spoken.noted_at) if spoken.sound == "unsure" else spoken.noted_at
        spoken.sound = "noise" if is_noise else "speech"
        self.floor_changes += 1

    def spoken_since(self, actor: str, since: Seconds) -> Spoken | None:
        """The speech that began then; None: it is not known to whom it was, or long ago."""
        return next((each for each in self.spoken if each.actor == actor and each.since == since), None)

    def is_last(self, person: str, since: Seconds, until: Seconds = inf) -> bool:
        """True if neither the person nor the robot has begun to say something to the other since, until then.

        What may be noise counts as said, as long as it is not decided.
        """
        said = [each for each in self.spoken if since < each.since <= until and each.sound != "noise"]
        robot = self.robot
        return not any(
            each.is_to(robot) if each.actor == person else each.actor == robot and each.is_to(person) for each in said
        )

    def robot_says(self, since: Seconds, at: Seconds) -> bool:
        """True if what the robot says at `at` goes on since then."""
        return any(
            each.actor == self.robot and each.since <= since and (each.until is None or at < each.until)
            for each in self.spoken
        )

    def forget_spoken(self, spoken: Spoken) -> None:
        """Forget a speech that was another one's: two have told of it."""
        self.floor_changes += 1
        self.spoken = deque((each for each in self.spoken if each is not spoken), SPOKEN_KEPT)

    def read(self, actor: str, since: Seconds, reading: InterjectionReading, at: Seconds) -> None:
        """Take what a speech into the robot's words is, as is known at `at`."""
        if (spoken := self.spoken_since(actor, since)) is not None:
            self.decide(spoken, at, is_noise=reading == "noise")

    def ended(self) -> list[Spoken]:
        """The speeches that were over last, in the order of their ends: of those known to be some, and to whom."""
        known = [each for each in self.spoken if each.named and each.sound == "speech"]
        over = [(each.until, each.since, each.actor, each) for each in known if each.until is not None]
        return [one[-1] for one in sorted(over, key=lambda one: one[:-1])[-ENDED_TOLD:]]

    @property
    def robot_speaks_since(self) -> Seconds | None:
        """Time when the robot began what it says now; None: it is silent."""
        return None if self.robot_spoken is None else self.robot_spoken.since

    def robot_speaks_to(self, person: str) -> Seconds | None:
        """Time when the robot began what it says now to this person, or to nobody known; None: it says nothing."""
        return self.robot_spoken.since if self.robot_spoken is not None and self.robot_spoken.is_to(person) else None

    def answers_for_another(self, person: str, action: Action, at: Seconds, *, after: Seconds) -> bool:
        """Take what a person says to the robot as the answer to a question that the robot has asked somebody else.

        False if it is none: no such question waits that was asked after `after`. Of several the latest is answered.
        """
        waiting = [
            (question.since, asked)
            for asked, question in self.questions.items()
            if asked != person
            and action in question.accept
            and after < question.since < at <= question.known_until
            and in_time(at, question.until)
        ]
        if not waiting:
            return False
        since, asked = max(waiting)
        # Who was asked in the same turn is told of it later.
        self.questions = {who: each for who, each in self.questions.items() if each.since != since}
        self.taken_up.append(TakenUp(asked, person, action, at))
        return True

    def is_contested(self, person: str, at: Seconds) -> bool:
        """True if the robot asks somebody, and another began to speak before this, it is not known yet to whom."""
        if not self.asked or not self.unknown:
            return False
        place = self.place(person, at)
        return any(who != person and self.place(who, since) < place for who, since in self.unknown.items())

    def place(self, person: str, at: Seconds) -> tuple[Seconds, bool, str]:
        """Place of what a person begins to say in the order in which people are heard: who is asked comes first."""
        return at, self.asked.get(person, inf) >= at, person

    def may_be_answered(self, person: str, until: Seconds) -> bool:
        """True if somebody else has begun to speak by then, of whom it is not known yet to whom it is."""
        return any(who != person and in_time(since, until) for who, since in self.unknown.items())

    def robot_falls_silent(self, at: Seconds) -> None:
        if self.robot_spoken is not None:
            self.robot_spoken.until = at
        self.robot_spoken = None
        self.falls_silent(self.robot, at)

    def is_listening(self, behavior: str) -> bool:
        """True if a behavior of the robot, `block:behavior`, is part of an announced backchannel."""
        return behavior.rpartition(":")[0] in self.listening_blocks

    def speaks(self, actor: str) -> None:
        self._speakers.add(actor)
        self.floor_changes += 1

    def falls_silent(self, actor: str, at: Seconds) -> None:
        if actor in self._speakers:
            self._speakers.discard(actor)
            self._fell_silent = sorted(((at, actor), *(one for one in self._fell_silent if one[1] != actor)))[-2:]
            self.silences += len(self._speakers) <= 1
            self.floor_changes += 1

    def stops(self, actor: str, at: Seconds) -> None:
        """End what the actor says and manipulates, because it has gone or is not followed any longer."""
        self.acting.discard(actor)
        self.falls_silent(actor, at)

    def others_silent_since(self, actor: str) -> Seconds:
        """Time since when all but `actor` are silent; infinite while another speaks."""
        if len(self._speakers) > (actor in self._speakers):
            return inf
        return max((at for at, other in self._fell_silent if other != actor), default=-inf)

    def knows(self, entity: str) -> bool:
        """True if the entity has ever been seen, or if no object has been seen yet."""
        return not self._objects or entity in self._objects or self._is_no_object(entity)

    def _is_no_object(self, entity: str) -> bool:
        return entity in self._surfaces or entity in self._others

    def is_object(self, entity: str) -> bool:
        if entity in self._objects:
            return True
        return not self._objects and entity != self.robot and not self._is_no_object(entity)

    def person_looks_at(self, gaze: GazeState, objects: tuple[str, ...]) -> bool:
        """True if a person's look counts as one at `objects`: at resolution `table` a look at anything there does."""
        if any(map(objects.__contains__, gaze.targets)):
            return True
        if self.resolution == "object":
            return False
        on_table = any(target in self._surfaces or self.is_object(target) for target in gaze.targets)
        return on_table and any(map(self.is_object, objects))

    def goes_with_hand(self, actor: str, targets: tuple[str, ...]) -> bool:
        """True if a look at `targets` goes with the person's own hand, which may move the piece that it hides."""
        return any(one.actor == actor and (one.left or one.piece in targets) for one in self.covered.by)

    def robot_looks_at(self, entities: tuple[str, ...]) -> bool:
        return any(map(entities.__contains__, self.gaze.targets))

    def robot_since(self, entities: tuple[str, ...]) -> Seconds | None:
        """Start of the robot's look at one of the entities; None if it looks elsewhere."""
        return self.gaze.since if self.robot_looks_at(entities) else None

    def fragment_looks_elsewhere(self, entities: tuple[str, ...]) -> bool:
        """True if a fragment's own gaze holds the robot's head for another target."""
        return self.head_owner.kind == "fragment" and self.head_owner.target not in entities

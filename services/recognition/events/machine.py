"""The base of all recognizers: a transition table as data, the ongoing event, and the writer of its changes.

A row says to which state an input leads, and which changes of the connection event are published on the way.
Guards are part of the input's name (`robot_directs_shared`), so that table and diagram are complete.
"""

from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import EVENT_KINDS, Action, Cause, EventKind
from engage_hri.schemas.recognition import (
    ENDINGS,
    ConnectionEvent,
    EventOutcome,
    EventState,
    Interjection,
    InterjectionReading,
    TurnOutcome,
)
from engage_hri.schemas.requests import Accepted, Refused
from engage_hri.schemas.units import Probability, Seconds, Stamp
from engage_hri.services.recognition.events.history import Latest


class PersonForgotten(NamedTuple):
    """A person has been gone for long and is forgotten. The same id then means a new person."""

    actor: str


class Mishap(NamedTuple):
    """A bug has shown in a step. actor: the person concerned; empty if none in particular.

    Only the open events of that person have ended, as lost.
    """

    actor: str
    at: Seconds
    error: Exception


TEXTS_KEPT = 64
"""Number of speeches whose words, and of events with speech, that are remembered."""
INTERJECTIONS_KEPT = 16
"""Number of interjections that are remembered, to be told again when their words become known."""
Effect = ConnectionEvent | Interjection | EventOutcome | TurnOutcome | Accepted | Refused | PersonForgotten | Mishap
IDLE = "idle"
DECISIONS: frozenset[EventState] = frozenset({"succeeded", "failed", "preempted", "withdrawn", "superseded"})
DECIDED: frozenset[EventState] = DECISIONS | {"lost"}
"""States that answer a request."""


class UndefinedTransition(Exception):
    """An input for which the table has no row in the present state. Nothing has changed."""


class TransitionRow(NamedTuple):
    """A transition: in `state`, the input `given` leads to state `next`."""

    state: str
    given: str
    next: str
    publishes: tuple[EventState, ...] = ()


Table = Mapping[tuple[str, str], TransitionRow]


def table(*rows: TransitionRow) -> Table:
    """Rows by state and input. Raises ValueError if two rows answer the same input."""
    by_input = {(row.state, row.given): row for row in rows}
    if len(by_input) != len(rows):
        raise ValueError("two rows for the same state and input")
    return by_input


class SpeechStart(NamedTuple):
    """A speech of a person, by its start."""

    actor: str
    since: Seconds


class OngoingEvent(Struct, kw_only=True):
    """A connection event between its start and its end, with all that its `ConnectionEvent` messages say."""

    kind: EventKind
    initiator: str
    responder: str
    started: Seconds
    objects: tuple[str, ...] = ()
    one_of: bool = False
    """It is about one of the objects, and it is not known which."""
    cause: Cause = "human"
    optional: bool = False
    limit: Seconds | None = None
    accept: tuple[Action, ...] = ()
    block: str = ""
    behavior: str = ""
    turn: str = ""
    request: str = ""
    """Id of the request that the decision answers."""
    id: str = ""
    delay: Seconds | None = None
    duration: Seconds | None = None
    response: Action | None = None
    response_since: Seconds = 0.0
    answered_by: str = ""
    is_to_several: bool = False
    """Adjacency pair: the robot has asked others in the same turn, and whoever answers first answers for all."""
    confidence: Probability = 1.0
    """Least confidence of the observations on which the event rests."""
    changed: Seconds | None = None
    is_former: bool = False
    """True if a former life of recognition has told its start already. Its delay is not known."""
    spoken: tuple[SpeechStart, ...] = ()
    """People's speeches that it consists of: its words are theirs."""

    def rests_on(self, confidence: Probability) -> None:
        """Count one more observation, of this confidence."""
        self.confidence = min(self.confidence, confidence)


class Answered(NamedTuple):
    """A question to several people that is answered. at: when that was decided."""

    event: OngoingEvent
    at: Seconds

    @property
    def place(self) -> tuple[Seconds, bool, str]:
        """Place of the answer among all: since when, and by whom; see `SessionScene.place`."""
        return self.event.response_since, self.event.answered_by != self.event.responder, self.event.answered_by


class EventWriter:
    """Writer of messages: numbers the events and turns their changes into `effects`.

    clock: of the stamps. session: prefix of the ids, so that a restarted service never reuses one. words_patience:
    time after its end for which an event is told again, should its words become known.
    """

    def __init__(self, clock: str, session: str = "", *, words_patience: Seconds = 0.0) -> None:
        self.effects: list[Effect] = []
        self.now: Seconds = 0.0
        """Time of what is being taken. What is told may have happened before."""
        self._clock = clock
        self._session = session
        self._count: dict[EventKind, int] = dict.fromkeys(EVENT_KINDS, 0)
        self._open: dict[str, OngoingEvent] = {}
        """Published events that have not ended, by id."""
        self._words_patience = words_patience
        self._texts: Latest[SpeechStart, str] = Latest(TEXTS_KEPT)
        """Words of speeches."""
        self._interjected: Latest[SpeechStart, Interjection] = Latest(INTERJECTIONS_KEPT)
        """What people have said into the robot's turns, as it was last told."""
        self._formerly: Latest[SpeechStart, Interjection] = Latest(INTERJECTIONS_KEPT)
        """What a former life told of speeches of which this one has not found yet that they are into its turns."""
        self._spoken: Latest[str, tuple[OngoingEvent, ConnectionEvent]] = Latest(TEXTS_KEPT)
        """Events with speech of a person, each as it was last told."""
        self.answered: list[Answered] = []
        """Questions to several people that one of them, or somebody else, has answered: to be told to the rest."""

    def take(self) -> list[Effect]:
        """Return the effects since the last call: what people have said first, for the rest follows from that."""
        taken, self.effects = self.effects, []
        return sorted(taken, key=lambda each: not isinstance(each, Interjection))

    def stamp(self, at: Seconds) -> Stamp:
        return Stamp(self._clock, at)

    def publish(self, event: OngoingEvent, state: EventState, at: Seconds, *, retold: bool = False) -> None:
        """Write a change, and answer the event's request if this decides it. An event's times never run backwards.

        retold: the event came to this state before; something else of it is new.
        """
        if not event.id:
            self._count[event.kind] += 1
            event.id = f"{self._session}{EVENT_KINDS[event.kind].prefix}-{self._count[event.kind]}"
        at = event.changed = max(at, event.started if event.changed is None else event.changed)
        if state == "failed" and not retold:
            event.delay = at - event.started
        begins, ends = state == "started", state == "completed"
        if event.is_to_several and event.response is not None and not begins:
            event.answered_by = event.answered_by or event.responder
            if state in ("succeeded", "preempted"):
                self.answered.append(Answered(event, at))
        knows_delay = not begins and (state == "failed" or not event.is_former)
        told = ConnectionEvent(
                id=event.id, kind=event.kind, initiator=event.initiator, responder=event.responder, state=state,
                at=Stamp(self._clock, at), started=Stamp(self._clock, event.started), objects=event.objects,
                one_of=event.one_of, cause=event.cause, optional=event.optional,
                delay=event.delay if knows_delay else None, duration=event.duration if ends else None,
                limit=event.limit if begins else None,
                response=None if begins else event.response, answered_by=event.answered_by,
                confidence=event.confidence, block=event.block, behavior=event.behavior, turn=event.turn,
                words=self._words_of(event) if event.spoken else "",
                retold=retold or (begins and event.is_former),
        )  # fmt: skip
        self.effects.append(told)
        if event.spoken:
            self._spoken[event.id] = (event, told)
            self._forget_spoken(at)
        if state in ENDINGS:
            self._open.pop(event.id, None)
        else:
            self._open[event.id] = event
        if state in DECIDED and event.request:
            self.effects.append(
                EventOutcome(
                    id=event.request, event=event.id, state=state, at=self.stamp(at), delay=event.delay,
                    response=event.response,
                )
            )  # fmt: skip
            event.request = ""

    def interject(self, person: str, speech: Seconds, reading: InterjectionReading, at: Seconds) -> None:
        """Tell what somebody says into the robot's turn; that it begins, once. speech: its start."""
        words, stamp, key = self.text_of(person, speech), self.stamp, SpeechStart(person, speech)
        if (former := self._formerly.pop(key, None)) is not None:
            self._interjected[key] = former
        before = self._interjected.get(key)
        if before is not None and (reading == "open" or (before.reading, before.words) == (reading, words)):
            return
        told = Interjection(
            actor=person, since=stamp(speech), at=stamp(max(at, self.now)), reading=reading, words=words
        )
        self._interjected[key] = told
        self.effects.append(told)

    def remember(self, told: Interjection) -> None:
        """Take this as told by a former life. It decides nothing: that life knew of more words of the robot."""
        self._formerly[SpeechStart(told.actor, told.since.seconds)] = told

    def decide_interjection(self, person: str, speech: Seconds, reading: InterjectionReading, at: Seconds) -> None:
        """Tell what it is that somebody says into the robot's turn, if that it began has been told, and no more."""
        told = self._interjected.get(SpeechStart(person, speech))
        if told is not None and told.reading in ("open", "noise"):
            self.interject(person, speech, reading, at)

    def interject_again(self, person: str, speech: Seconds, at: Seconds) -> None:
        """Tell once more what somebody has said into the robot's turn if its words are others by now."""
        told, words = self._interjected.get(SpeechStart(person, speech)), self.text_of(person, speech)
        if told is not None and words != told.words:
            self.interject(person, speech, told.reading, at)

    def understand(self, person: str, speech: Seconds, text: str, at: Seconds) -> None:
        """Take the words of a speech, known at `at`. Events that consist of it are told again if they have others."""
        self._texts[SpeechStart(person, speech)] = text
        for event, told in tuple(self._spoken.values()):
            if (person, speech) not in event.spoken:
                continue
            words = self._words_of(event)
            is_too_late = event.id not in self._open and at > (event.changed or at) + self._words_patience
            if words != told.words and not is_too_late:
                # An event's times never run backwards, but `changed` stays: it says when the event itself changed.
                when = self.stamp(max(at, told.at.seconds))
                told = replace(told, words=words, at=when, retold=True)
                self._spoken[event.id] = (event, told)
                self.effects.append(told)

    def text_of(self, person: str, speech: Seconds) -> str:
        """Words of a speech, as far as they are known; "": none."""
        return self._texts.get(SpeechStart(person, speech), "")

    def _forget_spoken(self, at: Seconds) -> None:
        """Forget the events that are not told again, whatever may become known of their words."""
        while self._spoken:
            id, (event, _) = next(iter(self._spoken.items()))
            if id in self._open or (event.changed or at) + self._words_patience >= at:
                return
            del self._spoken[id]

    def _words_of(self, event: OngoingEvent) -> str:
        return " ".join(filter(None, map(self._texts.get, event.spoken)))

    def has_open(self, person: str) -> bool:
        """True if an event with `person` is open."""
        return any(person in (event.initiator, event.responder) for event in self._open.values())

    def lose(self, person: str, at: Seconds) -> None:
        """End the open events with `person` as lost."""
        for event in [event for event in self._open.values() if person in (event.initiator, event.responder)]:
            self.publish(event, "lost", at)

    def join(self, other: str, kept: str) -> None:
        """Take what a person has said by another id as theirs."""

        def named(speech: SpeechStart) -> SpeechStart:
            return SpeechStart(kept, speech.since) if speech.actor == other else speech

        for remembered in (self._texts, self._interjected, self._formerly):
            for speech in [each for each in remembered if each.actor == other]:
                told: Any = remembered.pop(speech)
                if named(speech) not in remembered:
                    remembered[named(speech)] = told
        for event, _ in self._spoken.values():
            event.spoken = tuple(map(named, event.spoken))

    def answer(self, request: str, event: str, at: Seconds) -> None:
        """Answer a request with an event that has been published already."""
        self.effects.append(EventOutcome(id=request, event=event, state="succeeded", at=self.stamp(at)))


class Machine:
    """One recognizer: its state and its ongoing event."""

    TABLE: ClassVar[Table]

    def __init__(self, writer: EventWriter) -> None:
        self.state = IDLE
        self.event: OngoingEvent | None = None
        self._writer = writer

    def step(self, given: str, at: Seconds) -> None:
        """Take one transition and publish what its row says.

        Raises UndefinedTransition, and changes nothing, if there is no row.
        """
        row = self.TABLE.get((self.state, given))
        if row is None:
            raise UndefinedTransition(f"{type(self).__name__}: no {given!r} in state {self.state!r}")
        self.state = row.next
        for state in row.publishes:
            assert self.event is not None, f"{type(self).__name__}: {given!r} publishes, but no event is under way"
            self._writer.publish(self.event, state, at)
        if self.state == IDLE:
            self.event = None

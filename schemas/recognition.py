"""Connection events, the requests for them, and their statistics. Thesis chapter 2."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import Action, Cause, Event, EventKind, TurnSignal
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Degrees, Probability, Seconds, Stamp

EventState = Literal["started", "succeeded", "failed", "preempted", "withdrawn", "superseded", "completed", "lost"]
"""`lost`: the end of the event is unknown. Readers end all open events so when recognition has died (`PeerGone`);
recognition does so when it has lost track of the person by a mistake of its own."""
ENDINGS: frozenset[EventState] = frozenset({"failed", "preempted", "withdrawn", "superseded", "completed", "lost"})
"""Last states of an event: nothing follows them."""


def session_of(run: str) -> str:
    """First part of the ids of events, up to the `-`: it names the life of recognition that they are from.

    run: id of that life, as on its liveliness token.
    """
    return run[:8]


class ConnectionEvent(Struct, frozen=True, kw_only=True, tag="connection_event", omit_defaults=True):
    """evt: one change in the life of a connection event; the same id from `started` to the end.

    id: made by recognition. kind: which of the four. state: the one that it has now.
    initiator: actor id of the one that began it. responder: actor id of the one that is to answer.
    started: when it began: of a gaze, when the initiator's look had arrived. objects: ids of what it is about.
    one_of: it is about one of the objects; which one the person looks at could not be told.
    cause: what it was begun for; `human`: a person began it. optional: its failure does not count.
    delay: seconds from the initiator's start to the responder's start; of an adjacency pair from the end of the turn,
    and negative for an early answer; of a failed event from its start to its failure; None while undecided and for
    backchannels.
    duration: seconds of the shared phase, when `completed`.
    block: the block that asked for the event, if the robot began it.
    turn: the robot's turn that opened it, for an adjacency pair.
    """

    id: str
    kind: EventKind
    initiator: str
    responder: str
    state: EventState
    at: Stamp
    """Instant of this change."""
    started: Stamp
    objects: tuple[str, ...] = ()
    one_of: bool = False
    cause: Cause = "human"
    optional: bool = False
    delay: Seconds | None = None
    delay_error: Seconds | None = 0.0
    """Greatest error of `delay`, if clocks of several machines are in it; None: these clocks are not measured yet."""
    duration: Seconds | None = None
    limit: Seconds | None = None
    """Time that the responder has, when `started`."""
    response: Action | None = None
    """Adjacency pair: the action that answered. Of a failed one: the answer that came after the limit, before anybody
    began another turn; `delay` is then that of this answer."""
    answered_by: str = ""
    """Adjacency pair of the robot that was asked of several people, or `preempted`: the person who answered. One that
    another of those who were asked has answered is `succeeded`, too, but counts for nobody."""
    confidence: Probability = 1.0
    """Least confidence of the observations by which it began and was answered; so far, when `started`."""
    block: str = ""
    behavior: str = ""
    """The event behavior of that block."""
    turn: str = ""
    words: str = ""
    """Words of the person that opened or answered the event, as far as they are known."""
    retold: bool = False
    """True: the event came to this state before. Since then `words` have become known or were corrected, a failed
    pair was answered late (`response`), or the person is known by another id (`initiator`, `responder`)."""

    def person(self, robot: str) -> str:
        """Actor id of the person who takes part in it. robot: the robot's own actor id."""
        return self.responder if self.initiator == robot else self.initiator

    @property
    def is_answered_by_another(self) -> bool:
        """True of a question that somebody else than its responder has answered: it says nothing of that person."""
        return self.answered_by not in ("", self.responder)

    @property
    def session(self) -> str:
        """Life of recognition that the event is from: the first part of its id."""
        return self.id.partition("-")[0]


class OpenEvents(Struct, frozen=True, kw_only=True, tag="open_events", omit_defaults=True):
    """state: recognition. All open events with a person, each with its last change, the oldest first.

    Published after each change of an event, at the same instant, so that its reader knows all earlier changes.

    session: first part of the events' ids: the life of recognition that they are from.
    """

    actor: str
    session: str
    at: Stamp
    events: tuple[ConnectionEvent, ...] = ()


InterjectionReading = Literal["open", "backchannel", "interruption", "answer", "noise", "other"]


class Interjection(Struct, frozen=True, kw_only=True, tag="interjection", omit_defaults=True):
    """evt: recognition. What a person says into the robot's turn: told at once, and again when it is decided.

    actor: the person. since: when the speech began; of one person it names the speech. at: when this was known.
    reading: `open`: it may be any of these. `backchannel`: a listener's "uh-huh". `interruption`: it takes the floor.
    `answer`: it goes on when the turn is over. `noise`: a laugh or a cough, of which no words have come. `other`: it
    is for somebody else.
    words: as far as they are known.
    """

    actor: str
    since: Stamp
    at: Stamp
    reading: InterjectionReading
    words: str = ""


class FloorSpeech(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A speech. actor: who speaks. to: ids of its addressees; empty: they are not known yet.

    until: None: it goes on.
    """

    actor: str
    since: Stamp
    to: tuple[str, ...] = ()
    until: Stamp | None = None


class Floor(Struct, frozen=True, kw_only=True, tag="floor", omit_defaults=True):
    """state: recognition. Who has the floor.

    at: the instant of the last change. speeches: all that go on, the first first; the others overlap it.
    ended: the last four that are over and of which it is known to whom they were, in the order of their ends. Of a
    short speech that is known only when it is over.
    """

    at: Stamp
    speeches: tuple[FloorSpeech, ...] = ()
    ended: tuple[FloorSpeech, ...] = ()


class SamePerson(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Another id of a person. actor: this id. name: the one by which the person is told of.

    is_guess: it was first seen where the person had just been lost. Else perception has said so.
    """

    actor: str
    name: str
    is_guess: bool = False


class SamePeople(Struct, frozen=True, kw_only=True, tag="same_people", omit_defaults=True):
    """state: recognition. The people of whom perception tells by several ids.

    What perception tells of the other ids is of the person with this name, and so is what the robot does to them.

    at: the instant of the last change. people: all other ids, those that have been known for longest first.
    """

    at: Stamp
    people: tuple[SamePerson, ...] = ()


class RequestEvent(Request, frozen=True, kw_only=True, tag="request_event", omit_defaults=True):
    """cmd: realizer -> recognition: begin a connection event (thesis Fig. 5.2). Terminal state: `EventOutcome`.

    Refused if it is invalid (unknown actor, no objects).

    at: when the robot set out: the realizer released it then. A gaze event starts when it has arrived.
    """

    block: str
    event: Event
    at: Stamp


class SignalTurn(Request, frozen=True, kw_only=True, tag="signal_turn", omit_defaults=True):
    """cmd: realizer or generation -> recognition: what became of a turn. Ends at once, in `TurnOutcome`."""

    signal: TurnSignal
    at: Stamp
    block: str = ""


class EventOutcome(Outcome, frozen=True, kw_only=True, tag="event_outcome", omit_defaults=True):
    """evt: recognition -> requester: how the event was decided. Terminal state of `RequestEvent`."""

    event: str
    """Id of the connection event."""
    state: EventState
    at: Stamp
    delay: Seconds | None = None
    delay_error: Seconds | None = 0.0
    """Greatest error of `delay`: `ConnectionEvent.delay_error`."""
    response: Action | None = None


class TurnOutcome(Outcome, frozen=True, kw_only=True, tag="turn_outcome", omit_defaults=True):
    """evt: terminal state of `SignalTurn`."""

    at: Stamp


class KindStatistics(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Numbers of one kind of event, as in thesis Table 2.1. Optional, preempted and withdrawn events do not fail.

    delay_min, delay_mean, delay_max: of the events that succeeded.
    failure_rate: share of the failed among the succeeded and failed.
    failed_delay_min, failed_delay_mean, failed_delay_max: of the failed, from start to failure.
    """

    kind: EventKind
    count: int = 0
    succeeded: int = 0
    failed: int = 0
    delay_min: Seconds | None = None
    delay_mean: Seconds | None = None
    delay_max: Seconds | None = None
    failure_rate: Probability | None = None
    failed_delay_min: Seconds | None = None
    failed_delay_mean: Seconds | None = None
    failed_delay_max: Seconds | None = None
    delay_error: Seconds = 0.0
    """Greatest known error of these delays: `ConnectionEvent.delay_error`."""


class WindowStatistics(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Numbers of a whole session or a recent window. Times between events are differences of successive starts."""

    kinds: tuple[KindStatistics, ...] = ()
    mtbce: Seconds | None = None
    """Mean time between connection events."""
    mtbce_without_maintenance: Seconds | None = None
    """MTBCE without the events that the maintenance policy caused."""
    max_gap: Seconds | None = None
    events: int = 0
    last_start: Stamp | None = None
    last_start_without_maintenance: Stamp | None = None


EngagementLevel = Literal["engaged", "engaging", "disengaging", "disengaged", "unknown"]


class PersonContact(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Contact of a person with the robot: looks at it, talk with it, shared looks.

    now: how much there is of it; None: nobody tells of looks. share: of the last seconds, up to the instant of the
    statistics. ended: when the last contact did; None: none has, as far as is known.
    """

    now: Probability | None = None
    share: Probability = 0.0
    ended: Stamp | None = None


Angles = tuple[Degrees, Degrees]
"""To a person's left and up, from the line between this person's eyes and the robot's face."""


class SureLook(Struct, frozen=True, kw_only=True):
    """Look of a person at something that was known.

    head: where the head pointed. aim: where that was. spread: deviation of the head, as it was stated.
    """

    head: Angles
    aim: Angles
    spread: Angles


class HeadHabit(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Habit of a head: how it points beside what this person looks at, degrees to their left and up.

    offset: of the robot's face from the head of who looks at it. behind: share of the way to what is aside of it that
    the head does not go. deviation: of a look that is mended by both. looks: from which that is known, the latest.
    """

    offset: Angles
    behind: tuple[float, float]
    deviation: Angles
    looks: tuple[SureLook, ...] = ()


class Statistics(Struct, frozen=True, kw_only=True, tag="statistics", omit_defaults=True):
    """state: recognition. Statistics of the connection events with one person, or with all, and their engagement.

    actor: id of the person; empty: all together. at: the instant that the numbers are for.
    session: since the beginning. recent: of the last seconds, `window` of the configuration.
    engagement: estimate in 0..1; None: too little is known. level: the same in a word. reasons: why, in words.
    busy: the person is busy with a task, so that silence is no sign of less engagement.
    busy_until: when the last task was over. level_since: when the level became what it is; of both None: not known.
    contact: contact of the person with the robot. head: what has been learned of this person's head; None: nothing.
    """

    actor: str
    at: Stamp
    session: WindowStatistics
    recent: WindowStatistics
    engagement: Probability | None = None
    level: EngagementLevel = "unknown"
    reasons: tuple[str, ...] = ()
    busy: bool = False
    busy_until: Stamp | None = None
    level_since: Stamp | None = None
    contact: PersonContact = PersonContact()
    head: HeadHabit | None = None

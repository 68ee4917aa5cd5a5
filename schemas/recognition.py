"""Connection events, the requests for them, and their statistics. Thesis chapter 2."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import Action, Cause, Event, EventKind, TurnSignal
from engage_hri.schemas.requests import Outcome, Request
from engage_hri.schemas.units import Probability, Seconds, Stamp

EventState = Literal["started", "succeeded", "failed", "preempted", "withdrawn", "superseded", "completed", "lost"]
"""`lost`: nobody knows what became of the event. Readers end so what was open when recognition died, of which
`PeerGone` tells them; recognition itself does when it has lost track of the person by a mistake of its own."""
ENDINGS: frozenset[EventState] = frozenset({"failed", "preempted", "withdrawn", "superseded", "completed", "lost"})
"""The last state of an event: nothing follows it."""


def session_of(run: str) -> str:
    """What the ids of events begin with, up to the first `-`: from which life of recognition they are.

    run: as on its liveliness token.
    """
    return run[:8]


class ConnectionEvent(Struct, frozen=True, kw_only=True, tag="connection_event", omit_defaults=True):
    """evt: one change in the life of a connection event; the same id from `started` to the end.

    id: made up by recognition. kind: which of the four. state: what has just become of it.
    initiator, responder: who began it, and who is to answer: actor ids, one of them the robot's.
    started: when it began. objects: ids of what it is about.
    cause: what it was begun for; `human`: a person began it. optional: does its failure count?
    delay: responder's start - initiator's start (adjacency pair: from the end of the turn, may be negative), seconds;
    of a failed event the time from its start to its failure; None while undecided and for backchannels.
    duration: of the shared phase, seconds, when `completed`.
    block: of an event that the robot began, the block that asked for it.
    turn: of an adjacency pair, the robot's turn that opened it.
    """

    id: str
    kind: EventKind
    initiator: str
    responder: str
    state: EventState
    at: Stamp
    """When this change happened."""
    started: Stamp
    objects: tuple[str, ...] = ()
    cause: Cause = "human"
    optional: bool = False
    delay: Seconds | None = None
    duration: Seconds | None = None
    limit: Seconds | None = None
    """How long the responder has, when `started`."""
    response: Action | None = None
    """Adjacency pair: which action answered."""
    confidence: Probability = 1.0
    """The least of the observations of the person that began and answered it; so far, when `started`."""
    block: str = ""
    behavior: str = ""
    """The event behavior of that block."""
    turn: str = ""

    def person(self, robot: str) -> str:
        """Who takes part in it with the robot: an actor's id.

        robot: the robot's own actor id.
        """
        return self.responder if self.initiator == robot else self.initiator

    @property
    def session(self) -> str:
        """Which life of recognition the event is from: what its id begins with."""
        return self.id.partition("-")[0]


class OpenEvents(Struct, frozen=True, kw_only=True, tag="open_events", omit_defaults=True):
    """state: recognition. All events with a person that have not ended, each with its last change, oldest first.

    Follows each change on the stream of events, in the same moment: whoever has read it knows every change that came
    before it. session: what the ids begin with.
    """

    actor: str
    session: str
    at: Stamp
    events: tuple[ConnectionEvent, ...] = ()


class RequestEvent(Request, frozen=True, kw_only=True, tag="request_event", omit_defaults=True):
    """cmd: realizer -> recognition (thesis Fig. 5.2). Refused when invalid (unknown actor, no objects).

    at: when the event began, that is when the realizer released it.
    """

    block: str
    event: Event
    at: Stamp


class SignalTurn(Request, frozen=True, kw_only=True, tag="signal_turn", omit_defaults=True):
    """cmd: realizer or generation -> recognition. Ends at once."""

    signal: TurnSignal
    at: Stamp
    block: str = ""


class EventOutcome(Outcome, frozen=True, kw_only=True, tag="event_outcome", omit_defaults=True):
    """evt: recognition -> requester: the decision. Terminal state of `RequestEvent`."""

    event: str
    """Id of the connection event."""
    state: EventState
    at: Stamp
    delay: Seconds | None = None
    response: Action | None = None


class TurnOutcome(Outcome, frozen=True, kw_only=True, tag="turn_outcome", omit_defaults=True):
    """evt: terminal state of `SignalTurn`."""

    at: Stamp


class KindStatistics(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Table 2.1, one kind. Optional, preempted and withdrawn events never count as failures.

    delay: of the succeeded; failed_delay: of the failed, from start to failure. failure_rate: of both together.
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


class WindowStatistics(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """Whole session or recent window. Times between events are differences of successive starts."""

    kinds: tuple[KindStatistics, ...] = ()
    mtbce: Seconds | None = None
    """Mean time between connection events."""
    mtbce_without_maintenance: Seconds | None = None
    """The same without the glances the maintenance policy caused itself."""
    max_gap: Seconds | None = None
    events: int = 0
    last_start: Stamp | None = None
    last_start_without_maintenance: Stamp | None = None


class Statistics(Struct, frozen=True, kw_only=True, tag="statistics", omit_defaults=True):
    """state: recognition. How the connection events with one person, or all, come and go.

    actor: id of the person; empty: all together. at: when this was true.
    session: since the beginning. recent: of the last seconds, `window` of the configuration.
    engagement: estimate in 0..1; None: too little is known. level: the same in a word. reasons: why, in words.
    busy: are they busy with a task? Then nothing is concluded from silence.
    """

    actor: str
    at: Stamp
    session: WindowStatistics
    recent: WindowStatistics
    engagement: Probability | None = None
    level: Literal["engaged", "weakening", "disengaged", "unknown"] = "unknown"
    reasons: tuple[str, ...] = ()
    busy: bool = False

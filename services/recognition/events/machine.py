"""What the four recognizers share: a transition table as data, the event that is under way, and where it is told.

A row says which state an input leads to and which changes of the connection event are published on the way.
Guards are part of the input's name (`robot_directs_shared`), so that table and diagram tell everything.
"""

from collections.abc import Iterable, Mapping
from typing import ClassVar, NamedTuple

from msgspec import Struct

from engage_hri.schemas.behaviors import Action, Cause, EventKind
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, EventOutcome, EventState, TurnOutcome
from engage_hri.schemas.requests import Accepted, Refused
from engage_hri.schemas.units import Probability, Seconds, Stamp


class Forgotten(NamedTuple):
    """A person who has been gone for long. Who comes with this id from now on is somebody new."""

    actor: str


class Mishap(NamedTuple):
    """A bug has shown while something happened; `actor` is whom it concerned, empty: nobody in particular.

    The person's open events have ended as lost; nothing else has.
    """

    actor: str
    at: Seconds
    error: Exception


Effect = ConnectionEvent | EventOutcome | TurnOutcome | Accepted | Refused | Forgotten | Mishap
IDLE = "idle"
DECISIONS: frozenset[EventState] = frozenset({"succeeded", "failed", "preempted", "withdrawn", "superseded"})
DECIDED: frozenset[EventState] = DECISIONS | {"lost"}
"""What answers a request."""
PREFIX: Mapping[EventKind, str] = {
    "directed_gaze": "dg", "mutual_facial_gaze": "mfg", "adjacency_pair": "ap", "backchannel": "bc",
}  # fmt: skip


class UndefinedTransition(Exception):
    """The table has no row for this input in this state. Nothing has changed."""


class Row(NamedTuple):
    state: str
    given: str
    next: str
    publishes: tuple[EventState, ...] = ()


Table = Mapping[tuple[str, str], Row]


def table(*rows: Row) -> Table:
    """Rows by state and input. Raises ValueError if two rows answer the same input."""
    by_input = {(row.state, row.given): row for row in rows}
    if len(by_input) != len(rows):
        raise ValueError("two rows for the same state and input")
    return by_input


def diagram(rows: Iterable[Row]) -> str:
    """The table as a Mermaid state diagram."""
    lines = ["stateDiagram-v2", f"    [*] --> {IDLE}"]
    for row in rows:
        told = f" / {', '.join(row.publishes)}" if row.publishes else ""
        lines.append(f"    {row.state} --> {row.next} : {row.given}{told}")
    return "\n".join(lines) + "\n"


class UnderWay(Struct, kw_only=True):
    """A connection event between its start and its end; what `ConnectionEvent` will say about it."""

    kind: EventKind
    initiator: str
    responder: str
    started: Seconds
    objects: tuple[str, ...] = ()
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
    confidence: Probability = 1.0
    """The least of the observations it rests on."""
    changed: Seconds | None = None

    def rests_on(self, confidence: Probability) -> None:
        """One more observation has contributed."""
        self.confidence = min(self.confidence, confidence)


class EventWriter:
    """Numbers the events and turns their changes into messages, in `effects`.

    clock: of the stamps. session: prefix of the ids, so that a restarted service never reuses one.
    """

    def __init__(self, clock: str, session: str = "") -> None:
        self.effects: list[Effect] = []
        self._clock = clock
        self._session = session
        self._count: dict[EventKind, int] = dict.fromkeys(PREFIX, 0)
        self._open: dict[str, UnderWay] = {}
        """What has been told of and not ended, by id."""

    def take(self) -> list[Effect]:
        """What happened since the last call."""
        taken, self.effects = self.effects, []
        return taken

    def stamp(self, at: Seconds) -> Stamp:
        return Stamp(self._clock, at)

    def publish(self, event: UnderWay, state: EventState, at: Seconds) -> None:
        """Tell a change, and answer the event's request if this decides it. An event's times never run backwards."""
        if not event.id:
            self._count[event.kind] += 1
            event.id = f"{self._session}{PREFIX[event.kind]}-{self._count[event.kind]}"
        at = event.changed = max(at, event.started if event.changed is None else event.changed)
        if state == "failed":
            event.delay = at - event.started
        begins, ends = state == "started", state == "completed"
        self.effects.append(
            ConnectionEvent(
                id=event.id, kind=event.kind, initiator=event.initiator, responder=event.responder, state=state,
                at=self.stamp(at), started=self.stamp(event.started), objects=event.objects, cause=event.cause,
                optional=event.optional, delay=None if begins else event.delay,
                duration=event.duration if ends else None, limit=event.limit if begins else None,
                response=None if begins else event.response, confidence=event.confidence,
                block=event.block, behavior=event.behavior, turn=event.turn,
            )
        )  # fmt: skip
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

    def lose(self, person: str, at: Seconds) -> None:
        """Nobody will know what became of the open events with `person`."""
        for event in [event for event in self._open.values() if person in (event.initiator, event.responder)]:
            self.publish(event, "lost", at)

    def answer(self, request: str, event: str, at: Seconds) -> None:
        """Answer a request with an event that has been published already."""
        self.effects.append(EventOutcome(id=request, event=event, state="succeeded", at=self.stamp(at)))


class Machine:
    """One recognizer: its state, the event under way, and when it must be woken (`deadline`, then `expire`)."""

    TABLE: ClassVar[Table]

    def __init__(self, writer: EventWriter) -> None:
        self.state = IDLE
        self.event: UnderWay | None = None
        self._writer = writer

    @property
    def deadline(self) -> Seconds | None:
        """When something happens by itself, unless an input comes first."""
        return None

    def expire(self, at: Seconds) -> None:
        """`deadline` has passed; at: that instant."""

    def step(self, given: str, at: Seconds) -> None:
        """Take one transition and publish what its row says.

        An undefined one changes nothing and raises UndefinedTransition.
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

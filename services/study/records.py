"""Records of one session, from the messages on the bus alone: the rows of events.csv and sessions.csv."""

from itertools import pairwise
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behaviors import Cause, EventKind
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost
from engage_hri.schemas.recognition import ConnectionEvent, KindStatistics, Statistics, WindowStatistics
from engage_hri.schemas.units import Probability, Seconds

Outcome = Literal["succeeded", "failed", "preempted", "withdrawn", "superseded", "open"]


class EventRecord(Struct, frozen=True, kw_only=True):
    """One connection event: a row of events.csv, whose columns are these fields."""

    session: int
    condition: str
    kind: EventKind
    initiator: str
    cause: Cause
    outcome: Outcome
    """`open`: the session was broken off before it was decided."""
    optional: bool
    start: Seconds
    """Seconds since the session's beginning."""
    delay: Seconds | None
    """Delay as in `ConnectionEvent`: of a failed event from start to failure."""


class EyeContact(Struct, frozen=True, kw_only=True):
    """Share of each third of the session in which the person looks at the robot's face, 0..1."""

    first: Probability
    second: Probability
    last: Probability

    @property
    def change(self) -> float:
        """Change from the first third to the last."""
        return self.last - self.first


class SessionRecord(Struct, frozen=True, kw_only=True):
    """A session in numbers. statistics: the last that recognition published."""

    session: int
    condition: str
    seed: int
    finished: bool
    reason: str = ""
    """Reason why it is not finished; empty if it is."""
    duration: Seconds = 0.0
    completion_time: Seconds | None = None
    """Time from the person's arrival until the last piece lay."""
    adjacency_pairs_every: Seconds | None = None
    """Mean time between the starts of adjacency pairs."""
    eye_contact: EyeContact | None = None
    statistics: WindowStatistics = WindowStatistics()

    def of(self, kind: EventKind) -> KindStatistics:
        found = (numbers for numbers in self.statistics.kinds if numbers.kind == kind)
        return next(found, KindStatistics(kind=kind))


class SessionRecorder:
    """Sink that records a session. Instants count from the session's beginning."""

    def __init__(self, robot: str) -> None:
        self._robot = robot
        self._events: dict[str, ConnectionEvent] = {}
        self._statistics = WindowStatistics()
        self._looking_since: Seconds | None = None
        self._looks: list[tuple[Seconds, Seconds]] = []
        self._came: Seconds | None = None
        self._left: Seconds | None = None
        self._last_placed: Seconds | None = None
        self._now: Seconds = 0.0

    def __call__(self, message: Message, at: Seconds) -> None:
        self._now = max(self._now, at)
        match message:
            case ConnectionEvent(id=id, state=state):
                if state != "completed" or id not in self._events:  # the decision is what counts
                    self._events[id] = message
            case Statistics(actor="", session=session):
                self._statistics = session
            case ActorFound():
                self._came = at if self._came is None else self._came
                self._left = None
            case ActorLost():
                self._look_ends(at)
                self._left = at
            case ActionBegan(actor=actor, action="look", targets=targets) if actor != self._robot:
                if self._robot not in targets:
                    self._look_ends(at)
                elif self._looking_since is None:
                    self._looking_since = at
            case ActionEnded(actor=actor, action="look", targets=targets) if actor != self._robot:
                if self._robot in targets:
                    self._look_ends(at)
            case ActionEnded(actor=actor, action="act") if actor != self._robot:
                self._last_placed = at

    def _look_ends(self, at: Seconds) -> None:
        if self._looking_since is not None:
            self._looks.append((self._looking_since, at))
            self._looking_since = None

    def session(self, *, session: int, condition: str, seed: int, reason: str = "") -> SessionRecord:
        """Record of the session so far. reason: why it was broken off, if it was."""
        self._look_ends(self._now)
        completion = None
        if self._came is not None and self._last_placed is not None and not reason:
            completion = self._last_placed - self._came
        pairs = sorted(event.started.seconds for event in self._events.values() if event.kind == "adjacency_pair")
        return SessionRecord(
            session=session, condition=condition, seed=seed, finished=not reason, reason=reason, duration=self._now,
            completion_time=completion,
            adjacency_pairs_every=(pairs[-1] - pairs[0]) / (len(pairs) - 1) if len(pairs) > 1 else None,
            eye_contact=self._eye_contact(), statistics=self._statistics,
        )  # fmt: skip

    def events(self, *, session: int, condition: str) -> tuple[EventRecord, ...]:
        """Records of the connection events, in the order of their starts."""
        events = sorted(self._events.values(), key=lambda event: event.started.seconds)
        return tuple(
            EventRecord(
                session=session, condition=condition, kind=event.kind, initiator=event.initiator, cause=event.cause,
                outcome=_outcome(event), optional=event.optional, start=event.started.seconds, delay=event.delay,
            )
            for event in events
        )  # fmt: skip

    def _eye_contact(self) -> EyeContact | None:
        """Eye contact in each third; None without a person, or if the person left at once."""
        if self._came is None:
            return None
        end = self._now if self._left is None else self._left
        third = (end - self._came) / 3
        if third <= 0:
            return None
        bounds = [self._came + third * number for number in range(3)] + [end]
        first, second, last = (self._share(since, until) for since, until in pairwise(bounds))
        return EyeContact(first=first, second=second, last=last)

    def _share(self, since: Seconds, until: Seconds) -> Probability:
        looked = sum(max(0.0, min(end, until) - max(start, since)) for start, end in self._looks)
        return looked / (until - since)


def _outcome(event: ConnectionEvent) -> Outcome:
    match event.state:
        case "started" | "lost":
            return "open"
        case "completed":
            return "succeeded"
        case decided:
            return decided

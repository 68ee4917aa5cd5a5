"""Courses over time: speeches, connection events, behaviors as planned and measured, engagement, MTBCE, delays. Pure.

Instants are seconds of the clock that feeds them. What ended long ago is forgotten.
"""

from collections import deque
from collections.abc import Collection, Mapping

from msgspec.structs import replace

from engage_hri.schemas.blocks import BlockProgress, NetPlanned, PlannedPoint, PredictionFeedback, SyncPointProgress
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import (
    ENDINGS,
    ConnectionEvent,
    EngagementLevel,
    EventState,
    Floor,
    Interjection,
    Statistics,
)
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.console.view import OWN_BLOCKS
from engage_hri.services.console.web import sections
from engage_hri.services.console.web.sections import Zero
from engage_hri.services.console.wording import READINGS

KEPT: Seconds = 90.0
"""Time for which what has ended is kept."""
MOST = 80
"""Blocks and events that are kept at most."""
LOST = "lost"
"""Status of a block whose realizer has gone from the bus in the middle of it."""


class EventLanes:
    """Connection events that are open or ended lately."""

    def __init__(self) -> None:
        self._events: dict[str, _Event] = {}

    def feed(self, event: ConnectionEvent, at: Seconds) -> None:
        """Take a change of an event. at: its local instant."""
        known = self._events.setdefault(event.id, _Event(event, at))
        known.feed(event, at)
        ended = [id for id, each in self._events.items() if each.until is not None and at - each.until > KEPT]
        for id in (*ended, *list(self._events)[: max(0, len(self._events) - MOST)]):
            self._events.pop(id, None)

    def shown(self, zero: Zero) -> tuple[sections.EventShown, ...]:
        """The events, the oldest first."""
        return tuple(each.shown(zero) for each in self._events.values())


class _Event:
    def __init__(self, event: ConnectionEvent, at: Seconds) -> None:
        self.event = event
        self.since = at
        self.decision: EventState = "started"
        self.decided: Seconds | None = None
        self.until: Seconds | None = None
        self.delay: Seconds | None = None

    def feed(self, event: ConnectionEvent, at: Seconds) -> None:
        self.event = event
        if event.state != "started" and self.decided is None:
            self.decision, self.decided, self.delay = event.state, at, event.delay
        if event.state in ENDINGS and self.until is None:
            self.until = at

    def shown(self, zero: Zero) -> sections.EventShown:
        event = self.event
        return sections.EventShown(
            id=event.id, kind=event.kind, by=event.initiator, to=event.responder, about=event.objects,
            one_of=event.one_of, cause=event.cause, state=self.decision, optional=event.optional, delay=self.delay,
            limit=event.limit, since=zero(self.since), decided=_or_none(zero, self.decided),
            until=_or_none(zero, self.until),
        )  # fmt: skip


class FloorLanes:
    """Speeches that go on or ended lately, and what those into the robot's turns were taken for."""

    def __init__(self) -> None:
        self._speeches: dict[tuple[str, Stamp], sections.SpeechShown] = {}
        """By who speaks, and since when: that is the name of a speech. Instants are local."""

    def feed(self, message: Message, at: Seconds) -> bool:
        """Take a message. at: its local instant. Returns whether it may change what is shown."""
        known = self._speeches
        match message:
            case Floor(speeches=speeches, ended=ended):
                for each in (*ended, *speeches):
                    key = each.actor, each.since
                    until = None if each.until is None else at - (message.at.seconds - each.until.seconds)
                    known[key] = replace(known.get(key) or self._new(key, at, message.at), to=each.to, until=until)
                self._end(at, but={(each.actor, each.since) for each in speeches})
            case Interjection(actor=actor, since=since, reading=reading, words=words):
                speech = known.get((actor, since)) or self._new((actor, since), at, message.at, until=at)
                known[actor, since] = replace(speech, taken=READINGS[reading], words=words)
            case PeerGone(participant="recognition"):
                self._end(at, but=())
            case _:
                return False
        old = [key for key, each in known.items() if each.until is not None and at - each.until > KEPT]
        for key in (*old, *list(known)[: max(0, len(known) - MOST)]):
            known.pop(key, None)
        return True

    @staticmethod
    def _new(key: tuple[str, Stamp], at: Seconds, told: Stamp, until: Seconds | None = None) -> sections.SpeechShown:
        actor, since = key
        return sections.SpeechShown(actor, (), at - (told.seconds - since.seconds), until)

    def _end(self, at: Seconds, but: Collection[tuple[str, Stamp]]) -> None:
        for key, each in self._speeches.items():
            if each.until is None and key not in but:
                self._speeches[key] = replace(each, until=at)

    def shown(self, zero: Zero) -> tuple[sections.SpeechShown, ...]:
        """The speeches, in the order in which they were heard of."""
        told = self._speeches.values()
        return tuple(replace(each, since=zero(each.since), until=_or_none(zero, each.until)) for each in told)


class BlockLanes:
    """Blocks that run or ended lately, with their sync points."""

    def __init__(self) -> None:
        self._blocks: dict[str, _Block] = {}
        self._run = ""
        """Life of the realizer; empty: unknown."""

    def feed(self, message: BlockProgress | SyncPointProgress | PredictionFeedback | NetPlanned, at: Seconds) -> str:
        """Take feedback about a block, or its net. at: its local instant. Returns the id of the block, if any."""
        if message.block is None:
            return ""
        if isinstance(message, BlockProgress) and message.progress == "start":
            self._blocks.pop(message.block, None)  # A name may come again.
        block = self._blocks.setdefault(message.block, _Block(at - _since_start(message)))
        match message:
            case BlockProgress(progress="end"):
                block.until, block.status = at, message.status
            case SyncPointProgress():
                block.measured(message)
            case PredictionFeedback():
                for point in message.points:
                    block.planned(point)
            case NetPlanned():
                block.tie(message)
        return message.block

    def presence(self, message: PeerAlive | PeerGone, at: Seconds) -> tuple[str, ...]:
        """Take news of who is on the bus. Without its realizer no block goes on; the same life goes on with its own.

        Returns the ids of the blocks that this changes.
        """
        changed: list[str] = []
        match message:
            case PeerAlive(participant="realizer", run=run):
                if run == self._run:
                    changed = [id for id, block in self._blocks.items() if block.status == LOST]
                for id in changed:
                    self._blocks[id].until, self._blocks[id].status = None, ""
                self._run = run
            case PeerGone(participant="realizer"):
                changed = [id for id, block in self._blocks.items() if block.until is None]
                for id in changed:
                    self._blocks[id].until, self._blocks[id].status = at, LOST
        return tuple(changed)

    def forget(self, now: Seconds) -> tuple[str, ...]:
        """Forget what ended long ago. Returns the ids of these blocks."""
        old = [id for id, block in self._blocks.items() if block.until is not None and now - block.until > KEPT]
        gone = tuple(dict.fromkeys((*old, *list(self._blocks)[: max(0, len(self._blocks) - MOST)])))
        for id in gone:
            del self._blocks[id]
        return gone

    def shown(self, id: str, zero: Zero) -> sections.BlockLane:
        """The lane of a block that is known."""
        return self._blocks[id].shown(id, zero)


class _Point:
    __slots__ = ("first", "measured", "planned")

    def __init__(self) -> None:
        self.first: Seconds | None = None
        self.planned: Seconds | None = None
        self.measured: Seconds | None = None


class _Block:
    def __init__(self, since: Seconds) -> None:
        self.since = since
        self.until: Seconds | None = None
        self.status = ""
        self.points: dict[str, dict[str, _Point]] = {}
        self.types: dict[str, str] = {}
        self.ties: tuple[tuple[tuple[str, str], ...], ...] = ()

    def _point(self, behavior: str, sync: str) -> _Point:
        return self.points.setdefault(behavior, {}).setdefault(sync, _Point())

    def planned(self, planned: PlannedPoint) -> None:
        point = self._point(planned.behavior, planned.sync)
        point.first = planned.time if point.first is None else point.first
        if point.measured is None:
            point.planned = planned.time
        if planned.type:
            self.types[planned.behavior] = planned.type

    def measured(self, message: SyncPointProgress) -> None:
        point = self._point(message.behavior, message.sync)
        point.measured = message.time
        if message.predicted is not None:
            point.planned = message.predicted
            point.first = message.predicted if point.first is None else point.first

    def tie(self, net: NetPlanned) -> None:
        """Learn which sync points of several behaviors are one instant."""
        found = []
        for instant in net.transitions:
            one_of_each = {point.behavior: point.sync for point in instant.points if point.behavior}
            if len(one_of_each) > 1:
                found.append(tuple(one_of_each.items()))
        self.ties = tuple(found)

    def shown(self, id: str, zero: Zero) -> sections.BlockLane:
        def moved(time: Seconds | None) -> Seconds | None:
            return None if time is None else zero(self.since + time)

        lanes = [
            sections.BehaviorLane(
                id=name,
                type=self.types.get(name, ""),
                points=tuple(
                    sections.SyncShown(sync, moved(each.first), moved(each.planned), moved(each.measured))
                    for sync, each in points.items()
                ),
            )
            for name, points in self.points.items()
        ]
        return sections.BlockLane(
            id=id, since=zero(self.since), until=_or_none(zero, self.until), status=self.status,
            own=id.startswith(OWN_BLOCKS), behaviors=tuple(lanes), ties=self.ties,
        )  # fmt: skip


def _since_start(message: BlockProgress | SyncPointProgress | PredictionFeedback | NetPlanned) -> Seconds:
    """Time from the block's start to the instant that the message tells of."""
    return message.time if isinstance(message, BlockProgress | SyncPointProgress) else 0.0


def _or_none(zero: Zero, at: Seconds | None) -> Seconds | None:
    return None if at is None else zero(at)


VALUES_KEPT = 600
"""Values of a course that are kept."""
APART: Seconds = 0.5
"""Time of which a course keeps two values at most; the newest is always there."""
UNKNOWN: tuple[EngagementLevel, tuple[str, ...]] = ("unknown", ("recognition has left the bus",))
"""Level of everybody, with the reason, while there is no recognition."""
Course = deque[tuple[Seconds, float]]


class Measures:
    """Courses of all that is measured, by person; an empty name stands for all people."""

    def __init__(self) -> None:
        self._people: dict[str, _Person] = {}
        self._delays: deque[tuple[Seconds, float, str]] = deque(maxlen=VALUES_KEPT)
        self._life = ""
        """Life of recognition; empty: unknown."""
        self._left: dict[str, tuple[EngagementLevel, tuple[str, ...]]] = {}
        """Levels and reasons that recognition told last, while it is not there."""

    @property
    def people(self) -> Collection[str]:
        """All who are measured."""
        return self._people.keys()

    def feed(self, message: Statistics | ConnectionEvent, at: Seconds) -> bool:
        """Take a message; at: its local instant. Returns whether it told of anything that is shown."""
        match message:
            case Statistics(actor=actor, session=session, engagement=engagement):
                person = self._people.setdefault(actor, _Person())
                person.level, person.reasons = message.level, message.reasons
                _add(person.engagement, at, engagement)
                _add(person.mtbce, at, session.mtbce)
                return True
            case ConnectionEvent(state="succeeded", delay=float() as delay, kind=kind):
                self._delays.append((at, delay, kind))
                return True
        return False

    def forget(self, person: str) -> None:
        """Drop somebody who has been gone for long."""
        self._people.pop(person, None)
        self._left.pop(person, None)

    def presence(self, message: PeerAlive | PeerGone) -> bool:
        """Take news of who is on the bus: without recognition nobody's engagement is known. Another life of it tells
        everything anew; the same one goes on with what it had told. Returns whether anything has changed.
        """
        match message:
            case PeerGone(participant="recognition"):
                before = {actor: (each.level, each.reasons) for actor, each in self._people.items()}
                self._left = before or self._left
                self._set(dict.fromkeys(self._people, UNKNOWN))
            case PeerAlive(participant="recognition", run=run):
                if run == self._life:
                    self._set(self._left)
                self._life, self._left = run, {}
            case _:
                return False
        return True

    def _set(self, told: Mapping[str, tuple[EngagementLevel, tuple[str, ...]]]) -> None:
        for actor, (level, reasons) in told.items():
            self._people[actor].level, self._people[actor].reasons = level, reasons

    def shown(self, actor: str, zero: Zero) -> sections.PersonMeasures:
        """The courses of a person, with their instants in seconds of the picture."""
        person = self._people[actor]
        return sections.PersonMeasures(
            actor=actor,
            level=person.level,
            reasons=person.reasons,
            engagement=tuple((zero(at), value) for at, value in person.engagement),
            mtbce=tuple((zero(at), value) for at, value in person.mtbce),
        )

    def delays(self, zero: Zero) -> list[tuple[float, float, str]]:
        """Each delay, with the instant and the kind of its event."""
        return [(zero(at), delay, kind) for at, delay, kind in self._delays]


class _Person:
    def __init__(self) -> None:
        self.level: EngagementLevel = "unknown"
        self.reasons: tuple[str, ...] = ()
        self.engagement: Course = deque(maxlen=VALUES_KEPT)
        self.mtbce: Course = deque(maxlen=VALUES_KEPT)


def _add(course: Course, at: Seconds, value: float | None) -> None:
    if value is None:
        return
    if len(course) > 1 and at - course[-2][0] < APART:
        course.pop()  # too near to the one before it: the newest counts
    course.append((at, value))

"""Simulated cameras and a microphone: their reports of a person at the table, faults included.

Pure. `PersonAtTable` says exactly what happens. Perception tells it as actions (`SymbolicReports`), or tells only
head and voice (`RawReports`). Raw perception comes at every frame while the person sits there, and so does the world
if a fault makes it unsteady. Each fault (thesis 5.4.2) has its own source of chance, given from outside: turning one
on does not change the others.
"""

import math
from collections.abc import Callable, Iterable, Iterator
from typing import Protocol

from msgspec.structs import replace

from engage_hri.schemas.body import Ray, RobotSeen, RobotState
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import (
    ActionBegan,
    ActionEnded,
    ActorFound,
    ActorLost,
    HeadPose,
    Utterance,
    VoiceActivity,
)
from engage_hri.schemas.units import Seconds, Stamp, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.simulation.chance import Chance
from engage_hri.services.tangram.people.config import PerceptionFaults, SimulationConfig
from engage_hri.services.tangram.people.head import Sightlines, SimulatedHead, unit
from engage_hri.services.tangram.people.person_at_table import PersonAtTable, Stamper

# -- faults -------------------------------------------------------------------------------------------------------


FAINT = 0.3
"""Confidence in a covered thing, reported where it was seen last."""
Chances = Callable[[str], Chance]
"""Function from a name to a source of chance of its own."""


class FaceLoss:
    """Losses of the face by the tracker. Times must not go backward."""

    def __init__(self, faults: PerceptionFaults, chance: Chance) -> None:
        self._faults = faults
        self._chance = chance
        self._since: Seconds = math.inf
        self._until: Seconds = -math.inf

    def begin(self, now: Seconds) -> None:
        """Begin with a face that is there from now on."""
        self._plan(now)

    def lost(self, now: Seconds) -> bool:
        while now >= self._until and now >= self._since:
            self._plan(self._until)
        return now >= self._since

    def _plan(self, after: Seconds) -> None:
        if self._faults.lost_faces:
            self._since = after + self._chance.expovariate(self._faults.lost_faces / 60.0)
            self._until = self._since + self._chance.uniform(*self._faults.lost_for)


class TableVision:
    """View of the things on the table by a camera, which remembers where it has last seen each."""

    def __init__(self, faults: PerceptionFaults, chance: Chance) -> None:
        self._faults = faults
        self._chance = chance
        self._seen: dict[str, Entity] = {}

    def see(self, entities: Iterable[Entity]) -> tuple[Entity, ...]:
        """The entities as the camera reports them in one frame."""
        things = tuple(entities)
        hands = [thing.position for thing in things if thing.kind == "hand"]
        return tuple(seen for thing in things if (seen := self._piece(thing, hands)) is not None)

    def _piece(self, thing: Entity, hands: list[Vector]) -> Entity | None:
        if thing.kind != "object":
            return thing
        if any(math.dist(hand[:2], thing.position[:2]) < self._faults.occlusion for hand in hands):
            last = self._seen.get(thing.id)
            return replace(last, confidence=FAINT) if last and self._faults.covered == "faint" else None
        seen = self._seen[thing.id] = self._mismeasured(thing)
        return seen

    def _mismeasured(self, piece: Entity) -> Entity:
        if not self._faults.position and not self._faults.yaw:
            return piece
        x, y, z = piece.position
        x += self._chance.gauss(0.0, self._faults.position)
        y += self._chance.gauss(0.0, self._faults.position)
        turned = math.radians(self._chance.gauss(0.0, self._faults.yaw))
        return replace(piece, position=(x, y, z), yaw=math.remainder(piece.yaw + turned, math.tau))


def deviated(direction: Vector, deviation: float, chance: Chance) -> Vector:
    """A unit vector near `direction`. deviation: standard deviation about each axis across it, in radians."""
    if not deviation:
        return direction
    x, y, z = (part + chance.gauss(0.0, deviation) for part in direction)
    return unit((x, y, z))


# -- reports about a person ---------------------------------------------------------------------------------------


HEAD_TURN: Seconds = 0.2
"""Time that the person's head takes to face another target. Ours."""


class Reports(Protocol):
    """Perception of one person."""

    def happened(self, message: Message, now: Seconds) -> Iterator[Message]:
        """Take an exact message of what the person did."""

    def seen(self, lost: bool, at: Stamp, now: Seconds) -> Iterator[Message]:
        """Take a frame of the camera. lost: it does not find the face."""

    def heard(self, at: Stamp, now: Seconds) -> Iterator[Message]:
        """Take a frame of the microphone."""


class Ear:
    """Hearing of utterances, some of which are missed.

    heard: True while one is heard. understood: the last one was heard, so its words are known.
    announced: the words of the next one will come, if that is heard.
    """

    def __init__(self, faults: PerceptionFaults, chances: Chances) -> None:
        self._dropped = faults.dropped_speech
        self._chance = chances("speech")
        self.heard = self.understood = False
        self.announced: Utterance | None = None

    def hear(self, message: ActionBegan | ActionEnded) -> Iterator[Message]:
        """Take the beginning or end of speech. Yields it if it is heard, behind the news that words will come."""
        announced, self.announced = self.announced, None
        if isinstance(message, ActionBegan):
            self.heard = self.understood = self._chance.random() >= self._dropped
            if self.heard and announced is not None:
                yield announced
            is_heard = self.heard
        else:
            is_heard, self.heard = self.heard, False
        if is_heard:
            yield message

    def understand(self, message: Utterance) -> Iterator[Message]:
        """Take words. Yields them if they were heard."""
        if not message.final:
            self.announced = message
        elif self.understood:
            yield message


class SymbolicReports:
    """Reports for `symbolic`: looks, speech and manipulations as such. Looks may be wrong or missed."""

    def __init__(self, sightlines: Sightlines, faults: PerceptionFaults, chances: Chances) -> None:
        self._sightlines = sightlines
        self._faults = faults
        self._chance = chances("looks")
        self._ear = Ear(faults, chances)
        self._look: ActionBegan | None = None
        """Present look as perceived; None if there is none, or it is missed."""
        self._reported: ActionBegan | None = None
        """Look that was reported last and not ended."""
        self._lost = False

    def happened(self, message: Message, now: Seconds) -> Iterator[Message]:
        match message:
            case ActionBegan(action="look"):
                self._look = self._noticed(message, now)
                if self._look is not None and not self._lost:
                    self._reported = self._look
                    yield self._reported
            case ActionEnded(action="look"):
                self._look = None
                if self._reported is not None and not self._lost:
                    yield replace(message, targets=self._reported.targets)
                    self._reported = None
            case ActorLost(at=at) if self._lost:
                if self._reported is not None:
                    yield ActionEnded(actor=message.actor, action="look", targets=self._reported.targets, at=at)
                self._lost, self._reported = False, None  # the loss was reported when the face was lost
            case (ActionBegan(action="speak") | ActionEnded(action="speak")) as speech:
                yield from self._ear.hear(speech)
            case Utterance():
                yield from self._ear.understand(message)
            case _:
                yield message

    def seen(self, lost: bool, at: Stamp, now: Seconds) -> Iterator[Message]:
        if lost == self._lost:
            return
        self._lost = lost
        actor = self._sightlines.person
        if lost:
            yield ActorLost(actor=actor, at=at)
            return
        yield ActorFound(actor=actor, at=at)
        if self._reported is self._look:
            return
        if self._reported is not None:
            yield ActionEnded(actor=actor, action="look", targets=self._reported.targets, at=at)
        if self._look is not None:
            yield replace(self._look, at=at)
        self._reported = self._look

    def heard(self, at: Stamp, now: Seconds) -> Iterator[Message]:
        yield from ()

    def _noticed(self, look: ActionBegan, now: Seconds) -> ActionBegan | None:
        missed = self._chance.random() < self._faults.missed_look
        wrong = self._chance.random() < self._faults.wrong_look
        if missed:
            return None
        if wrong and look.targets:
            return replace(look, targets=(self._sightlines.beside(look.targets[0], now),))
        return look


class RawReports:
    """Reports for `raw`: the head's pose and the voice. Manipulations show in the world; nods and points as such."""

    def __init__(self, sightlines: Sightlines, faults: PerceptionFaults, chances: Chances) -> None:
        self._sightlines = sightlines
        self._deviation = math.radians(faults.gaze)
        self._chance = chances("gaze")
        self._ear = Ear(faults, chances)
        self._head = SimulatedHead(HEAD_TURN)
        self._target = ""

    def happened(self, message: Message, now: Seconds) -> Iterator[Message]:
        match message:
            case ActionBegan(action="look", targets=targets):
                self._head.turn(self._facing(now), now)
                self._target = targets[0] if targets else ""
            case (ActionBegan(action="speak") | ActionEnded(action="speak")) as speech:
                yield from (told for told in self._ear.hear(speech) if isinstance(told, Utterance))
            case Utterance():
                yield from self._ear.understand(message)
            case ActionBegan(action="nod" | "shake" | "point") | ActionEnded(action="nod" | "shake" | "point"):
                yield message

    def seen(self, lost: bool, at: Stamp, now: Seconds) -> Iterator[Message]:
        if not lost:
            facing = deviated(self._facing(now), self._deviation, self._chance)
            yield HeadPose(actor=self._sightlines.person, position=self._sightlines.eyes, direction=facing, at=at)

    def heard(self, at: Stamp, now: Seconds) -> Iterator[Message]:
        yield VoiceActivity(actor=self._sightlines.person, active=self._ear.heard, at=at)

    def _facing(self, now: Seconds) -> tuple[float, float, float]:
        return self._head.facing(self._sightlines.to(self._target, now), now)


# -- all that is seen ---------------------------------------------------------------------------------------------


class Cameras:
    """Reports of `exact`, with the perception and the faults of `config`. The interface is the same."""

    def __init__(
        self, exact: PersonAtTable, sightlines: Sightlines, config: SimulationConfig, stamp: Stamper, chances: Chances
    ) -> None:
        faults = config.faults
        self._exact = exact
        self._sightlines = sightlines
        self._stamp = stamp
        self._frame = config.frame
        self._constant = config.perception == "raw" or faults.unsteady
        self._dropped = faults.dropped_frames
        self._chance = chances("frames")
        self._person: Reports = (
            RawReports(sightlines, faults, chances)
            if config.perception == "raw"
            else SymbolicReports(sightlines, faults, chances)
        )
        self._face = FaceLoss(faults, chances("faces"))
        self._vision = TableVision(faults, chances("table"))
        self._seen_eyes: Vector | None = None
        """Place of the robot's eyes, if it is not where the robot measures it."""
        self._entities: tuple[Entity, ...] = ()
        self._next_frame: Seconds | None = None
        """Time of the next frame; None while only changes are reported."""

    @property
    def deadline(self) -> Seconds | None:
        times = (self._exact.deadline, self._next_frame)
        return min((time for time in times if time is not None), default=None)

    def enter(self, now: Seconds) -> None:
        self._exact.enter(now)

    def feed(self, message: Message, now: Seconds) -> None:
        match message:
            case RobotSeen(gaze=gaze):
                self._seen_eyes = None if gaze is None else gaze.origin
                self._sightlines.robot_eyes = self._seen_eyes or self._sightlines.robot_eyes
                self._exact.feed(message, now)
            case RobotState() if self._seen_eyes is not None:
                pass  # people see where its eyes are, not where it measures them
            case RobotState(gaze=Ray(origin=eyes)):
                self._sightlines.robot_eyes = eyes
            case RobotState():
                pass  # without eyes people look where the robot stands
            case _:
                self._exact.feed(message, now)

    def world(self, now: Seconds) -> World:
        """The table as the cameras see it now."""
        return self._seen(self._exact.world(now))

    def advance(self, now: Seconds) -> Iterator[Message]:
        """Yield the reports that are due by now."""
        for message in self._exact.advance(now):
            match message:
                case World():
                    if self._next_frame is None:
                        yield self._seen(message)
                    continue
                case ActorFound():
                    self._face.begin(now)
                    self._next_frame = now if self._constant else None
                case ActorLost():
                    self._next_frame = None
            yield from self._person.happened(message, now)
        if self._next_frame is not None and now >= self._next_frame:
            self._next_frame = now + self._frame
            yield from self._take_frame(now)

    def _take_frame(self, now: Seconds) -> Iterator[Message]:
        at = self._stamp(now)
        lost, before = self._face.lost(now), self._entities
        if not self._drops():
            yield from self._person.seen(lost, at, now)
            world = self._seen(self._exact.world(now))
            if world.entities != before:
                yield world
        if not self._drops():
            yield from self._person.heard(at, now)

    def _drops(self) -> bool:
        return self._chance.random() < self._dropped

    def _seen(self, world: World) -> World:
        self._entities = self._vision.see(world.entities)
        return World(entities=self._entities, at=world.at)

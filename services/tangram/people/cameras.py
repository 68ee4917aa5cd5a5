"""Simulated cameras and a microphone: their reports of a person at the table, faults included.

Pure. `PersonAtTable` says exactly what happens. Raw perception comes at every frame while the person sits there, and
so does the world if a fault makes it unsteady.
"""

from collections.abc import Iterator

from engage_hri.schemas.body import Ray, RobotSeen, RobotState
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActorFound, ActorLost
from engage_hri.schemas.units import Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.tangram.people.config import SimulationConfig
from engage_hri.services.tangram.people.faults import Chances, FaceLoss, TableVision
from engage_hri.services.tangram.people.head import Sightlines
from engage_hri.services.tangram.people.person_at_table import PersonAtTable, Stamper
from engage_hri.services.tangram.people.reports import RawReports, Reports, SymbolicReports


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

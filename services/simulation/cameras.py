"""Simulated cameras and a microphone: what they report of a scene, faults included.

Pure. The scene says exactly what happens; raw perception comes at every frame while somebody sits there, and so
does the world where it is not seen steadily.
"""

from collections.abc import Iterator

from engage_hri.schemas.actions import ActorFound, ActorLost
from engage_hri.schemas.body import RobotState
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.simulation.config import SimulationConfig
from engage_hri.services.simulation.faults import Chances, FaceLoss, TableVision
from engage_hri.services.simulation.head import Sightlines
from engage_hri.services.simulation.perception import PersonAtTable, Stamper
from engage_hri.services.simulation.reports import Actions, Reports, Signals


class Cameras:
    """See `scene` as `config` says; to be used in its stead."""

    def __init__(
        self, scene: PersonAtTable, sightlines: Sightlines, config: SimulationConfig, stamp: Stamper, chances: Chances
    ) -> None:
        faults = config.faults
        self._scene = scene
        self._sightlines = sightlines
        self._stamp = stamp
        self._frame = config.frame
        self._constant = config.perception == "raw" or faults.unsteady
        self._dropped = faults.dropped_frames
        self._chance = chances("frames")
        self._person: Reports = (
            Signals(sightlines, faults, chances, head_turn=config.head_turn)
            if config.perception == "raw"
            else Actions(sightlines, faults, chances)
        )
        self._face = FaceLoss(faults, chances("faces"))
        self._vision = TableVision(faults, chances("table"))
        self._entities: tuple[Entity, ...] = ()
        self._next_frame: Seconds | None = None
        """None: no frames, changes alone are reported."""

    @property
    def deadline(self) -> Seconds | None:
        times = (self._scene.deadline, self._next_frame)
        return min((time for time in times if time is not None), default=None)

    def enter(self, now: Seconds) -> None:
        self._scene.enter(now)

    def feed(self, message: Message, now: Seconds) -> None:
        if isinstance(message, RobotState):
            self._sightlines.robot_eyes = message.gaze.origin
        else:
            self._scene.feed(message, now)

    def world(self, now: Seconds) -> World:
        """The table as it is seen now."""
        return self._seen(self._scene.world(now))

    def advance(self, now: Seconds) -> Iterator[Message]:
        """What is to be reported now."""
        for message in self._scene.advance(now):
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
            world = self._seen(self._scene.world(now))
            if world.entities != before:
                yield world
        if not self._drops():
            yield from self._person.heard(at, now)

    def _drops(self) -> bool:
        return self._chance.random() < self._dropped

    def _seen(self, world: World) -> World:
        self._entities = self._vision.see(world.entities)
        return World(entities=self._entities, at=world.at)

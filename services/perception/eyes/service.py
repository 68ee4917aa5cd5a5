"""The service of eyes: watches a source of landmarks, and tells the bus who is there, and where they face.

Each is told with the instant at which the picture was taken. Who is seen is a person of the world. The landmarks go
on the bus as well, so that a recording can be perceived once more with other settings.
"""

import math
import time
from contextlib import aclosing

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.landmarks import FaceLandmarks
from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, HeadPose, Looked
from engage_hri.schemas.units import Meters, Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import Bus, Received, Subscription
from engage_hri.services.client.people.perceived_person import PerceivedActions
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.eyes.looking import settings_of
from engage_hri.services.perception.eyes.packages import data_folder
from engage_hri.services.perception.eyes.seeing import PersonCame, PersonGesture, PersonGone, Seeing, Seen, SeenHead
from engage_hri.services.perception.eyes.watching import (
    InsideWatching,
    OutsideWatching,
    SourceLost,
    SourceOrder,
    Watching,
)
from engage_hri.services.runtime.service import Ready
from engage_hri.services.runtime.settings import tell_settings

LOOK_AROUND: Seconds = 0.5
"""Time in which the world, if anybody tells it, is known."""
AGAIN: Seconds = 2.0
"""Time after which a device is tried again that gave no picture."""
MOVED: Meters = 0.05
"""Distance from which on a face is at another place of the world; heads are told where they are each time."""


async def see(bus: Bus, ready: Ready, config: EyesConfig) -> None:
    """Serve until cancelled, or until a film is over.

    A film begins when recognition is there: what is seen before would be lost.

    Raises InputRefused: there is no such source, or a package or a model is not installed.
    """
    with bus.subscribe(keys.ANY_ROBOT_ALIVE, keys.WORLD) as inbox:
        tell_settings(bus, "eyes", config)
        eyes = _Eyes(bus, config, inbox)
        try:
            await eyes.watch(ready)
        finally:
            eyes.close()


class _Eyes:
    """State of the service."""

    def __init__(self, bus: Bus, config: EyesConfig, inbox: Subscription) -> None:
        self._bus, self._inbox = bus, inbox
        self._name = config.source.partition(":")[0]
        order = SourceOrder(self._name, settings_of(config, str(data_folder())))
        is_real = abs(bus.now() - time.monotonic()) < 1.0
        self._watching: Watching = OutsideWatching(order) if is_real else InsideWatching(order)
        self._config, self._seeing = config, Seeing(config)
        self._world, self._perceived = SharedWorld(bus.name), PerceivedActions(bus)
        self._own: dict[str, Entity] = {}
        """The people whom this service has brought into the world."""
        self._is_lost = False
        """No picture comes from the device, which was told."""

    async def _wait_for_recognition(self) -> None:
        """Wait until recognition is there, and for the world."""
        deadline = None
        while (received := await self._inbox.next(deadline)) is not None:
            self._take(received)
            match received.message:
                case PeerAlive(participant="recognition"):
                    deadline = self._bus.now() + LOOK_AROUND

    async def watch(self, ready: Ready) -> None:
        """See all that the source tells; what a device does not give is told, and it is tried again.

        ready: called when the source is open, or is a device that will be tried again.
        """
        is_ready = False
        while True:
            try:
                async with aclosing(self._watching.watch()) as told:
                    async for landmarks in told:
                        if not is_ready:
                            is_ready = True
                            ready()
                            await self._wait_for_recognition()
                        self._catch_up()
                        if landmarks is not None:
                            self._see(landmarks)
                return
            except SourceLost as lost:
                self._lose(lost.fault)
            if not is_ready:
                is_ready = True
                ready()
                await self._wait_for_recognition()
            until = self._bus.now() + AGAIN
            while (received := await self._inbox.next(until)) is not None:
                self._take(received)

    def close(self) -> None:
        """Let all leave who were seen."""
        self._tell(self._seeing.end())

    def _see(self, landmarks: FaceLandmarks) -> None:
        if self._is_lost:
            self._is_lost = False
            journal.alert(self._bus.log, "seeing again")
        at = landmarks.at.seconds
        self._bus.publish(keys.landmarks(self._bus.name), replace(landmarks, at=self._bus.stamp(at)))
        seen = self._seeing.feed(landmarks, at)
        self._tell(seen, at)
        heads = tuple(each.person for each in seen if isinstance(each, SeenHead))
        self._bus.publish(
            keys.looked(self._bus.name), Looked(at=self._bus.stamp(at), seen=heads, missed=self._seeing.missed)
        )

    def _tell(self, seen: list[Seen], at: Seconds = 0.0) -> None:
        """Tell what is new. at: of the picture."""
        for each in seen:
            match each:
                case PersonCame(person, place, since):
                    self._bring(person, place)
                    self._perceived.tell(ActorFound(actor=person, at=self._bus.stamp(since)))
                case PersonGone(person, since):
                    del self._own[person]
                    self._show()
                    self._perceived.tell(ActorLost(actor=person, at=self._bus.stamp(since)))
                case PersonGesture(person, change):
                    kind = ActionBegan if change.began else ActionEnded
                    self._perceived.tell(kind(actor=person, action=change.gesture, at=self._bus.stamp(change.at)))
                case SeenHead(person, place, direction, (yaw, pitch), mouth):
                    if math.dist(place, self._own[person].position) > MOVED:
                        self._bring(person, place)
                    self._bus.publish(
                        keys.head_pose(person),
                        HeadPose(
                            actor=person, position=place, direction=direction, at=self._bus.stamp(at),
                            yaw_spread=yaw, pitch_spread=pitch, mouth=mouth,
                        ),
                    )  # fmt: skip

    def _lose(self, fault: Fault) -> None:
        if not self._is_lost:
            self._is_lost = True
            journal.alert(self._bus.log, "%s", fault)
            self._bus.publish(keys.fault(self._bus.name), replace(fault, service=self._bus.name))

    # -- the world ----------------------------------------------------------------------------------------------

    def _catch_up(self) -> None:
        """Take what others have told meanwhile."""
        while (received := self._inbox.take()) is not None:
            self._take(received)

    def _take(self, received: Received) -> None:
        """Take what others tell of the world, and of who is there."""
        with self._bus.containing(received):
            if self._world.take(received.message, received.source, self._bus.now()) and self._own:
                self._show()

    def _bring(self, person: str, place: Vector) -> None:
        self._own[person] = Entity(id=person, kind="person", position=place)
        self._show()

    def _show(self) -> None:
        entities = self._world.tell(self._own.values(), self._bus.now())
        self._bus.publish(keys.WORLD, World(entities=entities, at=self._bus.stamp()))

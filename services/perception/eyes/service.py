"""The service of eyes: watches a source of landmarks, and tells the bus who is there, and where they face.

Each is told with the instant at which the picture was taken. Who is seen is a person of the world. The landmarks go
on the bus as well, so that a recording can be perceived once more with other settings.
"""

import time
from collections.abc import Awaitable, Callable
from contextlib import aclosing

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Subscription
from engage_hri.services.perception.eyes.config import PAGE, EyesConfig
from engage_hri.services.perception.eyes.looking import settings_of
from engage_hri.services.perception.eyes.pages import PageEyes
from engage_hri.services.perception.eyes.people import SeenPeople
from engage_hri.services.perception.eyes.seeing import Seeing
from engage_hri.services.perception.eyes.watching import (
    InsideWatching,
    OutsideWatching,
    SourceLost,
    SourceOrder,
    Watching,
)
from engage_hri.services.perception.sense_faults import SenseFaults
from engage_hri.services.runtime.parcels import data_folder
from engage_hri.services.runtime.service import Ready, tell_settings

LOOK_AROUND: Seconds = 0.5
"""Time in which the world, if anybody tells it, is known."""
AGAIN: Seconds = 2.0
"""Time after which a device is tried again that gave no picture."""


async def see(bus: Bus, ready: Ready, config: EyesConfig) -> None:
    """Serve until cancelled, or until a film is over.

    A film begins when recognition is there: what is seen before would be lost.

    Raises InputRefused: there is no such source, or a package or a model is not installed.
    """
    has_pages = config.source == PAGE
    landmarks = (keys.ANY_LANDMARKS,) if has_pages else ()
    with bus.subscribe(keys.ANY_ROBOT_ALIVE, keys.WORLD, *landmarks) as inbox:
        tell_settings(bus, "eyes", config)
        people = SeenPeople(bus, brings=not has_pages)
        eyes = PageEyes(bus, config, inbox, people) if has_pages else _Eyes(bus, config, inbox, people)
        is_ready = False

        async def begin() -> None:
            nonlocal is_ready
            if not is_ready:
                is_ready = True
                ready()
                await _recognition(bus, inbox, people)

        try:
            await eyes.watch(begin)
        finally:
            eyes.close()


class _Eyes:
    """Sees what a source tells, and tells it of people."""

    def __init__(self, bus: Bus, config: EyesConfig, inbox: Subscription, people: SeenPeople) -> None:
        self._bus, self._inbox, self._people = bus, inbox, people
        order = SourceOrder(config.source.partition(":")[0], settings_of(config, str(data_folder("eyes"))))
        is_real = abs(bus.now() - time.monotonic()) < 1.0
        self._watching: Watching = OutsideWatching(order) if is_real else InsideWatching(order)
        self._seeing = Seeing(config)
        self._faults = SenseFaults(bus)

    async def watch(self, begin: Callable[[], Awaitable[None]]) -> None:
        """See all that the source tells; what a device does not give is told, and it is tried again.

        begin: awaited when the source is open, or is a device that will be tried again.
        """
        while True:
            try:
                async with aclosing(self._watching.watch()) as told:
                    async for landmarks in told:
                        await begin()
                        while (received := self._inbox.take()) is not None:
                            self._people.take(received)
                        if landmarks is not None:
                            self._see(landmarks)
                return
            except SourceLost as lost:
                self._faults.lose(lost.fault)
            await begin()
            until = self._bus.now() + AGAIN
            while (received := await self._inbox.next(until)) is not None:
                self._people.take(received)

    def close(self) -> None:
        """Let all leave who were seen."""
        self._people.tell(self._seeing.end(), self._bus.now())

    def _see(self, landmarks: FaceLandmarks) -> None:
        self._faults.get()
        at = landmarks.at.seconds
        self._bus.publish(keys.landmarks(self._bus.name), replace(landmarks, at=self._bus.stamp(at)))
        self._people.looked(self._bus.name, self._seeing.feed(landmarks, at), self._seeing.missed, at)


async def _recognition(bus: Bus, inbox: Subscription, people: SeenPeople) -> None:
    """Wait until recognition is there, and for the world."""
    deadline = None
    while (received := await inbox.next(deadline)) is not None:
        people.take(received)
        match received.message:
            case PeerAlive(participant="recognition"):
                deadline = bus.now() + LOOK_AROUND

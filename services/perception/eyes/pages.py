"""Cameras of pages: each is that of a person who sits at one, and comes and goes as they switch it on and off.

The page tells points, and never a picture. Who sits there is in the world already, and is told of by the window.
"""

from collections.abc import Awaitable, Callable

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Subscription
from engage_hri.services.client.people.perceived_person import SEAT
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.eyes.people import SeenPeople
from engage_hri.services.perception.eyes.seat import SeatSeeing
from engage_hri.services.perception.eyes.watching import SILENT
from engage_hri.services.perception.sense_faults import SenseFaults

MOST_PAGES = 16
"""Cameras of pages that are followed at once: each costs 1 % of a processor."""
OLD: Seconds = 10.0
"""Age from which on what a page has seen is of no use."""


class _PageCamera:
    """The camera of a page. came: loop time at which the last picture was told."""

    def __init__(self, seeing: SeatSeeing) -> None:
        self.seeing, self.came = seeing, 0.0


class PageEyes:
    """Sees with all cameras of pages that are on, each that of a person."""

    def __init__(self, bus: Bus, config: EyesConfig, inbox: Subscription, people: SeenPeople) -> None:
        self._bus, self._config, self._inbox, self._people = bus, config, inbox, people
        self._pages: dict[str, _PageCamera] = {}
        self._faults = SenseFaults(bus)

    async def watch(self, begin: Callable[[], Awaitable[None]]) -> None:
        """See with them for ever. One that tells nothing any more is a fault, and ends."""
        await begin()
        while True:
            until = min((page.came for page in self._pages.values()), default=float("inf")) + SILENT
            received = await self._inbox.next(until)
            if received is None:
                self._expire()
            elif isinstance(received.message, FaceLandmarks):
                with self._bus.containing(received):
                    self._see(received.key.rpartition("/")[2], received.message)
            else:
                self._people.take(received)

    def close(self) -> None:
        """Take it that no camera looks any more."""
        for person in [*self._pages]:
            self._end(person)

    def _see(self, person: str, landmarks: FaceLandmarks) -> None:
        now = self._bus.now()
        if landmarks.over:
            if person in self._pages:
                self._end(person)
                self._bus.log.info("the camera of %s is off", person)
            return
        at = min(self._bus.local(landmarks.at), now)
        page = self._pages.get(person) or self._begin(person)
        if page is None or now - at > OLD:
            return
        page.came = now
        self._people.looked(person, page.seeing.feed(landmarks, at), page.seeing.missed, at)

    def _begin(self, person: str) -> _PageCamera | None:
        """Begin to see with the camera of a page. None: there are so many that it is not followed."""
        if len(self._pages) >= MOST_PAGES:
            reason = f"{MOST_PAGES} cameras are followed already, and that of {person} is not"
            self._bus.tell_refused(Fault(reason=reason, where=keys.landmarks(person)), person)
            return None
        self._bus.log.info("the camera of %s is on", person)
        seat = self._people.place(person) or SEAT
        page = self._pages[person] = _PageCamera(SeatSeeing(self._config, person, seat))
        return page

    def _expire(self) -> None:
        for person in [person for person, page in self._pages.items() if self._bus.now() >= page.came + SILENT]:
            self._end(person)
            reason = f"no picture is looked at any more by the camera of {person}"
            advice = "is it covered, or the page, or the computer it is on, asleep or cut off?"
            fault = Fault(reason=reason, where=keys.landmarks(person), advice=advice)
            self._faults.tell(fault)

    def _end(self, person: str) -> None:
        """See no more with a camera. Who was away before it is where their seat is: nobody knows better now."""
        seeing = self._pages.pop(person).seeing
        self._people.tell(seeing.end(), self._bus.now())
        if seeing.is_here is False and self._people.place(person) is not None:
            self._people.find(person, self._bus.now())

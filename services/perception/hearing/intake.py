"""Messages that hearing takes besides sound: who is here, and the robot's own voice."""

from collections.abc import Iterable

from engage_hri.schemas import keys
from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.sound import SoundFrame
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Received, Subscription
from engage_hri.services.perception.hearing.company import HeardPeople
from engage_hri.services.perception.hearing.speeches import Speeches

LOOK_AROUND: Seconds = 0.5
"""Time in which the world, if anybody tells it, is known."""


class HearingIntake:
    """Takes what comes to an inbox, for people and speeches."""

    def __init__(self, bus: Bus, inbox: Subscription, people: HeardPeople, speeches: Speeches) -> None:
        self._bus, self.inbox, self._people, self._speeches = bus, inbox, people, speeches

    def take(self, received: Received) -> None:
        """Take one message. Sound of a page is nothing here: it comes before anybody listens to pages."""
        if isinstance(received.message, SoundFrame) and received.key != keys.ROBOT_SOUND:
            return
        with self._bus.containing(received):
            self._people.take(received)
            self._speeches.take(received.message)

    async def catch_up(self) -> None:
        """Take all that has come."""
        while len(self.inbox):
            received = await self.inbox.next()
            if received is not None:
                self.take(received)

    async def wait_until(self, deadline: Seconds) -> None:
        """Take what comes until this loop time."""
        while (received := await self.inbox.next(deadline)) is not None:
            self.take(received)

    async def wait_for_recognition(self, people: Iterable[str]) -> None:
        """Wait until recognition is there, and for the world. people: then come who have channels of their own."""
        deadline = None
        while (received := await self.inbox.next(deadline)) is not None:
            self.take(received)
            match received.message:
                case PeerAlive(participant="recognition"):
                    deadline = self._bus.now() + LOOK_AROUND
        for person in people:
            self._people.bring(person, self._bus.now())

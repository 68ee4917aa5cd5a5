"""Messages that hearing takes besides sound: who is here, and the robot's own voice.

The sound of pages is subscribed to when it is listened to, and no sooner: until then a page is told that nobody hears
it, and what is said to it is not lost unseen."""

from collections.abc import Iterable

from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.perception.hearing.company import HeardPeople
from engage_hri.services.perception.hearing.speeches import Speeches

LOOK_AROUND: Seconds = 0.5
"""Time in which the world, if anybody tells it, is known."""


class HearingIntake:
    """Takes what comes, for people and speeches. patterns: of its keys. inbox: what has come."""

    def __init__(self, bus: Bus, patterns: Iterable[str], people: HeardPeople, speeches: Speeches) -> None:
        self._bus, self._people, self._speeches = bus, people, speeches
        self.inbox = bus.subscribe(*patterns)

    def take(self, received: Received) -> None:
        """Take one message."""
        with self._bus.containing(received):
            self._people.take(received)
            self._speeches.take(received.message)

    def widen(self, pattern: str) -> None:
        """Let what this pattern includes come as well, from now on."""
        before, self.inbox = self.inbox, self._bus.subscribe(*self.inbox.patterns, pattern)
        before.close()
        while (received := before.take()) is not None:
            self.take(received)

    def catch_up(self) -> None:
        """Take all that has come."""
        while (received := self.inbox.take()) is not None:
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

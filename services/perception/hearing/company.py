"""People whom hearing knows."""

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActorFound, ActorLost
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.client.people.perceived_person import PerceivedActions, free_seat
from engage_hri.services.client.people.shared_world import SharedWorld


class HeardPeople:
    """The people in the world: those of whom others tell, and those whom hearing brings there itself.

    perceived: tells what they do.
    """

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._world, self.perceived = SharedWorld(bus.name), PerceivedActions(bus)
        self._own: dict[str, Entity] = {}
        """Those whom this service has brought into the world, since nobody else tells of them."""

    @property
    def here(self) -> list[str]:
        """Ids of all who are here."""
        return [each.id for each in self._world.entities if each.kind == "person"]

    def take(self, received: Received) -> None:
        """Take what others tell of the world."""
        now = self._bus.now()
        if self._world.take(received.message, received.source, now) and self._own:
            self._show(now)

    def bring(self, person: str, at: Seconds) -> None:
        """Bring a person into the world, unless somebody tells of them there. at: loop time of what was heard."""
        if any(each.id == person for each in self._world.entities):
            return
        seats = [each.position for each in self._world.entities if each.kind == "person"]
        self._own[person] = Entity(id=person, kind="person", position=free_seat(seats))
        self._show(self._bus.now())
        self.perceived.tell(ActorFound(actor=person, at=self._bus.stamp(at)))

    def let_go(self, person: str = "") -> None:
        """Let a person leave whom this service has brought into the world. person: empty: all of them."""
        gone = [each for each in ((person and [person]) or [*self._own]) if self._own.pop(each, None) is not None]
        if gone:
            self._show(self._bus.now())
            self.perceived.tell(*(ActorLost(actor=each, at=self._bus.stamp()) for each in gone))

    def _show(self, now: Seconds) -> None:
        self._bus.publish(keys.WORLD, World(entities=self._world.tell(self._own.values(), now), at=self._bus.stamp()))

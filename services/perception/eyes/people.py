"""People whom eyes see, as they tell the bus of them."""

import math
from collections.abc import Iterable, Sequence

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, ActorLost, HeadPose, Looked
from engage_hri.schemas.units import Meters, Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.client.people.perceived_person import PerceivedActions
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.perception.eyes.seeing import PersonCame, PersonGesture, PersonGone, Seen, SeenHead

MOVED: Meters = 0.05
"""Distance from which on a face is at another place of the world; heads are told where they are each time."""


class SeenPeople:
    """The people whom eyes see. brings: whether these are in the world by eyes alone; else others have them there."""

    def __init__(self, bus: Bus, *, brings: bool) -> None:
        self._bus, self._brings = bus, brings
        self._world, self._perceived = SharedWorld(bus.name), PerceivedActions(bus)
        self._own: dict[str, Entity] = {}
        """The people whom this service has brought into the world."""

    def place(self, person: str) -> Vector | None:
        """Place of somebody in the world; None: they are not there."""
        return next((each.position for each in self._world.entities if each.id == person), None)

    def looked(self, source: str, seen: Sequence[Seen], missed: tuple[str, ...], at: Seconds) -> None:
        """Tell what is new in a picture, and that a source has looked until then.

        missed: people who are followed, and whose face was not in it. at: loop time of the picture.
        """
        self.tell(seen, at)
        heads = tuple(each.person for each in seen if isinstance(each, SeenHead))
        self._bus.publish(keys.looked(source), Looked(at=self._bus.stamp(at), seen=heads, missed=missed))

    def tell(self, seen: Iterable[Seen], at: Seconds) -> None:
        """Tell what is new. at: loop time of the picture."""
        for each in seen:
            match each:
                case PersonCame(person, place, since):
                    self._bring(person, place)
                    self.find(person, since)
                case PersonGone(person, since):
                    if self._own.pop(person, None) is not None:
                        self._show()
                    self._perceived.tell(ActorLost(actor=person, at=self._bus.stamp(since)))
                case PersonGesture(person, change):
                    kind = ActionBegan if change.began else ActionEnded
                    self._perceived.tell(kind(actor=person, action=change.gesture, at=self._bus.stamp(change.at)))
                case SeenHead(person, place, direction, (yaw, pitch), mouth):
                    self._bring(person, place)
                    self._bus.publish(
                        keys.head_pose(person),
                        HeadPose(
                            actor=person, position=place, direction=direction, at=self._bus.stamp(at),
                            yaw_spread=yaw, pitch_spread=pitch, mouth=mouth,
                        ),
                    )  # fmt: skip

    def find(self, person: str, since: Seconds) -> None:
        """Tell that somebody is here. since: loop time."""
        self._perceived.tell(ActorFound(actor=person, at=self._bus.stamp(since)))

    def take(self, received: Received) -> None:
        """Take what others tell of the world, and of who is there."""
        with self._bus.containing(received):
            if self._world.take(received.message, received.source, self._bus.now()) and self._own:
                self._show()

    def _bring(self, person: str, place: Vector) -> None:
        known = self._own.get(person)
        if self._brings and (known is None or math.dist(place, known.position) > MOVED):
            self._own[person] = Entity(id=person, kind="person", position=place)
            self._show()

    def _show(self) -> None:
        entities = self._world.tell(self._own.values(), self._bus.now())
        self._bus.publish(keys.WORLD, World(entities=entities, at=self._bus.stamp()))

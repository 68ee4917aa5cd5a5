"""Look of the one at a page: where they say that they look; or, while a camera sees them, where their head says.

On a screen a head hardly turns from one piece to the next. So who touches a piece still looks at it, for a moment.
"""

import asyncio
import math

from engage_hri.schemas.units import Meters, Seconds, Vector
from engage_hri.schemas.world import Entity
from engage_hri.services.client.people.perceived_person import PerceivedPerson

GLANCE: Seconds = 1.5
"""Time for which who is seen looks at what they have touched."""
MOVED: Meters = 0.05
"""Distance from which on a face is at another place of the world."""


class OwnLook:
    """The look of somebody, and the place of their face. robot: at whom they look first. seat: that place."""

    def __init__(self, person: PerceivedPerson, robot: str, seat: Vector) -> None:
        self._person, self._robot, self._seat = person, robot, seat
        self._place = seat
        self._is_seen = self._has_left = False
        self._glance: asyncio.TimerHandle | None = None
        person.begin("look", robot)

    def at(self, target: str) -> None:
        """Look at something. Raises InputRefused: the world does not know it."""
        self._person.begin("look", target)
        self._stop()
        if self._is_seen:
            self._glance = asyncio.get_running_loop().call_later(GLANCE, self._person.end, "look")

    def is_at(self, place: Vector) -> None:
        """Take note that eyes see the face at a place: they tell where it looks from now on."""
        if self._has_left:
            return
        if not self._is_seen:
            self._is_seen = True
            self._person.end("look")
        if math.dist(place, self._place) > MOVED:
            self._go(place)

    def unseen(self) -> None:
        """Take note that no camera sees the face any more."""
        self._stop()
        if self._is_seen and not self._has_left:
            self._is_seen = False
            self._go(self._seat)
            self._person.begin("look", self._robot)

    def close(self) -> None:
        """Take note that the person leaves."""
        self._stop()
        self._has_left = True

    def _stop(self) -> None:
        if self._glance is not None:
            self._glance.cancel()
            self._glance = None

    def _go(self, place: Vector) -> None:
        self._place = place
        self._person.bring(Entity(id=self._person.id, kind="person", position=place))

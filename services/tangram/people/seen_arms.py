"""Arms of the robot as people see them, where it believes them elsewhere: what it really points at. Pure."""

import math
from collections.abc import Iterable

from engage_hri.schemas.body import Ray, RobotSeen
from engage_hri.schemas.units import Seconds, Vector
from engage_hri.schemas.world import Entity

STILL = math.radians(0.3)
"""Radians that a forearm that is on its target turns from one message to the next at most."""
PATIENCE: Seconds = 2.0
"""Longest time for which people wait for an arm to come to rest."""


class SeenArms:
    """The forearms, as they were last seen. Without a message they are where the robot says."""

    def __init__(self) -> None:
        self._rays: tuple[Ray, ...] = ()
        self._turned = 0.0
        self._waiting_since: Seconds | None = None

    def see(self, seen: RobotSeen) -> None:
        rays = tuple(ray for ray in (seen.left_arm, seen.right_arm) if ray is not None)
        pairs = zip(rays, self._rays, strict=False)
        self._turned = max((_between(one.axis, other.axis) for one, other in pairs), default=0.0)
        self._rays = rays

    def are_moving(self, now: Seconds) -> bool:
        """True while it cannot be told yet what an arm points at."""
        if not self._rays or self._turned < STILL:
            self._waiting_since = None
            return False
        since = self._waiting_since = now if self._waiting_since is None else self._waiting_since
        return now < since + PATIENCE

    def meant(self, target: str, things: Iterable[Entity]) -> str:
        """Id of the thing that seems to be pointed at, while the robot means `target`."""
        places = {thing.id: thing.position for thing in things}
        if not self._rays or target not in places:
            return target
        arm = min(self._rays, key=lambda ray: _off(ray, places[target]))
        return min(places, key=lambda id: _off(arm, places[id]))


def _off(ray: Ray, place: Vector) -> float:
    return _between(ray.axis, tuple(there - here for here, there in zip(ray.origin, place, strict=True)))  # type: ignore[arg-type]


def _between(one: Vector, other: Vector) -> float:
    dot, lengths = sum(a * b for a, b in zip(one, other, strict=True)), math.hypot(*one) * math.hypot(*other)
    return math.acos(max(-1.0, min(1.0, dot / lengths))) if lengths else math.pi

"""Speeds of the entities of the world, from where they were seen. Pure."""

import math

from engage_hri.schemas.units import Seconds, Vector
from engage_hri.schemas.world import World

FORGOTTEN: Seconds = 0.5
"""What has not been seen elsewhere for so long stands."""


class Speeds:
    """Speeds of entities, metres per second."""

    def __init__(self) -> None:
        self._seen: dict[str, tuple[Vector, Seconds]] = {}
        self._speeds: dict[str, float] = {}

    def see(self, world: World, now: Seconds) -> None:
        """Take note of where entities are."""
        for entity in world.entities:
            before, since = self._seen.get(entity.id, (entity.position, now - 1.0))
            if now - since > 1e-3:
                speed = math.dist(before, entity.position) / (now - since)
                self._speeds[entity.id] = max(speed, 0.5 * self._speeds.get(entity.id, 0.0)) if speed else 0.0
                self._seen[entity.id] = (entity.position, now)

    def of(self, entity: str, now: Seconds) -> float:
        """Speed of an entity; 0: it stands, or nobody knows of it."""
        _, since = self._seen.get(entity, ((0.0, 0.0, 0.0), -math.inf))
        return self._speeds.get(entity, 0.0) if now - since < FORGOTTEN else 0.0

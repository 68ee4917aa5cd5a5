"""A thing that a report of the world leaves out is covered, as a rule, and has not gone: people's hands hide pieces
when nobody expects it (thesis 5.4.2). For those who act on the world, and would refuse what is plainly there.
"""

from msgspec.structs import replace

from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World

COVERED_FOR: Seconds = 10.0
"""How long one stays missing until it is taken to be gone, unless the configuration says otherwise."""


class CoveredObjects:
    """Adds to reports of the world the objects that they leave out, where they were seen last.

    patience: as `COVERED_FOR`.
    """

    def __init__(self, patience: Seconds) -> None:
        self._patience = patience
        self._world: World | None = None
        self._objects: dict[str, Entity] = {}
        self._missing: dict[str, Seconds] = {}
        """Since when, by id; in `_objects` as last seen."""

    def see(self, world: World, now: Seconds) -> World:
        """Take a report. The world as it probably is now."""
        reported = {entity.id for entity in world.entities}
        self._forget(now)
        self._missing = {id: self._missing.get(id, now) for id in self._objects if id not in reported}
        self._objects = {id: self._objects[id] for id in self._missing} | {one.id: one for one in world.objects}
        self._world = world
        return self._whole(world)

    def at(self, now: Seconds) -> World | None:
        """The world as it probably is; None before the first report."""
        self._forget(now)
        return None if self._world is None else self._whole(self._world)

    def _forget(self, now: Seconds) -> None:
        gone = [id for id, since in self._missing.items() if now - since > self._patience]
        for id in gone:
            del self._missing[id], self._objects[id]

    def _whole(self, world: World) -> World:
        covered = tuple(self._objects[id] for id in self._missing)
        return replace(world, entities=(*world.entities, *covered)) if covered else world

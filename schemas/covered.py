"""Memory of objects that are hidden for a moment, so that services go on to speak of them and to look at them.

An object that a report of the world leaves out has rarely gone: people's hands hide pieces all the time (thesis
5.4.2).
"""

from msgspec.structs import replace

from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World

COVERED_FOR: Seconds = 10.0
"""Time after which a missing object is taken to be gone, unless the configuration says otherwise."""


class CoveredObjects:
    """Adds to reports of the world the objects that they leave out, where they were seen last.

    patience: seconds after which a missing object is taken to be gone.
    """

    def __init__(self, patience: Seconds) -> None:
        self._patience = patience
        self._world: World | None = None
        self._objects: dict[str, Entity] = {}
        self._missing: dict[str, Seconds] = {}
        """Since when an object is missing, by id; `_objects` holds it as last seen."""

    def see(self, world: World, now: Seconds) -> World:
        """Take a report. Returns the world as it probably is now: the report with the covered objects."""
        reported = {entity.id for entity in world.entities}
        self._forget(now)
        self._missing = {id: self._missing.get(id, now) for id in self._objects if id not in reported}
        self._objects = {id: self._objects[id] for id in self._missing} | {one.id: one for one in world.objects}
        self._world = world
        return self._whole(world)

    def at(self, now: Seconds) -> World | None:
        """Return the world as it probably is; None before the first report."""
        self._forget(now)
        return None if self._world is None else self._whole(self._world)

    def _forget(self, now: Seconds) -> None:
        gone = [id for id, since in self._missing.items() if now - since > self._patience]
        for id in gone:
            del self._missing[id], self._objects[id]

    def _whole(self, world: World) -> World:
        covered = tuple(self._objects[id] for id in self._missing)
        return replace(world, entities=(*world.entities, *covered)) if covered else world

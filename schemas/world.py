"""World as perception reports it: entities with their places and looks, and what is hidden for a moment.

An object that a report of the world leaves out has rarely gone: people's hands hide pieces all the time (thesis
5.4.2). So services remember it, and go on to speak of it and to look at it.
"""

import math
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Coordinate, Extent, Heading, Meters, Named, Probability, Seconds, Stamp, Vector

EntityKind = Literal["object", "person", "hand", "surface"]


class Entity(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A thing or a person.

    id: its name in behaviors and messages, without ` + `.
    kind: only an `object` can be referred to, or be a distractor.
    position: metres; of a person the face, of an object the center. yaw: radians about z.
    footprint: corners in the entity's own frame, metres (x, y), before turning by `yaw` about z.
    radius: metres around `position`; 0: that of the footprint, or unknown.
    category, size, color, shape, name, features: words for phrases about it; empty: unknown. Without a category the
    noun is its shape, its name, or a part of its id.
    confidence: of perception, 0..1. placeless: nobody has measured `position`, which only shows where one may look.
    """

    id: Named
    kind: EntityKind
    position: Vector
    yaw: Heading = 0.0
    footprint: tuple[tuple[Coordinate, Coordinate], ...] = ()
    radius: Extent = 0.0
    category: str = ""
    """A noun: `cup`. Without one its shape is the noun: `square`."""
    color: str = ""
    shape: str = ""
    size: str = ""
    """`big`, `small`. Empty: found by comparing its footprint or radius with others of its kind."""
    features: tuple[str, ...] = ()
    """Other adjectives: `striped`, `wooden`. An adjective that is not listed is not true of it."""
    name: str = ""
    owner: str = ""
    """Id of the person, if it is a hand."""
    velocity: Vector = (0.0, 0.0, 0.0)
    """m/s"""
    confidence: Probability = 1.0
    placeless: bool = False

    @property
    def extent(self) -> Meters:
        """The radius that is given, else that of the footprint."""
        if self.radius or not self.footprint:
            return self.radius
        return max(math.hypot(x, y) for x, y in self.footprint)


TOGETHER = " + "
"""What stands between the ids of a target that is several things at once: `cup + plate`."""


def each_of(target: str) -> tuple[str, ...]:
    """Ids of what a target names: one thing, or several."""
    return tuple(target.split(TOGETHER))


class World(Struct, frozen=True, kw_only=True, tag="world", omit_defaults=True):
    """state: perception. The whole world each time it changes.

    entities: everything that is there. at: the instant of the report; None in a file.
    """

    entities: tuple[Entity, ...]
    at: Stamp | None = None

    def entity(self, id: str) -> Entity | None:
        """Find the entity with this id; None if there is none.

        id: of an object, a person, a hand or a surface; of several together, which are one object at their middle, as
        wide as they lie apart.
        """
        if TOGETHER not in id:
            return next((entity for entity in self.entities if entity.id == id), None)
        ids = each_of(id)
        found = [entity for entity in self.entities if entity.id in ids]
        if len(found) < len(ids):
            return None
        x, y, z = (math.fsum(parts) / len(found) for parts in zip(*(each.position for each in found), strict=True))
        radius = max(math.dist((x, y, z), each.position) + each.extent for each in found)
        return Entity(id=id, kind="object", position=(x, y, z), radius=radius)

    @property
    def objects(self) -> tuple[Entity, ...]:
        """The entities that can be referred to."""
        return tuple(entity for entity in self.entities if entity.kind == "object")

    @property
    def people(self) -> tuple[Entity, ...]:
        """The people in the world."""
        return tuple(entity for entity in self.entities if entity.kind == "person")


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

"""World as perception reports it: entities with their places and looks."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import Coordinate, Extent, Heading, Named, Probability, Stamp, Vector

EntityKind = Literal["object", "person", "hand", "surface"]


class Entity(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A thing or a person.

    id: its name in behaviors and messages. kind: only an `object` can be referred to, or be a distractor.
    position: metres; of a person the face, of an object the center. yaw: radians about z.
    footprint: corners in the entity's own frame, metres (x, y), before turning by `yaw` about z.
    radius: metres around `position`; 0: that of the footprint, or unknown.
    category, size, color, shape, name, features: words for phrases about it; empty: unknown. Without a category the
    noun is its shape, its name, or a part of its id.
    confidence: of perception, 0..1.
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


class World(Struct, frozen=True, kw_only=True, tag="world", omit_defaults=True):
    """state: perception. The whole world each time it changes.

    entities: everything that is there. at: the instant of the report; None in a file.
    """

    entities: tuple[Entity, ...]
    at: Stamp | None = None

    def entity(self, id: str) -> Entity | None:
        """Find the entity with this id; None if there is none.

        id: of an object, a person, a hand or a surface.
        """
        return next((entity for entity in self.entities if entity.id == id), None)

    @property
    def objects(self) -> tuple[Entity, ...]:
        """The entities that can be referred to."""
        return tuple(entity for entity in self.entities if entity.kind == "object")

    @property
    def people(self) -> tuple[Entity, ...]:
        """The people in the world."""
        return tuple(entity for entity in self.entities if entity.kind == "person")

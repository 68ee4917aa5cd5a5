"""The world as perception reports it: entities with places, and what they look like."""

from typing import Literal

from msgspec import Struct

from engage_hri.schemas.units import Coordinate, Extent, Heading, Named, Probability, Stamp, Vector

EntityKind = Literal["object", "person", "hand", "surface"]


class Entity(Struct, frozen=True, kw_only=True, omit_defaults=True):
    """A thing or a person.

    id: by which behaviors and messages name it. kind: only an `object` can be referred to, or be a distractor.
    position: metres; of a person the face, of an object its center. yaw: radians about z.
    footprint: corners in the entity's own frame, metres (x, y), before turning by `yaw` about z.
    radius: metres around `position`; 0: as the footprint says, or unknown.
    category, size, color, shape, name, features: what phrases for it are made of; empty: unknown. Without a category,
    its shape, its name or what its id says is the noun.
    confidence: of perception, 0..1.
    """

    id: Named
    kind: EntityKind
    position: Vector
    yaw: Heading = 0.0
    footprint: tuple[tuple[Coordinate, Coordinate], ...] = ()
    radius: Extent = 0.0
    category: str = ""
    """What it is, a noun: `cup`. Without one its shape is the noun: `square`."""
    color: str = ""
    shape: str = ""
    size: str = ""
    """`big`, `small`. Empty: as its footprint or radius compares with others of its kind."""
    features: tuple[str, ...] = ()
    """All else that sets it apart, as adjectives: `striped`, `wooden`. What is not listed does not hold."""
    name: str = ""
    owner: str = ""
    """Of a hand: the person."""
    velocity: Vector = (0.0, 0.0, 0.0)
    """m/s"""
    confidence: Probability = 1.0


class World(Struct, frozen=True, kw_only=True, tag="world", omit_defaults=True):
    """state: perception. The whole world each time it changes.

    entities: all that is there. at: when it was so; None in a file.
    """

    entities: tuple[Entity, ...]
    at: Stamp | None = None

    def entity(self, id: str) -> Entity | None:
        """Find the entity of this id; None if there is none.

        id: of an object, a person, a hand or a surface.
        """
        return next((entity for entity in self.entities if entity.id == id), None)

    @property
    def objects(self) -> tuple[Entity, ...]:
        """The entities that can be referred to."""
        return tuple(entity for entity in self.entities if entity.kind == "object")

    @property
    def people(self) -> tuple[Entity, ...]:
        """The people who are there."""
        return tuple(entity for entity in self.entities if entity.kind == "person")

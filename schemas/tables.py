"""Tables with colored pieces on them, as files of tasks have them: places, forms, and which pieces touch where.

A task and a camera know of them alike.
"""

import math
from collections.abc import Iterable
from itertools import permutations
from typing import Literal, NamedTuple

from msgspec import Struct

from engage_hri.schemas.units import Degrees, Meters, Radians, Vector
from engage_hri.schemas.world import Entity

Side = Literal["right", "top right", "top", "top left", "left", "bottom left", "bottom", "bottom right"]
SIDES: tuple[Side, ...] = ("right", "top right", "top", "top left", "left", "bottom left", "bottom", "bottom right")
"""Counterclockwise as the human sees the table, 45 degrees apart."""
Point = tuple[float, float]
"""Metres on the table: x ahead of the robot, y to its left."""

LENGTH_TOLERANCE: Meters = 0.005
"""By how much two edges that touch may differ in length and still be equally long."""
GAP_TOLERANCE: Meters = 0.012
"""Distance of the middles of two edges up to which their pieces touch."""
OVERLAP_TOLERANCE: Meters = 0.004
ANGLE_TOLERANCE: Radians = math.radians(12.0)
"""Angle between two edges up to which their pieces touch."""


class PiecePose(Struct, frozen=True, array_like=True):
    """Place and turn of a piece on the table. In degrees, as people write it in a file."""

    x: Meters
    y: Meters
    yaw: Degrees = 0.0


class Edge(NamedTuple):
    """One side of a piece on the table, its outside to the right of start -> end."""

    start: Point
    end: Point

    @property
    def length(self) -> Meters:
        return math.dist(self.start, self.end)

    @property
    def middle(self) -> Point:
        return ((self.start[0] + self.end[0]) / 2, (self.start[1] + self.end[1]) / 2)

    @property
    def facing(self) -> Radians:
        """Direction of the outward normal, about z, from the robot's x axis."""
        return math.atan2(self.start[0] - self.end[0], self.end[1] - self.start[1])

    @property
    def side(self) -> Side:
        """Side of the piece that the edge is on, as the human sees it."""
        seen = math.atan2(-math.cos(self.facing), math.sin(self.facing))
        return SIDES[round(math.degrees(seen) / 45.0) % 8]


def corners(piece: Entity) -> tuple[Point, ...]:
    """The corners of the footprint where the piece lies."""
    x, y, _ = piece.position
    cos, sin = math.cos(piece.yaw), math.sin(piece.yaw)
    return tuple((x + cos * fx - sin * fy, y + sin * fx + cos * fy) for fx, fy in piece.footprint)


def edges(piece: Entity) -> tuple[Edge, ...]:
    points = corners(piece)
    return tuple(Edge(point, points[(index + 1) % len(points)]) for index, point in enumerate(points))


def touches(edge: Edge, other: Edge) -> bool:
    """True if the edges lie on one another, parallel and of equal length, within tolerances. Thesis Appendix A."""
    turned = math.remainder(edge.facing - other.facing - math.pi, math.tau)
    return (
        abs(edge.length - other.length) <= LENGTH_TOLERANCE
        and abs(turned) <= ANGLE_TOLERANCE
        and math.dist(edge.middle, other.middle) <= GAP_TOLERANCE
    )


def poses_touching(piece: Entity, landmark: Entity, side: Side) -> Iterable[PiecePose]:
    """Every pose in which an edge of `piece` lies on an equal edge of `landmark` that faces `side`."""
    for place in edges(landmark):
        if place.side != side:
            continue
        for edge in edges(piece):
            if abs(edge.length - place.length) > LENGTH_TOLERANCE:
                continue
            turn = place.facing + math.pi - edge.facing
            cos, sin = math.cos(turn), math.sin(turn)
            dx, dy = edge.middle[0] - piece.position[0], edge.middle[1] - piece.position[1]
            yaw = math.degrees(math.remainder(piece.yaw + turn, math.tau))
            yield PiecePose(place.middle[0] - (cos * dx - sin * dy), place.middle[1] - (sin * dx + cos * dy), yaw)


def overlap(piece: Entity, other: Entity) -> bool:
    """True if two pieces (convex) lie on one another by more than `OVERLAP_TOLERANCE`."""
    for edge in (*edges(piece), *edges(other)):
        normal = (math.cos(edge.facing), math.sin(edge.facing))
        low, high = _extent(piece, normal)
        other_low, other_high = _extent(other, normal)
        if high - other_low <= OVERLAP_TOLERANCE or other_high - low <= OVERLAP_TOLERANCE:
            return False
    return True


def _extent(piece: Entity, axis: Point) -> tuple[float, float]:
    along = [x * axis[0] + y * axis[1] for x, y in corners(piece)]
    return min(along), max(along)


ALIKE: Meters = 0.002
"""Distance of corners up to which a form that is turned looks as before."""


class TableTop(Struct, frozen=True, kw_only=True):
    """The top of a table. center: in the robot's frame. footprint: corners around it, counterclockwise."""

    id: str
    center: Vector
    footprint: tuple[Point, ...]


class Form(Struct, frozen=True, kw_only=True):
    """A flat piece. footprint: convex, counterclockwise. start: its pose when the task begins."""

    id: str
    color: str
    shape: str
    footprint: tuple[Point, ...]
    start: PiecePose

    @property
    def turns_alike(self) -> int:
        """Number of turns in a circle after which it looks the same, 1 to 4."""
        return next(order for order in (4, 3, 2, 1) if self._looks_the_same(math.tau / order))

    def _looks_the_same(self, turned: Radians) -> bool:
        cos, sin = math.cos(turned), math.sin(turned)
        after = [(cos * x - sin * y, sin * x + cos * y) for x, y in self.footprint]
        return all(min(math.dist(corner, other) for other in after) < ALIKE for corner in self.footprint)


class TaskTable(Struct, frozen=True, kw_only=True):
    """A table with its pieces. thickness: that of the pieces. What else a file holds is for its task."""

    surface: TableTop
    pieces: tuple[Form, ...]
    thickness: Meters = 0.0

    def lying(self, piece: Form, pose: PiecePose) -> Entity:
        """The piece as perception reports it when it lies at `pose`."""
        return Entity(
            id=piece.id,
            kind="object",
            position=(pose.x, pose.y, self.surface.center[2]),
            yaw=math.radians(pose.yaw),
            footprint=piece.footprint,
            radius=max(math.hypot(x, y) for x, y in piece.footprint),
            color=piece.color,
            shape=piece.shape,
            name=f"{piece.color} {piece.shape}",
        )


class Relation(Struct, frozen=True):
    """`piece` touches the `side` of `landmark`."""

    piece: str
    side: Side
    landmark: str


def relation(piece: Entity, landmark: Entity) -> Relation | None:
    """The relation in which `piece` touches `landmark`; None if it does not."""
    for place in edges(landmark):
        if any(touches(edge, place) for edge in edges(piece)):
            return Relation(piece.id, place.side, landmark.id)
    return None


def relations(pieces: Iterable[Entity]) -> frozenset[Relation]:
    """Every relation among the pieces, both ways."""
    pairs = permutations(pieces, 2)
    return frozenset(found for piece, landmark in pairs if (found := relation(piece, landmark)) is not None)

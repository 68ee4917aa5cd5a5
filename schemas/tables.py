"""Tables with colored pieces on them, as files of tasks have them: what a task and a camera know of them alike."""

import math

from msgspec import Struct

from engage_hri.schemas.footprints import PiecePose, Point
from engage_hri.schemas.units import Meters, Radians, Vector
from engage_hri.schemas.world import Entity

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

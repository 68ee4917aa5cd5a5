"""Tables with colored pieces on them, as the file of a task tells them: what a task and a camera know of them alike."""

import math

from msgspec import Struct

from engage_hri.schemas.footprints import PiecePose, Point
from engage_hri.schemas.units import Meters, Vector
from engage_hri.schemas.world import Entity


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

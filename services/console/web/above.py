"""The scene seen from above: the projection of the map of the window. Pure.

It is the view of the person opposite the robot: the robot is at the top, and its left is on the right.
"""

import math
from collections.abc import Iterable
from typing import NamedTuple

from engage_hri.schemas.units import Meters, Vector
from engage_hri.schemas.world import Entity

RIGHT = (0.0, 1.0)
"""Part that the robot's x and y have in what is to the right in the picture."""
DOWN = (1.0, 0.0)
"""Part that they have in what is down in the picture."""
ROOM: Meters = 0.3
"""Room around a person, for the body and the name."""
STEP: Meters = 0.05
"""Steps of the edges, so that these stand still while somebody moves a little."""


class PictureEdges(NamedTuple):
    """Edges of the picture, in metres to the right and down from the robot."""

    left: Meters
    top: Meters
    right: Meters
    bottom: Meters


LEAST = PictureEdges(-0.62, -0.27, 0.62, 1.5)
"""What is in view at least."""


def seen(x: Meters, y: Meters) -> tuple[Meters, Meters]:
    """Place in the picture, to the right and down, of a place before the robot."""
    return (RIGHT[0] * x + RIGHT[1] * y, DOWN[0] * x + DOWN[1] * y)


def outline(entity: Entity) -> list[tuple[Meters, Meters]]:
    """Corners of an entity where it lies, in the robot's x and y; empty: it has none."""
    x, y, _ = entity.position
    cos, sin = math.cos(entity.yaw), math.sin(entity.yaw)
    return [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in entity.footprint]


def frame(entities: Iterable[Entity], people: Iterable[Vector]) -> PictureEdges:
    """Frame with everybody and everything: a second person sits beside the table, another world may be wider.

    people: places of those who are there. entities: hands and people among them do not count.
    """
    things = [each for each in entities if each.kind not in ("hand", "person")]
    corners = [corner for each in things for corner in (outline(each) or [each.position[:2]])]
    places = [seen(x, y) for x, y in corners]
    places += [
        (right + ROOM * side, down + ROOM * front)
        for right, down in (seen(x, y) for x, y, _ in people)
        for side, front in ((-1, 0), (1, 0), (0, 1))
    ]
    steps = [(_up(-right), _up(right), _up(down)) for right, down in places]
    return PictureEdges(
        left=min([LEAST.left, *(-left for left, _, _ in steps)]),
        top=LEAST.top,
        right=max([LEAST.right, *(right for _, right, _ in steps)]),
        bottom=max([LEAST.bottom, *(down for _, _, down in steps)]),
    )


def _up(value: Meters) -> Meters:
    return math.ceil(round(value / STEP, 6)) * STEP

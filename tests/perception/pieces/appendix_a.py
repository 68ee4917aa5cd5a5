"""Relations of pieces that touch, once more from the definitions of Appendix A, for what the pieces are told to do.

A piece touches a side of another if an edge of it lies exactly on an edge of equal length; sides are the human's, who
sits opposite the robot: their top is toward the robot, their right its left. Hands are not exact: an edge may be 5 mm
longer, 12 degrees oblique, and its middle 12 mm beside.
"""

import cmath
import math
from collections.abc import Mapping

from engage_hri.schemas.world import Entity
from tests.perception.pieces.tables import FOOTPRINTS, Pose

Outline = list[complex]
SIDES = {0: "top", 45: "top right", 90: "right", 135: "bottom right", 180: "bottom", 225: "bottom left", 270: "left",
         315: "top left"}  # fmt: skip
"""Sides by the bearing at which the human sees them, clockwise from away from themselves."""


def outlines(poses: Mapping[str, Pose]) -> dict[str, Outline]:
    """Corners, as the human sees them: to the right, and up to the top."""
    found = {}
    for id, (x, y, turn) in poses.items():
        places = [complex(x, y) + complex(*corner) * cmath.exp(1j * turn) for corner in FOOTPRINTS[id]]
        found[id] = [complex(place.imag, -place.real) for place in places]
    return found


def relations(poses: Mapping[str, Pose]) -> set[tuple[str, str, str]]:
    """Piece, side and landmark of all that touch."""
    shapes, found = outlines(poses), set()
    for piece, mine in shapes.items():
        for landmark, theirs in shapes.items():
            middle = sum(theirs) / len(theirs)
            for a, b in _edges(theirs):
                lies = any(_lie_on(a, b, c, d) for c, d in _edges(mine))
                if piece != landmark and lies:
                    found.add((piece, _side(a, b, middle), landmark))
    return found


def poses_told(entities: tuple[Entity, ...]) -> dict[str, Pose]:
    return {each.id: (*each.position[:2], each.yaw) for each in entities if each.kind == "object"}


def _edges(outline: Outline) -> list[tuple[complex, complex]]:
    return list(zip(outline, [*outline[1:], outline[0]], strict=True))


def _lie_on(a: complex, b: complex, c: complex, d: complex) -> bool:
    oblique = abs(cmath.phase((b - a) / (c - d)))  # the outlines of both run the same way, so the edges do not
    same = abs(abs(b - a) - abs(d - c)) <= 0.005
    return same and oblique <= math.radians(12) and abs((a + b) / 2 - (c + d) / 2) <= 0.012


def _side(a: complex, b: complex, middle: complex) -> str:
    out = (b - a) * 1j
    if ((a + b) / 2 - middle).real * out.real + ((a + b) / 2 - middle).imag * out.imag < 0:
        out = -out
    bearing = math.degrees(math.atan2(out.real, out.imag)) % 360
    return SIDES[round(bearing / 45) % 8 * 45]

"""The face of the torso as its screen shows it: shapes of eyes, brows and mouth from its joints. Pure."""

from collections.abc import Mapping
from math import cos, radians, sin

from msgspec import Struct

from engage_hri.schemas.units import Degrees, Meters

EYE: Meters = 0.017
"""Half the height of an open eye."""
BROWS, MOUTH = 0.118, 0.035
"""Heights at rest in the frame of the head, metres."""


class Stroke(Struct, frozen=True):
    """A part of the face. y, z: its middle in the frame of the head. tilt: its outer end up. height: of an eye."""

    y: Meters
    z: Meters
    tilt: Degrees = 0.0
    height: Meters = 0.0


def strokes(pose: Mapping[str, float]) -> dict[str, Stroke]:
    """The parts of the face by the names of their shapes in the model."""
    found: dict[str, Stroke] = {}
    parted, open_by = 0.004 * pose["lips"], 0.016 * pose["jaw"]
    for side, sign in (("left", 1), ("right", -1)):
        lid, brow, corner = pose[f"{side}_lid"], pose[f"{side}_brow"], pose[f"{side}_mouth_corner"]
        found[f"{side}_eye"] = Stroke(sign * 0.030, 0.088, height=EYE * max(0.08, min(1.3, 1.0 - lid)))
        found[f"{side}_brow"] = Stroke(sign * 0.030, BROWS + 0.009 * brow, tilt=-25.0 * pose["brow_slant"])
        height = MOUTH + 0.003 * corner + parted / 2
        found[f"{side}_mouth"] = Stroke(sign * 0.0125, height, tilt=32.0 * corner)
    found["jaw"] = Stroke(0.0, MOUTH - parted / 2 - open_by)
    return found


def turned(name: str, stroke: Stroke) -> tuple[float, float, float, float]:
    """Quaternion of a part that lies across the face."""
    tilt = stroke.tilt if not name.startswith("right") else -stroke.tilt
    half = radians(90.0 + tilt) / 2
    return (cos(half), sin(half), 0.0, 0.0)

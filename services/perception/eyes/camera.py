"""Camera of the eyes: from its axes to the robot's frame, and how wide it sees. Pure.

Axes of a camera: x to the right of the picture, y down, z away from it; without distortion.
"""

from math import radians, tan

import numpy as np

from engage_hri.schemas.units import Degrees, Vector
from engage_hri.services.perception.eyes.looking import Floats


class StatedCamera:
    """A camera where the settings say that it stands.

    field_of_view: from the left edge to the right, degrees. place: in the robot's frame. tilt: up; pan: to the left;
    roll: the right edge down.
    """

    def __init__(
        self, field_of_view: Degrees, place: Vector, tilt: Degrees, pan: Degrees, roll: Degrees = 0.0
    ) -> None:
        self._half, self._place = tan(radians(field_of_view) / 2), np.array(place)
        cu, cl, cr = np.cos(np.radians([tilt, pan, roll]))
        su, sl, sr = np.sin(np.radians([tilt, pan, roll]))
        ahead = np.array([cl * cu, sl * cu, su])
        right = np.array([sl, -cl, 0.0])
        down = np.cross(ahead, right)
        self._axes = np.column_stack([cr * right + sr * down, cr * down - sr * right, ahead])

    def focal(self, width: int) -> float:
        """Focal length for pictures of a width, in pixels."""
        return width / 2 / self._half

    def place(self, point: Floats) -> Vector:
        """Place in the robot's frame of a point in camera axes."""
        x, y, z = (self._place + self._axes @ point).tolist()
        return (x, y, z)

    def direction(self, direction: Floats) -> Vector:
        """Direction in the robot's frame of one in camera axes."""
        x, y, z = (self._axes @ direction).tolist()
        return (x, y, z)

    def pixels(self, points: Floats, width: int, height: int) -> Floats:
        """Pixels at which places are, from the corner of pictures of a size. points: rows of x, y, z."""
        x, y, z = ((np.asarray(points) - self._place) @ self._axes).T
        return np.column_stack([width / 2 + self.focal(width) * x / z, height / 2 + self.focal(width) * y / z])

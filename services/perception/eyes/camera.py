"""Camera of the eyes: from its axes to the robot's frame, and how wide it sees. Pure.

    StatedCamera    stands where the settings say
    SeatCamera      is that of somebody who has a seat before the robot, and sits anywhere

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


class SeatCamera:
    """A camera of somebody's own, as of the computer at which they sit, that counts as the eyes of the robot.

    Where it stands nobody knows, but who is before it has a place: that of the seat. So the first head that it sees
    is there. What is seen later lies beside that, turned and scaled alike, as if the robot saw it: who looks into the
    camera looks at the robot's eyes, wherever their head is.

    field_of_view: as of a `StatedCamera`. eyes, seat: places in the robot's frame.
    """

    def __init__(self, field_of_view: Degrees, eyes: Vector, seat: Vector) -> None:
        away = np.subtract(seat, eyes)
        across = float(np.hypot(away[0], away[1]))
        tilt, pan = np.degrees(np.arctan2(away[2], across)), np.degrees(np.arctan2(away[1], away[0]))
        self._level = StatedCamera(field_of_view, (0.0, 0.0, 0.0), float(tilt), float(pan))
        self._eyes, self._away = np.array(eyes), away
        self._turn: Floats | None = None
        self._scale = 1.0

    def focal(self, width: int) -> float:
        """Focal length for pictures of a width, in pixels."""
        return self._level.focal(width)

    def place(self, point: Floats) -> Vector:
        """Place in the robot's frame of a head in camera axes; that of the first one is the seat."""
        if self._turn is None:
            self._scale = float(np.linalg.norm(self._away) / np.linalg.norm(point))
            self._turn = _turn(np.array(self._level.direction(point)), self._away)
        x, y, z = (self._eyes + self._scale * self._turned(point)).tolist()
        return (x, y, z)

    def direction(self, direction: Floats) -> Vector:
        """Direction in the robot's frame of one in camera axes."""
        x, y, z = self._turned(direction).tolist()
        return (x, y, z)

    def _turned(self, vector: Floats) -> Floats:
        level = np.array(self._level.direction(vector))
        turned: Floats = level if self._turn is None else self._turn @ level
        return turned


def _turn(one: Floats, other: Floats) -> Floats:
    """The least rotation that takes one direction to another, which are less than half a turn apart."""
    one, other = one / np.linalg.norm(one), other / np.linalg.norm(other)
    x, y, z = np.cross(one, other)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn: Floats = np.eye(3) + cross + cross @ cross / (1 + one @ other)
    return turn

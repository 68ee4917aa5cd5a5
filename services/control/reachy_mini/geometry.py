"""Frames of Reachy Mini: joint angles, the gaze axis in the robot's frame, and the daemon's poses of the head. Pure.

Angles are Engage's: positive to the left, up, tilted to the left, leaning forward. The daemon tells the head's pose
in the frame of the foot, whatever the body's turn: x ahead, y to the left, z up; its pitch is positive down.
"""

import math
from collections.abc import Mapping

from engage_hri.schemas.body import Ray
from engage_hri.schemas.units import Meters, Radians, Vector

HEAD_HEIGHT: Meters = 0.177
"""From the foot to the head's frame while it is at rest: `head_z_offset` of the daemon's kinematics."""
EYES_AHEAD: Meters = 0.0395
EYES_ABOVE: Meters = 0.0525
"""The camera in the head's frame, from the vendor's description of the robot. It looks along the head's x axis."""
Angles = Mapping[str, Radians]


class Mounting:
    """The place of the foot in the robot's frame. position: metres. facing: radians to its left."""

    def __init__(self, position: Vector, facing: Radians) -> None:
        self.position = position
        self._cos, self._sin = math.cos(facing), math.sin(facing)

    def to_foot(self, point: Vector) -> Vector:
        """A point of the robot's frame in the frame of the foot, metres."""
        x, y, z = (there - here for there, here in zip(point, self.position, strict=True))
        return (self._cos * x + self._sin * y, self._cos * y - self._sin * x, z)

    def from_foot(self, point: Vector) -> Vector:
        """A point of the frame of the foot in the robot's frame, metres."""
        x, y, z = self.turned(point)
        return (x + self.position[0], y + self.position[1], z + self.position[2])

    def turned(self, axis: Vector) -> Vector:
        """A direction of the frame of the foot in the robot's frame."""
        x, y, z = axis
        return (self._cos * x - self._sin * y, self._sin * x + self._cos * y, z)


def head_place(pose: Angles) -> Vector:
    """Place of the head's frame, against where it is at rest: it leans about the foot, metres."""
    ahead = HEAD_HEIGHT * math.sin(pose["body_lean"])
    down = HEAD_HEIGHT * (1.0 - math.cos(pose["body_lean"]))
    return (ahead * math.cos(pose["body_yaw"]), ahead * math.sin(pose["body_yaw"]), -down)


def lean(x: Meters, y: Meters, body_yaw: Radians) -> Radians:
    """Lean of the body, from the measured place of the head's frame."""
    ahead = x * math.cos(body_yaw) + y * math.sin(body_yaw)
    return math.asin(max(-1.0, min(1.0, ahead / HEAD_HEIGHT)))


def gaze(pose: Angles, mounting: Mounting) -> Ray:
    """Gaze in the robot's frame: from the camera along its axis."""
    yaw, pitch, roll = pose["head_yaw"], pose["head_pitch"], pose["head_roll"]
    ahead = (math.cos(pitch) * math.cos(yaw), math.cos(pitch) * math.sin(yaw), math.sin(pitch))
    left = (-math.sin(yaw), math.cos(yaw), 0.0)
    upright = (-math.sin(pitch) * math.cos(yaw), -math.sin(pitch) * math.sin(yaw), math.cos(pitch))
    up = tuple(math.cos(roll) * a + math.sin(roll) * b for a, b in zip(upright, left, strict=True))
    x, y, z = head_place(pose)
    eyes = tuple(
        here + EYES_AHEAD * a + EYES_ABOVE * b for here, a, b in zip((x, y, z + HEAD_HEIGHT), ahead, up, strict=True)
    )
    return Ray(origin=mounting.from_foot((eyes[0], eyes[1], eyes[2])), axis=mounting.turned(ahead))


def aim(target: Vector, pose: Angles, mounting: Mounting) -> tuple[Radians, Radians]:
    """Yaw and pitch of the head whose gaze axis runs through a place, whether the head comes there or not.

    target: metres in the robot's frame. pose: the turn and lean of the body count.
    """
    x, y, z = mounting.to_foot(target)
    dx, dy, dz = head_place(pose)
    x, y, z = x - dx, y - dy, z - dz - HEAD_HEIGHT
    across = math.hypot(x, y)
    # The axis passes EYES_ABOVE the head's frame, so the pitch is a little less than the direction from there.
    above = math.asin(EYES_ABOVE / max(math.hypot(across, z), EYES_ABOVE))
    return math.atan2(y, x), math.atan2(z, across) - above

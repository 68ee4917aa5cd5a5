"""Aims at places in the world: how the trunk changes the joint angles of head and arms that are on one. Pure.

A path that has a target is laid as if the trunk stood still. Where the trunk is elsewhere, or moves, the angles that
it takes to be on target change; this difference is added to the path at each instant, as eyes do against a turn of
the head. So who is on target stays there, and comes there at the instant that the path says.
"""

from collections.abc import Sequence

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Radians, Vector
from engage_hri.services.control.torso import kinematics
from engage_hri.services.control.torso.kinematics import Side
from engage_hri.services.control.torso.path import Array, JointMotion

Trunk = tuple[float, ...]
"""Angles of the trunk: turn, lean."""
NECK = ("neck_yaw", "neck_pitch")
TRUNK = ("torso_turn", "torso_lean")
SAME = 1e-9
"""Radians that tell no two places of the trunk apart."""
_FIRST, _SECOND = 1e-4, 1e-3
"""Radians of the trunk over which first and second derivatives are taken."""


class Aim(Struct, frozen=True, kw_only=True):
    """A place that a part is on, and the place of the trunk for which its path is laid.

    side: of the arm; None: the head. pitch: of the shoulder, which stays; the other joints of an arm follow from it.
    beside: radians of yaw and pitch by which a gaze passes the place. reserve: of the neck, kept free at the limits.
    """

    target: Vector
    trunk: Trunk
    side: Side | None = None
    pitch: Radians = 0.0
    beside: tuple[Radians, Radians] = (0.0, 0.0)
    reserve: Radians = 0.0

    def angles(self, trunk: Trunk) -> tuple[float, ...]:
        """Joint angles on target with the trunk at `trunk`, as near as the joints come."""
        limits = [kinematics.LIMIT[joint] for joint in self.joints]
        free = self._free(trunk)
        if self.side is None:
            free = (free[0] + self.beside[0], free[1] + self.beside[1])
        return tuple(
            min(max(angle, limit.low + self.reserve), limit.high - self.reserve)
            for angle, limit in zip(free, limits, strict=True)
        )

    def is_in_reach(self, trunk: Trunk) -> bool:
        """True if the joints come to where they are on target."""
        limits = [kinematics.LIMIT[joint] for joint in self.joints]
        return all(
            limit.low + self.reserve - SAME <= angle <= limit.high - self.reserve + SAME
            for angle, limit in zip(self._free(trunk), limits, strict=True)
        )

    @property
    def joints(self) -> tuple[str, ...]:
        return NECK if self.side is None else kinematics.joints_of(f"{self.side}_arm")

    def within(self, angles: Array) -> Array:
        """The angles, or the nearest that the joints can take."""
        limits = [kinematics.LIMIT[joint] for joint in self.joints]
        low, high = ([getattr(limit, end) for limit in limits] for end in ("low", "high"))
        return np.clip(angles, np.add(low, self.reserve), np.subtract(high, self.reserve))

    def at(self, trunk: Trunk) -> "Aim":
        """The same aim of a path that is laid for another place of the trunk."""
        return replace(self, trunk=trunk)

    def is_still(self, trunk: JointMotion) -> bool:
        """True if the trunk rests where the path is laid for."""
        return trunk.at_rest and bool(np.all(np.abs(trunk.q - self.trunk) < SAME))

    def offset(self, trunk: Sequence[float] | Array) -> Array:
        """Difference that has to be added to the joint angles of the path, with the trunk at `trunk`."""
        turn, lean = trunk
        if abs(turn - self.trunk[0]) < SAME and abs(lean - self.trunk[1]) < SAME:
            return np.zeros(len(self.joints))
        return np.subtract(self.angles((turn, lean)), self.angles(self.trunk))

    def added(self, path: JointMotion, trunk: JointMotion) -> JointMotion:
        """The state of the joints whose path is in the state `path`, while the trunk is in the state `trunk`."""
        if self.is_still(trunk):
            return path
        by = self._moved(trunk)
        return JointMotion(path.q + by.q, path.v + by.v, path.a + by.a)

    def removed(self, joints: JointMotion, trunk: JointMotion) -> JointMotion:
        """The state of a path on which the joints are in the state `joints`."""
        if self.is_still(trunk):
            return joints
        by = self._moved(trunk)
        return JointMotion(joints.q - by.q, joints.v - by.v, joints.a - by.a)

    def _moved(self, trunk: JointMotion) -> JointMotion:
        """The offset as a state of motion, while the trunk moves."""
        here = self.offset(trunk.q)
        velocity, acceleration = np.zeros_like(here), np.zeros_like(here)
        if (speed := float(np.max(np.abs(trunk.v)))) > SAME:
            velocity = self._slope(trunk.q, trunk.v, _FIRST / speed)
            step = _SECOND / speed * trunk.v
            curve = self.offset(trunk.q + step) - 2 * here + self.offset(trunk.q - step)
            acceleration = curve * (speed / _SECOND) ** 2
        if (change := float(np.max(np.abs(trunk.a)))) > SAME:
            acceleration = acceleration + self._slope(trunk.q, trunk.a, _FIRST / change)
        return JointMotion(here, velocity, acceleration)

    def _slope(self, at: Array, along: Array, step: float) -> Array:
        return (self.offset(at + step * along) - self.offset(at - step * along)) / (2 * step)

    def _free(self, trunk: Trunk) -> tuple[float, ...]:
        """Joint angles on target, whether the joints come there or not."""
        pose = dict(zip(TRUNK, trunk, strict=True))
        if self.side is None:
            return kinematics.neck_angles(self.target, pose)
        return kinematics.arm_angles(self.side, self.target, self.pitch, pose)

"""Aims at places in the world: how the trunk changes the joint angles of head and arms that are on one. Pure.

A path that has a target is laid as if the trunk stood still. Where the trunk is elsewhere, or moves, the angles that
it takes to be on target change; this difference is added to the path at each instant, as eyes do against a turn of
the head. So who is on target stays there, and comes there at the instant that the path says.
"""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Radians, Vector
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.kinematics import Side
from engage_hri.services.control.motion.path import Array, JointMotion

Trunk = tuple[float, ...]
"""Angles of the trunk: turn, lean."""
NECK = ("neck_yaw", "neck_pitch")
TRUNK = ("torso_turn", "torso_lean")
SAME = 1e-9
"""Radians that tell no two places of the trunk apart."""
UPRIGHT: Trunk = (0.0, 0.0)


def _joints(side: Side | None) -> tuple[str, ...]:
    return NECK if side is None else kinematics.joints_of(f"{side}_arm")


_SIDES: tuple[Side | None, ...] = (None, "left", "right")
_RANGES: Mapping[Side | None, tuple[tuple[float, float], ...]] = {
    side: tuple((kinematics.LIMIT[joint].low, kinematics.LIMIT[joint].high) for joint in _joints(side))
    for side in _SIDES
}
"""Lowest and highest angle of each joint of an arm, or of the head."""
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
        return self.nearest(self._free(trunk))

    def nearest(self, angles: Sequence[float]) -> tuple[float, ...]:
        """Joint angles nearest to those on target, of which a gaze goes beside."""
        if self.side is None:
            angles = (angles[0] + self.beside[0], angles[1] + self.beside[1])
        reserve = self.reserve
        return tuple(
            [
                min(max(angle, low + reserve), high - reserve)
                for angle, (low, high) in zip(angles, _RANGES[self.side], strict=True)
            ]
        )

    def is_in_reach(self, trunk: Trunk) -> bool:
        """True if the joints come to where they are on target."""
        reserve = self.reserve - SAME
        return all(
            low + reserve <= angle <= high - reserve
            for angle, (low, high) in zip(self._free(trunk), _RANGES[self.side], strict=True)
        )

    @property
    def joints(self) -> tuple[str, ...]:
        return _joints(self.side)

    def within(self, angles: Array) -> Array:
        """The angles, or the nearest that the joints can take."""
        low, high = zip(*_RANGES[self.side], strict=True)
        return np.clip(angles, np.add(low, self.reserve), np.subtract(high, self.reserve))

    def at(self, trunk: Trunk) -> "Aim":
        """The same aim of a path that is laid for another place of the trunk."""
        return replace(self, trunk=trunk)

    def is_laid_for(self, trunk: Sequence[float] | Array) -> bool:
        """True if the path is laid for the trunk at `trunk`."""
        turn, lean = trunk
        return bool(abs(turn - self.trunk[0]) < SAME and abs(lean - self.trunk[1]) < SAME)

    def offset(self, trunk: Sequence[float] | Array) -> Array:
        """Difference that has to be added to the joint angles of the path, with the trunk at `trunk`."""
        if self.is_laid_for(trunk):
            return np.zeros(len(_RANGES[self.side]))
        turn, lean = trunk
        return np.subtract(self.angles((float(turn), float(lean))), _supposed(self))

    def offsets(self, trunks: Array) -> Array:
        """The same for an arm with the trunk at many places at once, places x 2: an array of places x joints."""
        assert self.side is not None, "arms are asked for"
        free = kinematics.arm_angles_over(self.side, self.target, self.pitch, trunks.T)
        is_there = np.all(np.abs(trunks - self.trunk) < SAME, axis=1, keepdims=True)
        return np.where(is_there, 0.0, self.within(np.stack(free, axis=1)) - _supposed(self))

    def added(self, path: JointMotion, trunk: JointMotion) -> JointMotion:
        """The state of the joints whose path is in the state `path`, while the trunk is in the state `trunk`."""
        by = self._moved(trunk)
        return JointMotion(path.q + by.q, path.v + by.v, path.a + by.a)

    def removed(self, joints: JointMotion, trunk: JointMotion) -> JointMotion:
        """The state of a path on which the joints are in the state `joints`."""
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


@lru_cache(16)
def _supposed(aim: Aim) -> tuple[float, ...]:
    """Angles on target with the trunk where the path supposes it."""
    return aim.angles(aim.trunk)

"""Aims at places in the world: how the trunk changes the joint angles of head and arms that are on one. Pure."""

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Radians, Vector
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.kinematics import Side
from engage_hri.services.control.motion.path import Array
from engage_hri.services.control.motion.track import SAME, Place, Trunk

NECK = ("neck_yaw", "neck_pitch")
TRUNK = ("torso_turn", "torso_lean")
UPRIGHT: Trunk = (0.0, 0.0)


def _joints(side: Side | None) -> tuple[str, ...]:
    return NECK if side is None else kinematics.joints_of(f"{side}_arm")


_SIDES: tuple[Side | None, ...] = (None, "left", "right")
_RANGES: Mapping[Side | None, tuple[tuple[float, float], ...]] = {
    side: tuple((kinematics.LIMIT[joint].low, kinematics.LIMIT[joint].high) for joint in _joints(side))
    for side in _SIDES
}
"""Lowest and highest angle of each joint of an arm, or of the head."""


class Aim(Struct, Place, frozen=True, kw_only=True):
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

"""A behavior worked out for a figure: where its joints go, its sync points on the way, and how long a way takes."""

import math
from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.body import NoPointZone, Ray
from engage_hri.schemas.units import Degrees, Radians, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.kinematics import Side
from engage_hri.services.control.figure.repertoire import BUILT_IN, Repertoire
from engage_hri.services.control.motion.motion import SAME, MotionPlan, Place, Trunk, WalkPoint
from engage_hri.services.control.motion.path import Array, Leg

# -- aims ------------------------------------------------------------------------------------------------------------

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


class Course(MotionPlan, frozen=True, kw_only=True):
    """A motion plan of a figure: it may aim at a place, and its trunk may move meanwhile."""

    ray: Ray | None = None
    is_resizable: bool = False
    """True if it may be made smaller for want of time; false for a motion with a target."""
    aim: Aim | None = None
    """The place that its first part is on from its beginning until it leaves its target: the trunk may move
    meanwhile."""
    trunks: tuple[Trunk, ...] = (UPRIGHT,)
    """Places where the trunk may be while arms move along it. A course that moves the trunk itself needs none."""

    @property
    def turns_trunk(self) -> bool:
        """True if it turns the trunk under a head that is on a place: the path of the head is laid for the end."""
        return self.aim is not None and TRUNK[0] in self.joints


class Situation(Struct, frozen=True):
    """Circumstances of a course. pose: joint angles at its start, with the trunk where it is going to be.

    rest: joint angles that it returns to. trunk: where the trunk is at its start; None: where it is going to be.
    trunks: places where the trunk is, or may be, from its start to its end.
    """

    pose: Mapping[str, float]
    rest: Mapping[str, float]
    world: World
    zones: tuple[NoPointZone, ...] = ()
    busy: tuple[str, ...] = ()
    """Names of parts in use: a pointing without a mode takes the other arm."""
    repertoire: Repertoire = BUILT_IN
    trunk: Trunk | None = None
    trunks: tuple[Trunk, ...] = (UPRIGHT,)

    def start(self, aim: Aim) -> tuple[float, ...]:
        """Angles from which the path of a part begins that is going to be on a place."""
        here = angles(aim.joints, self.pose)
        trunk = self.trunk or angles(TRUNK, self.pose)
        return here if aim.is_laid_for(trunk) else tuple(np.subtract(here, aim.offset(trunk)).tolist())


def course(
    parts: tuple[str, ...], joints: tuple[str, ...], legs: tuple[Leg, ...], points: tuple[WalkPoint, ...],
    goal: tuple[float, ...], ray: Ray | None = None, note: str = "", aim: Aim | None = None,
) -> Course:  # fmt: skip
    """Make the course of a motion to `goal`."""
    return Course(
        parts=parts, joints=joints, legs=legs, points=points, on_target=dict(zip(joints, goal, strict=True)), ray=ray,
        note=note, aim=aim,
    )  # fmt: skip


def marks(fraction: float, *syncs: str) -> tuple[tuple[str, float], ...]:
    return tuple((sync, fraction) for sync in syncs)


def angles(joints: tuple[str, ...], pose: Mapping[str, float]) -> tuple[float, ...]:
    return tuple(pose[joint] for joint in joints)


LEAST_TURN = 0.3
"""Degrees: a gaze that would turn less does not move."""
LEAST_LEAN = 0.8
"""Degrees: a torso that has less to go stays; twice what it drifts on target."""
LEAST_FACE = 0.04
"""A face that has less to go stays. A share of its joints' ranges."""


def turning_time(start: Sequence[float], goal: Sequence[float]) -> Seconds:
    """Natural duration of a turn of the head: 0.3 s for 30 degrees, 0.5 s for 60, nothing for none."""
    turn = kinematics.degrees_between(start, goal)
    return 0.0 if turn < LEAST_TURN else 0.1 + turn / 150.0


def return_time(start: Sequence[float], goal: Sequence[float]) -> Seconds:
    """Natural duration of the way home of an arm, the torso or a face."""
    way = kinematics.degrees_between(start, goal)
    return 0.0 if way < 0.01 else 0.3 + max(abs(math.degrees(b - a)) for a, b in zip(start, goal, strict=True)) / 120


def arm_time(start: Sequence[float], goal: Sequence[float], least: Seconds, speed: Degrees) -> Seconds:
    return max(least, 0.15 + max(abs(math.degrees(b - a)) for a, b in zip(start, goal, strict=True)) / speed)


def moving_time(joints: Sequence[str], start: Sequence[float], goal: Sequence[float]) -> Seconds:
    """Natural duration of the way to an expression of the face or to a posture; nothing if it is hardly any way."""
    ways = {joint: abs(b - a) for joint, a, b in zip(joints, start, goal, strict=True)}
    if kinematics.LIMIT[joints[0]].part == "face":
        return max(map(_face_time, ways, ways.values())) if max(ways.values()) >= LEAST_FACE else 0.0
    return 0.0 if math.degrees(sum(ways.values())) < LEAST_LEAN else 2 * return_time(start, goal)


def _face_time(joint: str, way: float) -> Seconds:
    """Natural duration of the way of one joint of the face. A lid is as quick as a person's: a blink takes 0.24 s."""
    if way < LEAST_FACE:
        return 0.0
    return 0.05 + 0.06 * way if joint.endswith("_lid") else 0.15 + 0.25 * way

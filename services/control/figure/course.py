"""A behavior worked out for the simulated torso: where its joints go, and its sync points on the way."""

from collections.abc import Mapping

import numpy as np
from msgspec import Struct

from engage_hri.schemas.body import NoPointZone, Ray
from engage_hri.schemas.world import World
from engage_hri.services.control.figure.aiming import UPRIGHT, Aim
from engage_hri.services.control.figure.repertoire import BUILT_IN, Repertoire
from engage_hri.services.control.motion.path import Leg
from engage_hri.services.control.motion.points import WalkPoint
from engage_hri.services.control.motion.track import Trunk


class Course(Struct, frozen=True, kw_only=True):
    """A behavior worked out: `legs` for `joints` from where they are, and its sync points in order."""

    parts: tuple[str, ...]
    joints: tuple[str, ...]
    legs: tuple[Leg, ...]
    points: tuple[WalkPoint, ...]
    on_target: Mapping[str, float] = {}
    """Joint angles at the stroke, or at the end of a shift."""
    ray: Ray | None = None
    is_resizable: bool = False
    """True if it may be made smaller for want of time; false for a motion with a target."""
    aim: Aim | None = None
    """The place that it is on from its beginning until it leaves its target: the trunk may move meanwhile."""
    trunks: tuple[Trunk, ...] = (UPRIGHT,)
    """Places where the trunk may be while arms move along it. A course that moves the trunk itself needs none."""
    note: str = ""
    """Warning, if this is only the nearest to what was asked: names both."""

    @property
    def arrival(self) -> str:
        """The sync point that says that a behavior has come to its target."""
        return "stroke" if any(point.sync == "stroke" for point in self.points) else "end"

    @property
    def stays(self) -> bool:
        """True for a shift: it goes nowhere from its goal."""
        return len(self.points) == 2

    @property
    def goal(self) -> tuple[float, ...]:
        """Angles of its joints on target."""
        return tuple(self.on_target.values())


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
        return (
            here
            if self.trunk is None or aim.is_laid_for(self.trunk)
            else tuple(np.subtract(here, aim.offset(self.trunk)).tolist())
        )


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

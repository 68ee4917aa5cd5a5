"""A behavior worked out as a motion: the legs of its path, its sync points, and where it may wait. Pure."""

from collections.abc import Mapping
from functools import cache

from msgspec import Struct

from engage_hri.schemas.behavior_types import SYNC_POINTS
from engage_hri.schemas.behaviors import BlockBehavior, GazeShift, HeadDirectionShift
from engage_hri.services.control.motion.path import Leg


class WalkPoint(Struct, frozen=True):
    """A sync point on the way of a behavior.

    held_with: the hold point at which it waits; its own name if it is one itself; empty: it is passed without a stop.
    stands_at: the later point up to which the motion may go while it waits here: it is on target at both.
    is_told: false for a place on the way that nobody is told of, as where a motor stalls; the motion stops there.
    """

    sync: str
    held_with: str = ""
    stands_at: str = ""
    is_told: bool = True


@cache
def held_on_target(*arrival: str) -> tuple[WalkPoint, ...]:
    """Sync points of a course that can hold while it is on target. arrival: points at which it is first there."""
    before = SYNC_POINTS[: SYNC_POINTS.index("stroke_end")]
    points = [WalkPoint(sync, "stroke", "relax") if sync in arrival else WalkPoint(sync) for sync in before]
    return (*points, WalkPoint("stroke_end", "relax"), WalkPoint("relax", "relax"), WalkPoint("end"))


@cache
def held_around_stroke(strokes: tuple[str, ...] = ()) -> tuple[WalkPoint, ...]:
    """Sync points of a course that can hold before and after its stroke. strokes: the stroke's repetitions."""
    number = SYNC_POINTS.index("stroke_end")
    syncs = (*SYNC_POINTS[:number], *strokes, *SYNC_POINTS[number:])
    return tuple(WalkPoint(sync, sync if sync in ("stroke_start", "stroke_end") else "") for sync in syncs)


class MotionPlan(Struct, frozen=True, kw_only=True):
    """A behavior worked out: `legs` for `joints` from where they are, and its sync points in order."""

    parts: tuple[str, ...]
    joints: tuple[str, ...]
    legs: tuple[Leg, ...]
    points: tuple[WalkPoint, ...]
    on_target: Mapping[str, float] = {}
    """Joint angles at the stroke, or at the end of a shift."""
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


def is_shift(behavior: BlockBehavior) -> bool:
    """True for a shift of the head: it says where the head belongs when no look lies over it."""
    return isinstance(behavior, GazeShift | HeadDirectionShift)

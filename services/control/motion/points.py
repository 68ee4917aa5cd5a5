"""Sync points of a behavior that moves, and where it may wait. Pure."""

from functools import cache

from msgspec import Struct

from engage_hri.schemas.behavior_types import SYNC_POINTS


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

"""Estimates of Reachy Mini, from the paths that it then moves along and the time by which its joints follow. Pure."""

import math
from collections.abc import Sequence
from itertools import pairwise

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import Estimate, Phase
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.figure.course import Course
from engage_hri.services.control.motion.path import Path, resting
from engage_hri.services.control.motion.points import WalkPoint
from engage_hri.services.control.reachy_mini import geometry, joints
from engage_hri.services.control.reachy_mini.courses import Circumstances
from engage_hri.services.control.reachy_mini.moving import Moves
from engage_hri.services.control.reachy_mini.tracks import NEAR

FRAME: Seconds = 0.02
"""Seconds between two measurements; a point is told of by the first one that bears it out."""


def motion_estimate(
    behavior: BlockBehavior, course: Course, path: Path, around: Circumstances, moves: Moves, lag: Seconds
) -> Estimate:
    """Estimate a behavior that moves along `path` from `around`."""
    track, stays = course.parts[0], len(course.points) == 2
    times = _times(course, path, around, moves, lag)
    after = dict(around.tracks)
    if track != "nod":
        after[track] = course.goal
    end = after if stays or track == "nod" else {**after, track: around.base[track]}
    if track == "torso":  # the head keeps looking where it does; the body turns under it
        yaw, pitch, _ = after["head"]
        after["head"] = (yaw, pitch, joints.follow(yaw, after["torso"][0]))
    degrees = 0.0
    if track == "head":
        turned = zip(around.tracks[track][:2], course.goal[:2], strict=True)
        degrees = math.degrees(sum(abs(b - a) for a, b in turned))
    part = joints.PARTS[track]
    return Estimate(
        behavior=behavior.id, feasible=True, degraded=course.note, parts=(part,),
        phases=_phases(course.points, times), head_degrees=degrees,
        ray=geometry.gaze(joints.summed(after), around.mounting) if track == "head" else None,
        pose_after=joints.message(joints.summed(after)), pose_end=joints.message(joints.summed(end)),
    )  # fmt: skip


def _times(course: Course, path: Path, around: Circumstances, moves: Moves, lag: Seconds) -> dict[str, Seconds]:
    """Times at which sync points are measured, in seconds from the beginning."""
    track = course.parts[0]
    times = {sync: s + _settling(track, path, s, lag) for sync, s in path.marks.items()}
    if "end" not in times:
        back = moves.way(track, resting(course.goal), around.base[track])
        times["end"] = times["relax"] + back.length + _settling(track, back, back.length, lag)
    return times


def _settling(track: str, path: Path, mark: Seconds, lag: Seconds) -> Seconds:
    """Time from when the plan is at a place of a path until the joints are measured near it."""
    if mark <= 0.0:
        return 0.0
    names = [limit.joint for limit in joints.TRACKS[track]]
    goal, steps = path.at(mark).q, 16
    for step in range(1, steps + 1):
        behind = min(mark, lag * step / steps)
        off = abs(path.at(mark - behind).q - goal)
        if any(each > NEAR[name] for name, each in zip(names, off.tolist(), strict=True)):
            return lag * (1.0 - (step - 1) / steps) + FRAME / 2
    return FRAME / 2


def _phases(points: Sequence[WalkPoint], times: dict[str, Seconds]) -> tuple[Phase, ...]:
    """Phases from each sync point to the next. It has one pace."""
    found = []
    for since, to in pairwise(points):
        took = max(0.0, times[to.sync] - times[since.sync])
        longest = None if to.held_with or not took else took
        hold = to.held_with == to.sync
        found.append(Phase(since=since.sync, to=to.sync, shortest=took, natural=took, longest=longest, hold=hold))
    return tuple(found)

"""Estimates of Reachy Mini, from the paths that it then moves along and the time by which its joints follow. Pure."""

import math
from itertools import pairwise

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import Estimate, Phase
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.motion.path import Path, resting
from engage_hri.services.control.reachy_mini import geometry, joints
from engage_hri.services.control.reachy_mini.courses import Circumstances, Course, Instant
from engage_hri.services.control.reachy_mini.moving import Moves
from engage_hri.services.control.reachy_mini.tracks import NEAR

FRAME: Seconds = 0.02
"""Seconds between two measurements; a point is told of by the first one that bears it out."""


def motion_estimate(
    behavior: BlockBehavior, course: Course, path: Path, around: Circumstances, moves: Moves, lag: Seconds
) -> Estimate:
    """Estimate a behavior that moves along `path` from `around`."""
    track = course.track
    times = _times(course, path, around, moves, lag)
    after = dict(around.tracks)
    if track != "nod":
        after[track] = course.goal
    end = after if course.stays or track == "nod" else {**after, track: around.base[track]}
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
        phases=_phases(course.instants, times), head_degrees=degrees,
        ray=geometry.gaze(joints.summed(after), around.mounting) if track == "head" else None,
        pose_after=joints.message(joints.summed(after)), pose_end=joints.message(joints.summed(end)),
    )  # fmt: skip


def _times(course: Course, path: Path, around: Circumstances, moves: Moves, lag: Seconds) -> dict[str, Seconds]:
    """Times at which sync points are measured, in seconds from the beginning."""
    times = {sync: s + _settling(course, path, s, lag) for sync, s in path.marks.items()}
    if not course.is_swing and not course.stays:
        back = moves.way(course.track, resting(course.goal), around.base[course.track])
        times["end"] = times["relax"] + back.length + _settling(course, back, back.length, lag)
    return times


def _settling(course: Course, path: Path, mark: Seconds, lag: Seconds) -> Seconds:
    """Time from when the plan is at a place of a path until the joints are measured near it."""
    if mark <= 0.0:
        return 0.0
    names = [limit.joint for limit in joints.TRACKS[course.track]]
    goal, steps = path.at(mark).q, 16
    for step in range(1, steps + 1):
        behind = min(mark, lag * step / steps)
        off = abs(path.at(mark - behind).q - goal)
        if any(each > NEAR[name] for name, each in zip(names, off.tolist(), strict=True)):
            return lag * (1.0 - (step - 1) / steps) + FRAME / 2
    return FRAME / 2


def _phases(instants: tuple[Instant, ...], times: dict[str, Seconds]) -> tuple[Phase, ...]:
    """Phases from each sync point to the next. It has one pace."""
    points = [(sync, instant.hold == sync) for instant in instants for sync in instant.syncs]
    found = []
    for (since, _), (to, hold) in pairwise(points):
        took = max(0.0, times[to] - times[since])
        group = next(instant for instant in instants if to in instant.syncs)
        longest = None if group.hold or not took else took
        found.append(Phase(since=since, to=to, shortest=took, natural=took, longest=longest, hold=hold))
    return tuple(found)

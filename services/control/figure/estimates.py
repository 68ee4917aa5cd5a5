"""Estimates of the simulated body, from the paths that it then moves along: without deviations they are exact.

A gesture or a nod that has to be on time is made smaller where faster is not enough.
"""

import math
from collections.abc import Callable, Container, Mapping, Sequence
from copy import copy
from itertools import pairwise
from math import inf

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Wait
from engage_hri.schemas.body import BodyPose, Estimate, Phase
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.figure import kinematics, tracks
from engage_hri.services.control.figure.course import Course
from engage_hri.services.control.motion.motion import SLOWEST, Motion, WalkPoint
from engage_hri.services.control.motion.path import Array, Leg, Path, resting
from engage_hri.services.runtime.steps import Steps

SIZES = (0.9, 0.8, 0.7, 0.6, 0.5, 0.4)
"""Shares of the full amplitude, largest first. Anything smaller than the last would not be taken for a gesture."""
OF_A_SIZE = 256
"""Elements that a size counts for (see `runtime.steps`)."""
LATE: Seconds = 0.001
"""A sync point counts as late if it comes more than this after the instant asked for."""


class Reduced(Struct, frozen=True):
    """Path for the rest of a course, at `size` times its full amplitude."""

    path: Path
    size: float


def quickest(course: Course, path: Path) -> dict[str, Seconds]:
    """Earliest times of the sync points: as fast as the joints permit and, where allowed, at the least size."""
    if course.is_resizable:
        small = _reduced(course, Motion(path, 0.0), 0.0, SIZES[-1])
        path = path if tracks.meets_table(small, course.joints, course.trunks) else small
    return {sync: s / path.fastest for sync, s in path.marks.items()}


def hurried(
    course: Course,
    motion: Motion,
    size: float,
    aims: Sequence[tuple[str, Seconds]],
    now: Seconds,
    cruise: float,
    stops: Container[str] = (),
) -> Steps[Reduced | None]:
    """Reduce a course to the largest size that is on time, or else to the least late; None: leave it at `size`.

    aims: sync points to come and the instants asked for. cruise: speed of its motors, 1 = as believed.
    stops: those of them at which it stands until their instants.
    """
    least = lateness(course, motion, aims, now, cruise, stops) if course.is_resizable else 0.0
    best: Reduced | None = None
    for each in SIZES:
        if each < size and least > 0.0:
            path = _reduced(course, motion, now, each / size)
            yield OF_A_SIZE
            late = lateness(course, Motion(path, now, cruise=cruise), aims, now, cruise, stops, enough=least)
            if late < least and not tracks.meets_table(path, course.joints, course.trunks):
                least, best = late, Reduced(path, each)
    return best


def lateness(
    course: Course, motion: Motion, aims: Sequence[tuple[str, Seconds]], now: Seconds, cruise: float,
    stops: Container[str] = (), *, enough: Seconds = inf,
) -> Seconds:  # fmt: skip
    """Seconds by which `motion` misses the worst of `aims` if nothing else stops it; 0: all are met.

    enough: lateness from which on it does not matter how much more it is.
    """
    trial, worst = copy(motion), 0.0
    trial.extend(inf, now)
    for number, (sync, at) in enumerate(aims):
        s = trial.path.marks[sync]
        trial.run_at(cruise, now)
        if sync not in stops or not trial.reaches(s, at):
            trial.reach(s, at, now, cruise * trial.path.fastest)
        crossing = trial.crossing(s)
        assert crossing is not None, "nothing limits the trial"
        worst, now = max(worst, crossing - at), max(now, crossing)
        if worst >= enough:
            break
        if sync in stops and now < at:
            left = trial.path.after(s, [later for later, _ in aims[number + 1 :]])
            now, start = at, resting(trial.path.at(s).q)
            trial = Motion(Path(start, left, tracks.limits_of(course.parts)), now, cruise=cruise)
    return worst if worst > LATE else 0.0


def _reduced(course: Course, motion: Motion, now: Seconds, by: float) -> Path:
    """Path from the current state of `motion`, its goals `by` times as far from the course's end, the safe pose."""
    s = motion.s(now)
    legs = motion.path.after(s) if s > 0.0 else motion.path.legs
    home = legs[-1].goal
    return Path(motion.at(now), [_nearer(leg, home, by) for leg in legs], tracks.limits_of(course.parts))


def _nearer(leg: Leg, home: tuple[float, ...], by: float) -> Leg:
    goal = tuple(rest + by * (angle - rest) for angle, rest in zip(leg.goal, home, strict=True))
    return replace(leg, goal=goal, velocity=tuple(by * speed for speed in leg.velocity))


Added = Callable[[Seconds], Array]
"""What the trunk adds to the joints of a path so many seconds after it began."""


def wait_estimate(behavior: Wait, duration: Seconds, pose: BodyPose) -> Estimate:
    told = phases((WalkPoint("start"), WalkPoint("end", "end")), {"start": 0.0, "end": duration})
    return Estimate(behavior=behavior.id, feasible=True, phases=told, pose_after=pose, pose_end=pose)


def motion_estimate(
    behavior: BlockBehavior,
    course: Course,
    path: Path,
    here: Mapping[str, float],
    added: Added | None = None,
    only: str = "",
) -> Estimate:
    """Estimate a behavior that moves along `path`. here: joint angles at its start.

    added: what the trunk adds to the path, if it moves. only: what is asked, as of `EstimateItem`.
    """
    degrees = 0.0
    if is_gaze(course) or is_arm(course):
        until = path.marks.get("stroke", path.length)
        degrees = math.degrees(path.travel(until) if added is None else _travel(path, until, added))
    estimate = Estimate(
        behavior=behavior.id,
        feasible=True,
        degraded=course.note,
        parts=("head",) if course.parts == ("nod",) else course.parts,
        head_degrees=degrees if is_gaze(course) else 0.0,
        arm_degrees=degrees if is_arm(course) else 0.0,
    )
    if only == "degrees":
        return estimate
    told = () if only else phases(course.points, path.marks, quickest(course, path), SLOWEST, path.gentlest_brake)
    pose, pose_end = poses(course, here)
    return replace(estimate, ray=course.ray, pose_after=pose, pose_end=pose_end, phases=told)


def is_gaze(course: Course) -> bool:
    return course.parts[0] == "head"


def is_arm(course: Course) -> bool:
    return course.parts[0].endswith("_arm")


def poses(course: Course, pose: Mapping[str, float]) -> tuple[BodyPose, BodyPose]:
    """Poses of all joints on target and at the end. pose: at the start, with the trunk where it is going to be."""
    # A nod is on top of the gaze, and leaves the neck where that has it.
    moved = () if course.parts == ("nod",) else zip(course.joints, course.legs[-1].goal, strict=True)
    return kinematics.pose_message({**pose, **course.on_target}), kinematics.pose_message({**pose, **dict(moved)})


def beneath_a_look(shift: Estimate) -> Estimate:
    """The estimate of a shift of the head that begins under a look: nothing moves, and it ends at once."""
    phases = tuple([replace(phase, shortest=0.0, natural=0.0, longest=None) for phase in shift.phases])
    return replace(shift, phases=phases, head_degrees=0.0)


def going_home(estimate: Estimate, leaves: str, back: Path) -> Estimate:
    """The estimate of a behavior that goes home by another path than the one it was laid with.

    leaves: the sync point from which the path `back` leads home.
    """
    syncs = [phase.since for phase in estimate.phases]
    number = syncs.index(leaves)
    at = {leaves: 0.0, **back.marks}
    homeward = []
    for phase in estimate.phases[number:]:
        natural = at[phase.to] - at[phase.since]
        longest = None if phase.hold or not natural else _longest(natural, SLOWEST, inf)
        homeward.append(replace(phase, natural=natural, shortest=natural / back.fastest, longest=longest))
    return replace(estimate, phases=(*estimate.phases[:number], *homeward))


def _travel(path: Path, until: Seconds, added: Added) -> float:
    """Way of all joints along `path` to which the trunk adds its share."""
    seen = [path.at(s).q + added(s) for s in np.linspace(0.0, until, 9).tolist()]
    return sum(float(np.sum(np.abs(after - before))) for before, after in pairwise(seen))


def phases(
    points: Sequence[WalkPoint],
    times: Mapping[str, Seconds],
    quickest: Mapping[str, Seconds] | None = None,
    slowest: float = 1.0,
    brake: float = inf,
) -> tuple[Phase, ...]:
    """Phases from each sync point to the next. One that ends at a hold point or takes no time has no longest time.

    times: of the points, at natural pace. quickest: in the greatest hurry. slowest: the least rate. brake: how fast
    the rate may change, in 1/s: who passes a hold point without a stop cannot dawdle right behind it.
    """
    least = times if quickest is None else quickest
    return tuple(
        Phase(
            since=since.sync,
            to=to.sync,
            shortest=max(0.0, min(least[to.sync] - least[since.sync], natural)),
            natural=natural,
            longest=None
            if to.held_with or not natural
            else _longest(natural, slowest, brake if since.held_with else inf),
            hold=to.held_with == to.sync,
        )
        for since, to in pairwise(points)
        for natural in [max(0.0, times[to.sync] - times[since.sync])]
    )


def _longest(natural: Seconds, slowest: float, brake: float) -> Seconds:
    """Seconds for a phase that is entered at the natural rate. A short one is over before the motion is slow."""
    return natural if 2 * brake * natural < 1.0 else natural / slowest

"""Size of a gesture or a nod that has to be on time: it is made smaller where faster is not enough. Pure."""

from collections.abc import Container, Sequence
from copy import copy
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Seconds
from engage_hri.services.control.figure import tracks
from engage_hri.services.control.figure.course import Course
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import Leg, Path, resting
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

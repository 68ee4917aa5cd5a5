"""Targets that the trunk brings into reach: what is on its way to one comes once it is there. Nothing waits here."""

import math
from collections.abc import Sequence

from msgspec.structs import replace

from engage_hri.schemas.units import Seconds
from engage_hri.services.control.figure.aiming import Aim
from engage_hri.services.control.motion.path import Leg, Path
from engage_hri.services.control.torso.parts import Parts

STEP: Seconds = 0.02
"""Seconds between two looks at where the trunk will be."""


def delay(torso: Parts, aim: Aim | None, at: Seconds) -> Seconds:
    """Seconds from that instant on until the target comes into reach as the trunk moves; 0: it is, or never."""
    trunk = torso.tracks["torso"]
    for step in range(1 + max(0, math.ceil((trunk.motion.end - at) / STEP))):
        if aim is None or aim.is_in_reach(trunk.angles(at + step * STEP)):
            return step * STEP
    return 0.0


def delayed(legs: Sequence[Leg], sync: str, by: Seconds) -> tuple[Leg, ...]:
    """Legs of which the one that ends in `sync` takes longer."""
    return tuple(replace(leg, seconds=leg.seconds + by) if sync in dict(leg.marks) else leg for leg in legs)


def wait_for_reach(torso: Parts) -> None:
    """Delay what is on its way to a target that is not in reach by then, since the trunk moves otherwise."""
    now = torso.clock.time()
    for run in dict.fromkeys(torso.runs.values()):
        point = run.course.arrival
        if run.course.aim is None or run.is_over or not run.awaits(point):
            continue
        at = run.motion.crossing(run.motion.path.marks[point])
        if at is not None and at > now and (late := delay(torso, run.course.aim, at)):
            track = torso.tracks[run.course.parts[0]]
            left = run.motion.path.after(run.motion.s(now), [each.sync for each in run.pending])
            start, legs = track.start_at(now, run.course.aim), delayed(left, point, late)
            path = Path(start, run.with_faults(legs), torso.limits(run, run.course.aim, now))
            torso.play(run, path, run.course.aim)
            run.bell.ring()

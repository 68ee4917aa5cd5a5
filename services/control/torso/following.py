"""Looks and pointing arms follow the entity that they are on, or on their way to, as it moves. Nothing waits here."""

import math
from math import radians

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gaze, Hand, Pointing
from engage_hri.schemas.units import Meters, Radians, Seconds
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import choreography, kinematics, tracks
from engage_hri.services.control.figure.course import Course, Situation
from engage_hri.services.control.figure.pace import arm_time
from engage_hri.services.control.motion.path import Leg, Path
from engage_hri.services.control.torso import head
from engage_hri.services.control.torso.parts import Parts
from engage_hri.services.control.torso.runs import Run

NOTICEABLE: Meters = 0.01
"""A target that moves less does not move an arm."""
BEHIND: Radians = radians(2.0)
"""Angle by which eyes may be behind a target that moves, and be on it."""
BESIDE: Meters = 0.03
"""Distance by which a forearm may be behind it."""


def follow(torso: Parts) -> None:
    """Turn head and arms to follow the entities that they are on, or on their way to."""
    _follow_with_head(torso)
    for part in ("left_arm", "right_arm"):
        run = torso.runs.get(part)
        if run is not None and isinstance(run.behavior, Pointing) and run.awaits("stroke_end"):
            _follow_with_arm(torso, run)


def _follow_with_head(torso: Parts) -> None:
    now, situation, track = torso.clock.time(), torso.situation(torso.world, real=True), torso.tracks["head"]
    torso.attention.update(situation)
    aim = torso.attention.aim
    if (run := torso.runs.get("head")) is None:
        head.turn(track, torso.attention.angles, now, aim)
        return
    try:
        course = choreography.plan(run.behavior, situation)
    except Impossible:
        run.is_lost = torso.world.entity(run.behavior.target) is not None  # type: ignore[union-attr]
        return
    run.is_lost = False
    path: Path | None = None
    if run.holding or run.awaits("stroke") or choreography.is_shift(run.behavior):
        path, aim = head.retargeted(run, course, track, now), course.aim
        run.course = course if path is not None else run.course
    elif not run.awaits("relax"):
        path = head.homeward(run, torso.attention.angles, track, now, aim)
    if path is not None:
        torso.play(run, path, aim)
        run.bell.ring()


def _follow_with_arm(torso: Parts, run: Run) -> None:
    assert isinstance(run.behavior, Pointing)
    assert run.course.aim is not None
    entity, now = torso.world.entity(run.behavior.target), torso.clock.time()
    if entity is None:
        return  # It was last seen where the arm points.
    if math.dist(entity.position, run.course.aim.target) < NOTICEABLE:
        run.is_lost = False
        return
    try:
        course = replanned(run, torso.situation(torso.world, real=True))
    except Impossible:
        run.is_lost = True
        return
    path = relaid(torso, run, course, now)
    run.is_lost = path is None or tracks.meets_table(path, course.joints, course.trunks[:1])
    if path is not None and not run.is_lost:
        run.course = course
        torso.play(run, path, course.aim)
        run.bell.ring()


def replanned(run: Run, situation: Situation) -> Course:
    """The course of a pointing of the same arm, in another situation. Raises Impossible."""
    assert isinstance(run.behavior, Pointing)
    hand: Hand = "LEFT_HAND" if run.course.parts == ("left_arm",) else "RIGHT_HAND"
    return choreography.plan(replace(run.behavior, mode=hand), situation)


def relaid(torso: Parts, run: Run, course: Course, now: Seconds) -> Path | None:
    """Path for the rest of a pointing whose target, or arm, is to be elsewhere; None: it is on its way home.

    course: to where it is to be.
    """
    if not run.awaits("stroke_end"):
        return None
    start = torso.tracks[run.course.parts[0]].start_at(now, course.aim)
    left = run.motion.path.after(run.motion.s(now), [point.sync for point in run.pending])
    here = tuple(start.q.tolist())
    if len(left) == 1:  # It waits at the end of its stroke.
        waiting = tuple((sync, 1.0) for sync, _ in left[0].marks if run.awaits(sync) and sync == "stroke_end")
        goal, last = course.legs[-2].goal, course.legs[-1]
        legs = [Leg(goal=goal, seconds=arm_time(here, goal, head.SHORTEST, 150.0), marks=waiting), last]
    else:
        new = course.legs[-len(left) :]
        legs = [replace(leg, goal=to.goal, velocity=to.velocity) for leg, to in zip(left, new, strict=True)]
        least = arm_time(here, legs[0].goal, 0.0, 150.0) - 0.15
        legs[0] = replace(legs[0], seconds=max(legs[0].seconds, least))
    return Path(start, run.with_faults(tuple(legs)), torso.limits(run, course.aim, now))


def is_behind(torso: Parts, run: Run) -> bool:
    """True if a behavior that waits on its target is still on its way to where that has moved."""
    now, aim = torso.clock.time(), run.course.aim
    if aim is None or now >= run.motion.end or not isinstance(run.behavior, Gaze | Pointing):
        return False
    if isinstance(run.behavior, Pointing) and run.pending[0].sync != "stroke_end":
        return False
    pose = tracks.pose_at({part: torso.tracks[part] for part in ("torso", *run.course.parts)}, now)
    if aim.side is None:
        on = aim.angles(torso.tracks["torso"].angles(now))
        return any(abs(pose[joint] - angle) > BEHIND for joint, angle in zip(aim.joints, on, strict=True))
    forearm = kinematics.arm(pose, aim.side)
    way = [there - here for there, here in zip(aim.target, forearm.origin, strict=True)]
    along = sum(a * b for a, b in zip(way, forearm.axis, strict=True))
    return math.dist(way, [along * each for each in forearm.axis]) > BESIDE

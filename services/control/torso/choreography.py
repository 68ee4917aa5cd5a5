"""Course of each behavior on the simulated torso: legs of a path, sync points on them, and where it may hold.

Motion out and back never retraces itself: at the stroke the joints drift sideways, so that their speed
passes through no zero and a gesture that is not held is one fluid motion.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import radians

from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    Face,
    FaceFacs,
    FaceLexeme,
    FaceShift,
    Gaze,
    GazeShift,
    Gesture,
    Head,
    HeadDirectionShift,
    Pointing,
    Pose,
    Posture,
    PostureShift,
    Speech,
    Wait,
)
from engage_hri.schemas.body import Ray
from engage_hri.schemas.syncref import SYNC_POINTS
from engage_hri.schemas.units import Degrees, Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.torso import kinematics
from engage_hri.services.control.torso.course import Course, CoursePoint, Impossible, Situation
from engage_hri.services.control.torso.kinematics import Side, Unreachable
from engage_hri.services.control.torso.motion import Leg
from engage_hri.services.control.torso.vocabulary import ACTION_UNITS, FACES, GESTURES, POSTURES

NOD_RESERVE = radians(18.0)
"""Part of the neck's range that gaze keeps free, so that a nod finds room anywhere."""
LEAST_TURN = 0.3
"""Degrees: a gaze that would turn less does not move."""
LEAST_LEAN = 0.8
"""Degrees: a torso that has less to go stays; twice what it drifts on target."""
LEAST_FACE = 0.04
"""A face that has less to go stays. A share of its joints' ranges."""
SETTLE: Seconds = 0.08
SLIDE: Seconds = 0.2
TYPES: tuple[type[BlockBehavior], ...] = (
    Gaze, GazeShift, HeadDirectionShift, Pointing, Gesture, Head, Face, FaceLexeme, FaceFacs, FaceShift, Posture,
    PostureShift, Pose, Speech, Wait,
)  # fmt: skip
"""Types of behaviors that this body performs."""


def plan(behavior: BlockBehavior, situation: Situation) -> Course:
    """Plan the course of `behavior` in `situation`. Speech and wait move nothing and have none. Raises Impossible."""
    match behavior:
        case Gaze(target=target, offset_angle=offset, offset_direction=direction):
            return _glance(_neck_angles(target, offset, direction, situation), situation)
        case GazeShift(target=target, offset_angle=offset, offset_direction=direction):
            return _shift(("neck_yaw", "neck_pitch"), _neck_angles(target, offset, direction, situation), situation)
        case HeadDirectionShift(target=target):
            return _shift(("neck_yaw", "neck_pitch"), _neck_angles(target, 0.0, "", situation), situation)
        case Pointing(target=target, mode=mode):
            return _point(_entity(target, situation.world), mode, situation)
        case Gesture(lexeme=lexeme, mode=mode):
            return _gesture(lexeme, mode, situation)
        case Head(lexeme=lexeme, repetition=repetition, amount=amount):
            return _nod(lexeme.upper(), repetition, amount)
        case Face(amount=amount):
            return _excursion("face", _face_angles("RAISE_BROWS", amount), situation)
        case FaceLexeme(lexeme=lexeme, amount=amount):
            return _excursion("face", _face_angles(lexeme, amount), situation)
        case FaceFacs(au=unit, amount=amount):
            return _excursion("face", _face_angles(_action_unit(unit), amount), situation)
        case FaceShift(lexeme=lexeme, au=unit, amount=amount):
            return _shift(kinematics.joints_of("face"), _face_angles(lexeme or _action_unit(unit), amount), situation)
        case Posture(lexeme=lexeme):
            return _excursion("torso", _torso_angles(lexeme), situation)
        case PostureShift(lexeme=lexeme) | Pose(lexeme=lexeme):
            return _shift(("torso_turn", "torso_lean"), _torso_angles(lexeme), situation)
        case _:
            raise Impossible("BEHAVIOR_TYPE_NOT_SUPPORTED", f"this body has no {type(behavior).__name__.lower()}")


def look(target: str, situation: Situation) -> tuple[float, float]:
    """Neck angles that look at an entity, as near as the joints come. Raises Impossible if there is none."""
    return _neck_angles(target, 0.0, "", situation)


def turning_time(start: tuple[float, ...], goal: tuple[float, ...]) -> Seconds:
    """Natural duration of a turn of the head: 0.3 s for 30 degrees, 0.5 s for 60, nothing for none."""
    turn = kinematics.degrees_between(start, goal)
    return 0.0 if turn < LEAST_TURN else 0.1 + turn / 150.0


def return_time(start: tuple[float, ...], goal: tuple[float, ...]) -> Seconds:
    """Natural duration of the way home of an arm, the torso or a face."""
    way = kinematics.degrees_between(start, goal)
    return 0.0 if way < 0.01 else 0.3 + max(abs(math.degrees(b - a)) for a, b in zip(start, goal, strict=True)) / 120


def _entity(target: str, world: World) -> Entity:
    if (entity := world.entity(target)) is None:
        raise Impossible("NO_SUCH_TARGET", f"the world has no {target!r}")
    return entity


def _neck_angles(target: str, offset: Degrees, direction: str, situation: Situation) -> tuple[float, float]:
    entity = _entity(target, situation.world)
    try:
        yaw, pitch = kinematics.look_at(entity.position, situation.pose, NOD_RESERVE)
    except Unreachable as error:
        raise Impossible("CANNOT_CREATE_BEHAVIOR", f"cannot look at {target!r}: {error}") from error
    right, up = {
        "": (0, 0), "RIGHT": (1, 0), "LEFT": (-1, 0), "UP": (0, 1), "DOWN": (0, -1), "UPRIGHT": (1, 1),
        "UPLEFT": (-1, 1), "DOWNRIGHT": (1, -1), "DOWNLEFT": (-1, -1),
    }.get(direction.upper(), (0, 0))  # fmt: skip
    return (
        _clamped("neck_yaw", yaw - right * radians(offset), NOD_RESERVE),
        _clamped("neck_pitch", pitch + up * radians(offset), NOD_RESERVE),
    )


def _glance(goal: tuple[float, float], situation: Situation) -> Course:
    joints = ("neck_yaw", "neck_pitch")
    here, base = _angles(joints, situation.pose), _angles(joints, situation.rest)
    out, back = turning_time(here, goal), turning_time(goal, base)
    if out == 0.0:
        goal = (here[0], here[1])
    if back == 0.0:
        base = goal
    drift = (0.0, 0.0)
    if out > 0.0 and back > 0.0:
        yaw, pitch = goal[0] - here[0], goal[1] - here[1]
        drift = (-0.05 * pitch / out, 0.05 * yaw / out)
    settle = SETTLE if any(drift) else 0.0
    before = tuple(angle - speed * settle for angle, speed in zip(goal, drift, strict=True))
    legs = (
        Leg(goal=before, velocity=drift, seconds=out, marks=(*_marks(0.0, *SYNC_POINTS[:3]), ("stroke", 1.0))),
        Leg(goal=goal, velocity=drift, seconds=settle, marks=_marks(1.0, "stroke_end", "relax")),
        Leg(goal=base, seconds=back, marks=_marks(1.0, "end")),
    )
    ray = kinematics.gaze({**situation.pose, **dict(zip(joints, goal, strict=True))})
    return _course(("head",), joints, legs, _held_on_target("stroke"), goal, ray)


def _shift(joints: tuple[str, ...], goal: tuple[float, ...], situation: Situation) -> Course:
    here = _angles(joints, situation.pose)
    part = kinematics.LIMIT[joints[0]].part
    seconds = turning_time(here, goal) if part == "head" else _moving_time(part, here, goal)
    goal = goal if seconds else here
    legs = (Leg(goal=goal, seconds=seconds, marks=(("start", 0.0), ("end", 1.0))),)
    on_target = {**situation.pose, **dict(zip(joints, goal, strict=True))}
    points = (CoursePoint("start"), CoursePoint("end"))
    ray = kinematics.gaze(on_target) if part == "head" else None
    return _course((part,), joints, legs, points, goal, ray)


def _point(entity: Entity, mode: str | None, situation: Situation) -> Course:
    for zone in situation.zones:
        if math.dist(zone.center, entity.position) <= zone.radius:
            raise Impossible("CANNOT_CREATE_BEHAVIOR", f"{entity.id!r} is in a no-point zone")
    sides = _sides(mode, lambda side: math.dist(kinematics.SHOULDER[side], entity.position), situation)
    if mode == "BOTH_HANDS":
        raise Impossible("CANNOT_CREATE_BEHAVIOR", "pointing takes one hand")
    reasons = []
    for side in sides:
        try:
            aim = kinematics.point_at(side, entity.position, entity.radius, situation.pose)
        except Unreachable as error:
            reasons.append(str(error))
            continue
        return _point_with(side, aim, situation)
    raise Impossible("CANNOT_CREATE_BEHAVIOR", f"cannot point at {entity.id!r}: {'; '.join(reasons)}")


def _point_with(side: Side, aim: kinematics.ArmAim, situation: Situation) -> Course:
    joints = kinematics.joints_of(f"{side}_arm")
    here, home = _angles(joints, situation.pose), _angles(joints, situation.rest)
    yaw, pitch, elbow = aim.stroke
    ready = (
        here[0] + 0.7 * (yaw - here[0]),
        pitch + radians(12),
        max(elbow + 0.4 * (here[2] - elbow), elbow + radians(18)),
    )
    slide = tuple((b - a) / SLIDE for a, b in zip(aim.stroke, aim.held, strict=True))
    raising = _arm_time(here, ready, 0.25, 150.0)
    stroke = _arm_time(ready, aim.stroke, 0.4, 120.0)
    back = max(0.4, return_time(aim.held, home))
    through = tuple(
        0.35 * ((b - a) / raising + (c - b) / stroke) for a, b, c in zip(here, ready, aim.stroke, strict=True)
    )
    legs = (
        Leg(goal=ready, velocity=through, seconds=raising, marks=(("start", 0.0), ("ready", 1.0))),
        Leg(goal=aim.stroke, velocity=slide, seconds=stroke, marks=(("stroke_start", 0.1 / stroke), ("stroke", 1.0))),
        Leg(goal=aim.held, velocity=slide, seconds=SLIDE, marks=_marks(1.0, "stroke_end")),
        Leg(goal=home, seconds=back, marks=(("relax", 0.1 / back), ("end", 1.0))),
    )
    ray = kinematics.arm({**situation.pose, **dict(zip(joints, aim.held, strict=True))}, side)
    return _course((f"{side}_arm",), joints, legs, _held_around_stroke(), aim.held, ray)


def _gesture(lexeme: str, mode: str | None, situation: Situation) -> Course:
    poses = GESTURES.get(lexeme.upper())
    if poses is None:
        raise Impossible("CANNOT_CREATE_BEHAVIOR", f"no gesture {lexeme!r}: there are {', '.join(GESTURES)}")
    sides = _sides(mode, lambda side: 0.0 if side == "right" else 1.0, situation)
    sides = sides if mode == "BOTH_HANDS" else sides[:1]
    joints = tuple(joint for side in sides for joint in kinematics.joints_of(f"{side}_arm"))
    inward = {"left": -1, "right": 1}
    ready, stroke, after = (
        tuple(radians(angle) for side in sides for angle in (inward[side] * pose[0], *pose[1:])) for pose in poses
    )
    here, home = _angles(joints, situation.pose), _angles(joints, situation.rest)
    stops = (here, ready, stroke, after, home)
    # The stroke is slow enough to take no longer from rest, after a hold: estimates are right with and without one.
    seconds = (
        _arm_time(here, ready, 0.3, 130), _arm_time(ready, stroke, 0.36, 100), _arm_time(stroke, after, 0.25, 100),
        max(0.4, return_time(after, home)),
    )  # fmt: skip
    velocities = [
        tuple(
            0.4 * ((b - a) / before + (c - b) / behind)
            for a, b, c in zip(stops[i - 1], stops[i], stops[i + 1], strict=True)
        )
        for i, (before, behind) in enumerate(pairwise(seconds), start=1)
    ]
    legs = (
        Leg(goal=ready, velocity=velocities[0], seconds=seconds[0], marks=(("start", 0.0), ("ready", 1.0))),
        Leg(goal=stroke, velocity=velocities[1], seconds=seconds[1],
            marks=(("stroke_start", 0.05 / seconds[1]), ("stroke", 1.0))),
        Leg(goal=after, velocity=velocities[2], seconds=seconds[2], marks=_marks(1.0, "stroke_end")),
        Leg(goal=home, seconds=seconds[3], marks=(("relax", 0.1 / seconds[3]), ("end", 1.0))),
    )  # fmt: skip
    parts = tuple(f"{side}_arm" for side in sides)
    course = _course(parts, joints, legs, _held_around_stroke(), stroke, None)
    return replace(course, is_resizable=True)


def _nod(lexeme: str, repetition: int, amount: float) -> Course:
    """Course of a nod or shake, in offsets on top of the gaze. A narrow ellipse: a line would stop at both ends."""
    if lexeme not in ("NOD", "SHAKE"):
        raise Impossible("CANNOT_CREATE_BEHAVIOR", f"no head gesture {lexeme!r}: there are NOD and SHAKE")
    size, aside, half = radians(4 + 10 * amount), radians(5.0), 0.32

    def turned(along: float, across: float) -> tuple[float, float]:
        return (across, along) if lexeme == "NOD" else (along, across)

    lift = turned(0.15 * size, 0.0)
    low, high = turned(-size, 0.0), turned(0.15 * size if lexeme == "NOD" else size, 0.0)
    legs = [
        Leg(goal=lift, velocity=turned(0.0, aside), seconds=0.2, marks=(("start", 0.0), ("ready", 1.0))),
        Leg(goal=low, velocity=turned(0.0, -aside), seconds=half, marks=(("stroke_start", 0.1), ("stroke", 1.0))),
    ]
    again = half * (1.0 if lexeme == "NOD" else 1.5)
    strokes = [f"stroke:{number}" for number in range(2, repetition + 1)]
    for stroke in strokes:
        legs.append(Leg(goal=high, velocity=turned(0.0, aside), seconds=again))
        legs.append(Leg(goal=low, velocity=turned(0.0, -aside), seconds=again, marks=_marks(1.0, stroke)))
    legs.append(Leg(goal=turned(-0.25 * size, 0.0), velocity=turned(2.0 * size, aside / 2), seconds=0.25,
                    marks=_marks(1.0, "stroke_end")))  # fmt: skip
    legs.append(Leg(goal=(0.0, 0.0), seconds=0.3, marks=(("relax", 0.15), ("end", 1.0))))
    return Course(
        parts=("nod",), joints=("neck_yaw", "neck_pitch"), legs=tuple(legs), points=_held_around_stroke(strokes),
        is_resizable=True,
    )  # fmt: skip


def _excursion(part: str, goal: tuple[float, ...], situation: Situation) -> Course:
    """Course of a face or a posture: out to `goal`, held there, and back."""
    joints = kinematics.joints_of(part)
    joint, size = _sideways(part, dict(zip(joints, goal, strict=True)))
    here, rest = _angles(joints, situation.pose), _angles(joints, situation.rest)
    out, back = _moving_time(part, here, goal), _moving_time(part, goal, rest)
    goal = goal if out else here
    drift = tuple(size / SETTLE if name == joint and out > 0.0 and back > 0.0 else 0.0 for name in joints)
    settle = SETTLE if any(drift) else 0.0
    after = tuple(angle + speed * settle for angle, speed in zip(goal, drift, strict=True))
    legs = (
        Leg(goal=goal, velocity=drift, seconds=out, marks=(("start", 0.0), *_marks(1.0, *SYNC_POINTS[1:4]))),
        Leg(goal=after, velocity=drift, seconds=settle, marks=_marks(1.0, "stroke_end", "relax")),
        Leg(goal=rest, seconds=back, marks=_marks(1.0, "end")),
    )
    return _course((part,), joints, legs, _held_on_target("ready", "stroke_start", "stroke"), goal, None)


def _course(
    parts: tuple[str, ...], joints: tuple[str, ...], legs: tuple[Leg, ...], points: tuple[CoursePoint, ...],
    goal: tuple[float, ...], ray: Ray | None,
) -> Course:  # fmt: skip
    return Course(
        parts=parts, joints=joints, legs=legs, points=points, on_target=dict(zip(joints, goal, strict=True)), ray=ray,
    )  # fmt: skip


def _sideways(part: str, goal: Mapping[str, float]) -> tuple[str, float]:
    """Choose a joint that the motion to `goal` hardly uses and that has room on both sides, and how far it drifts."""
    if part == "torso":
        return ("torso_turn", radians(0.4)) if not goal["torso_turn"] else ("torso_lean", radians(0.4))
    return ("mouth_corners" if not goal["mouth_corners"] else "brows", 0.02)


def _face_angles(lexeme: str, amount: float) -> tuple[float, ...]:
    if (shape := FACES.get(lexeme.upper())) is None:
        raise Impossible("CANNOT_CREATE_BEHAVIOR", f"no face {lexeme!r}: there are {', '.join(FACES)}")
    return tuple(0.95 * amount * shape.get(joint, 0.0) for joint in kinematics.joints_of("face"))


def _action_unit(number: int) -> str:
    if number not in ACTION_UNITS:
        known = ", ".join(map(str, ACTION_UNITS))
        raise Impossible("CANNOT_CREATE_BEHAVIOR", f"no action unit {number}: there are {known}")
    return ACTION_UNITS[number]


def _torso_angles(lexeme: str) -> tuple[float, float]:
    if (angles := POSTURES.get(lexeme.upper())) is None:
        known = ", ".join(filter(None, POSTURES))
        raise Impossible("CANNOT_CREATE_BEHAVIOR", f"no posture {lexeme!r}: there are {known}")
    return (radians(angles[0]), radians(angles[1]))


def _sides(mode: str | None, rank: Callable[[Side], float], situation: Situation) -> list[Side]:
    """Arms to try, best first: the one that `mode` names, or free ones before busy ones."""
    match mode:
        case "LEFT_HAND":
            return ["left"]
        case "RIGHT_HAND":
            return ["right"]
        case _:
            return sorted(("left", "right"), key=lambda side: (f"{side}_arm" in situation.busy, rank(side)))


def _held_on_target(*arrival: str) -> tuple[CoursePoint, ...]:
    """Sync points of a course that can hold while it is on target. arrival: points at which it is first there."""
    before = SYNC_POINTS[: SYNC_POINTS.index("stroke_end")]
    points = [CoursePoint(sync, "stroke", "relax") if sync in arrival else CoursePoint(sync) for sync in before]
    return (*points, CoursePoint("stroke_end", "relax"), CoursePoint("relax", "relax"), CoursePoint("end"))


def _held_around_stroke(strokes: Sequence[str] = ()) -> tuple[CoursePoint, ...]:
    """Sync points of a course that can hold before and after its stroke. strokes: the stroke's repetitions."""
    number = SYNC_POINTS.index("stroke_end")
    syncs = (*SYNC_POINTS[:number], *strokes, *SYNC_POINTS[number:])
    return tuple(CoursePoint(sync, sync if sync in ("stroke_start", "stroke_end") else "") for sync in syncs)


def _marks(fraction: float, *syncs: str) -> tuple[tuple[str, float], ...]:
    return tuple((sync, fraction) for sync in syncs)


def _angles(joints: tuple[str, ...], pose: Mapping[str, float]) -> tuple[float, ...]:
    return tuple(pose[joint] for joint in joints)


def _clamped(joint: str, angle: float, reserve: float) -> float:
    limit = kinematics.LIMIT[joint]
    return min(max(angle, limit.low + reserve), limit.high - reserve)


def _arm_time(start: tuple[float, ...], goal: tuple[float, ...], least: Seconds, speed: Degrees) -> Seconds:
    return max(least, 0.15 + max(abs(math.degrees(b - a)) for a, b in zip(start, goal, strict=True)) / speed)


def _moving_time(part: str, start: tuple[float, ...], goal: tuple[float, ...]) -> Seconds:
    if part == "face":
        way = max(abs(b - a) for a, b in zip(start, goal, strict=True))
        return 0.0 if way < LEAST_FACE else 0.15 + 0.25 * way
    return 0.0 if kinematics.degrees_between(start, goal) < LEAST_LEAN else 2 * return_time(start, goal)

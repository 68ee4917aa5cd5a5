"""Course of each behavior that the repertoire has a path for: gestures, heads, faces and postures."""

import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from math import radians

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import SYNC_POINTS
from engage_hri.schemas.behaviors import (
    Face,
    FaceFacs,
    FaceLexeme,
    FaceShift,
    Hand,
    Head,
    PartPose,
    expressed,
)
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.course import (
    Course,
    Situation,
    angles,
    arm_time,
    course,
    marks,
    moving_time,
    return_time,
)
from engage_hri.services.control.figure.kinematics import Side
from engage_hri.services.control.figure.repertoire import Absent, Found, GesturePath, HeadPath, Table
from engage_hri.services.control.figure.tracks import clear_of_table
from engage_hri.services.control.motion.motion import WalkPoint, held_around_stroke, held_on_target
from engage_hri.services.control.motion.path import Leg

SETTLE: Seconds = 0.08
DRIFT = radians(0.3)
"""Radians by which a head drifts that is held in a direction, so that a motion without a hold never stops."""
NOD_JOINTS = ("neck_yaw", "neck_pitch", "neck_roll")
_ARMS = ("left_arm", "right_arm")
PARTS: Mapping[str, tuple[str, ...]] = {
    "ARMS": _ARMS, "LEFT_ARM": ("left_arm",), "RIGHT_ARM": ("right_arm",), "HEAD": (), "LEGS": (), "LEFT_LEG": (),
    "RIGHT_LEG": (), "WHOLEBODY": ("torso", *_ARMS),
}  # fmt: skip
"""Parts of this body, by the standard's names of parts. Other names are those of the author, and mean any."""


def gesture(lexeme: str, mode: Hand | None, situation: Situation) -> Course:
    found = _found("gesture", lexeme, situation)
    path: GesturePath = found.path
    mode = mode or path.hands
    both = sides(mode, lambda side: 0.0 if side == "right" else 1.0, situation)
    both = both if mode == "BOTH_HANDS" else both[:1]
    joints = tuple(joint for side in both for joint in kinematics.joints_of(f"{side}_arm"))
    here, home = angles(joints, situation.pose), angles(joints, situation.rest)
    ready, stroke, after = clear_of_table(
        joints,
        [
            tuple(angle for side in both for angle in pose.joints(side).values())
            for pose in (path.ready, path.stroke, path.stroke_end)
        ],
        home,
        situation.trunks,
    )
    stops = (here, ready, stroke, after, home)
    # The stroke is slow enough to take no longer from rest, after a hold: estimates are right with and without one.
    seconds = (
        arm_time(here, ready, 0.3, 130), arm_time(ready, stroke, 0.36, 100), arm_time(stroke, after, 0.25, 100),
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
        Leg(goal=after, velocity=velocities[2], seconds=seconds[2], marks=marks(1.0, "stroke_end")),
        Leg(goal=home, seconds=seconds[3], marks=(("relax", 0.1 / seconds[3]), ("end", 1.0))),
    )  # fmt: skip
    parts = tuple(f"{side}_arm" for side in both)
    made = course(parts, joints, legs, held_around_stroke(), stroke, note=found.note)
    return replace(made, is_resizable=True)


def head(behavior: Head, situation: Situation) -> Course:
    """Course of a movement of the head, in offsets on top of the gaze."""
    found = _found("head", behavior.lexeme, situation)
    path: HeadPath = found.path
    least, most = path.degrees
    size = radians(least + (most - least) * behavior.amount)
    way = (path.to.left, path.to.up, path.to.tilt)
    legs, strokes = (
        (_direction(way, size), []) if path.hold else _swing(way, size, behavior.repetition, path.back, path.again)
    )
    return Course(
        parts=("nod",), joints=NOD_JOINTS, legs=legs, points=held_around_stroke(tuple(strokes)), note=found.note,
        is_resizable=True,
    )  # fmt: skip


def _swing(
    way: Sequence[float], size: float, repetition: int, back: float, again: float
) -> tuple[tuple[Leg, ...], list[str]]:
    """Legs of a nod or a shake, with its later strokes. A narrow ellipse: a line would stop at both ends."""
    aside, half = radians(5.0), 0.32
    across = (1.0, 0.0, 0.0) if abs(way[1]) > abs(way[0]) else (0.0, 1.0, 0.0)

    def at(along: float, sideways: float) -> tuple[float, ...]:
        return tuple(along * share + sideways * other for share, other in zip(way, across, strict=True))

    far, near = at(size, 0.0), at(-back * size, 0.0)
    legs = [
        Leg(goal=at(-0.15 * size, 0.0), velocity=at(0.0, aside), seconds=0.2, marks=(("start", 0.0), ("ready", 1.0))),
        Leg(goal=far, velocity=at(0.0, -aside), seconds=half, marks=(("stroke_start", 0.1), ("stroke", 1.0))),
    ]
    strokes = [f"stroke:{number}" for number in range(2, repetition + 1)]
    for stroke in strokes:
        legs.append(Leg(goal=near, velocity=at(0.0, aside), seconds=half * again))
        legs.append(Leg(goal=far, velocity=at(0.0, -aside), seconds=half * again, marks=marks(1.0, stroke)))
    legs.append(Leg(goal=at(0.25 * size, 0.0), velocity=at(-2.0 * size, aside / 2), seconds=0.25,
                    marks=marks(1.0, "stroke_end")))  # fmt: skip
    legs.append(Leg(goal=at(0.0, 0.0), seconds=0.3, marks=(("relax", 0.15), ("end", 1.0))))
    return tuple(legs), strokes


def _direction(way: Sequence[float], size: float) -> tuple[Leg, ...]:
    """Legs of a head that turns or tilts, is held there around its stroke, and comes back."""
    goal, home = tuple(size * share for share in way), (0.0, 0.0, 0.0)
    seconds = 0.15 + math.degrees(max(map(abs, goal))) / 60 if any(goal) else 0.0
    settle = SETTLE if seconds else 0.0
    drift: tuple[float, ...] = (0.0, 0.0, 0.0)
    if seconds:
        axis = next(axis for axis in (0, 1, 2) if not goal[axis]) if not all(goal) else 0
        drift = tuple(DRIFT / SETTLE if number == axis else 0.0 for number in (0, 1, 2))
    on, after = (tuple(angle + speed * settle * n for angle, speed in zip(goal, drift, strict=True)) for n in (1, 2))
    return (
        Leg(goal=goal, velocity=drift, seconds=seconds, marks=(("start", 0.0), ("ready", 1.0))),
        Leg(goal=on, velocity=drift, seconds=settle, marks=(("stroke_start", 0.25), ("stroke", 1.0))),
        Leg(goal=after, velocity=drift, seconds=settle, marks=marks(1.0, "stroke_end")),
        Leg(goal=home, seconds=seconds, marks=(("relax", 0.15), ("end", 1.0))),
    )


def face(behavior: Face | FaceLexeme | FaceFacs | FaceShift, situation: Situation) -> tuple[dict[str, float], str]:
    """Angles of the joints of a face, added up from its expressions, and the notes about them. Raises Impossible."""
    expressions = expressed(behavior)
    sums = dict.fromkeys(kinematics.joints_of("face"), 0.0)
    notes, absences = [], []
    for each in expressions:
        try:
            found = _found("face", each.lexeme, situation) if each.lexeme else _unit(each.au, situation)
        except Impossible as absence:
            absences.append(absence)
            continue
        notes.append(found.note)
        share = 0.95 * (behavior.amount if each.amount is None else each.amount)
        for joint, way in situation.repertoire.face(found.path, each.side).items():
            sums[joint] += share * way
    if isinstance(behavior, Face) and behavior.overshoot:
        notes.append(f"this body has no overshoot {behavior.overshoot:g} of a face; it goes to its amount")
    note = _note(notes, absences, len(expressions))
    limits = kinematics.LIMIT
    return {joint: min(max(sums[joint], 0.95 * limits[joint].low), 0.95) for joint in sums}, note


def posture(stance: str, poses: Sequence[PartPose], situation: Situation) -> tuple[dict[str, dict[str, float]], str]:
    """Angles of the joints of a posture by part, and the notes about them. Raises Impossible."""
    found: dict[str, dict[str, float]] = {}
    notes, absences = [], []
    asked: list[tuple[Table, str, str]] = [("stance", stance, "")] if stance else []
    asked += [("pose", pose.lexeme, pose.part) for pose in poses if pose.lexeme]
    for table, lexeme, part in asked:
        try:
            path = _found(table, lexeme, situation)
        except Impossible as absence:
            absences.append(absence)
            continue
        notes.append(path.note)
        joints = path.path.joints()
        parts = PARTS.get(part.upper(), tuple(joints))
        if not set(parts) & joints.keys():
            parts = tuple(joints)
            notes.append(f"this body has no {lexeme!r} of its {part!r}; it moves its {_listed(parts)!r}, the nearest")
        found |= {name: joints[name] for name in joints if name in parts}
    note = _note(notes, absences, len(asked))
    return found or {"torso": {"torso_turn": 0.0, "torso_lean": 0.0}}, note


def excursion(goals: Mapping[str, Mapping[str, float]], situation: Situation, note: str = "") -> Course:
    """Course of a face or a posture: out to `goals`, by part and joint, held there, and back."""
    joints, goal = _aim(goals)
    joint, size = _sideways(dict(zip(joints, goal, strict=True)))
    here, rest = angles(joints, situation.pose), angles(joints, situation.rest)
    out, back = moving_time(joints, here, goal), moving_time(joints, goal, rest)
    goal = goal if out else here
    drift = tuple(size / SETTLE if name == joint and out > 0.0 and back > 0.0 else 0.0 for name in joints)
    settle = SETTLE if any(drift) else 0.0
    after = tuple(angle + speed * settle for angle, speed in zip(goal, drift, strict=True))
    legs = (
        Leg(goal=goal, velocity=drift, seconds=out, marks=(("start", 0.0), *marks(1.0, *SYNC_POINTS[1:4]))),
        Leg(goal=after, velocity=drift, seconds=settle, marks=marks(1.0, "stroke_end", "relax")),
        Leg(goal=rest, seconds=back, marks=marks(1.0, "end")),
    )
    points = held_on_target("ready", "stroke_start", "stroke")
    return course(tuple(goals), joints, legs, points, goal, note=note)


def shift(goals: Mapping[str, Mapping[str, float]], situation: Situation, note: str = "") -> Course:
    """Course of a face or a posture that stays."""
    joints, goal = _aim(goals)
    here = angles(joints, situation.pose)
    seconds = moving_time(joints, here, goal)
    goal = goal if seconds else here
    legs = (Leg(goal=goal, seconds=seconds, marks=(("start", 0.0), ("end", 1.0))),)
    points = (WalkPoint("start"), WalkPoint("end"))
    return course(tuple(goals), joints, legs, points, goal, note=note)


def sides(mode: str | None, rank: Callable[[Side], float], situation: Situation) -> list[Side]:
    """Arms to try, best first: the one that `mode` names, or free ones before busy ones."""
    match mode:
        case "LEFT_HAND":
            return ["left"]
        case "RIGHT_HAND":
            return ["right"]
        case _:
            return sorted(("left", "right"), key=lambda side: (f"{side}_arm" in situation.busy, rank(side)))


def _found(table: Table, lexeme: str, situation: Situation) -> Found:
    try:
        return situation.repertoire.find(table, lexeme)
    except Absent as absent:
        raise Impossible("CANNOT_CREATE_BEHAVIOR", str(absent)) from absent


def _unit(number: int, situation: Situation) -> Found:
    return _found("facs", str(number), situation)


def _note(notes: Sequence[str], absences: Sequence[Impossible], asked: int) -> str:
    """Join the notes, with what has to be left out. Raises Impossible if that is all."""
    if absences and len(absences) == asked:
        raise absences[0]
    rest = [*(absence.reason for absence in absences), "the rest is performed"] if absences else []
    return "; ".join(filter(None, [*notes, *rest]))


def _listed(parts: Sequence[str]) -> str:
    return ", ".join(parts).upper()


def _aim(goals: Mapping[str, Mapping[str, float]]) -> tuple[tuple[str, ...], tuple[float, ...]]:
    aim = {joint: angle for part in goals.values() for joint, angle in part.items()}
    return tuple(aim), tuple(aim.values())


def _sideways(goal: Mapping[str, float]) -> tuple[str, float]:
    """Choose a joint that the motion to `goal` hardly uses and that has room on both sides, and how far it drifts."""
    candidates = [
        joint for joint in ("left_mouth_corner", "right_mouth_corner", "left_brow", "right_brow", "brow_slant")
        if joint in goal
    ]  # fmt: skip
    if candidates:
        return next((joint for joint in candidates if not goal[joint]), candidates[-1]), 0.02
    if "torso_turn" in goal:
        return ("torso_turn" if not goal["torso_turn"] else "torso_lean"), radians(0.4)
    return next(iter(goal)), radians(0.4)

"""Course of each behavior on the simulated torso: legs of a path, sync points on them, and where it may hold.

Motion out and back never retraces itself: at the stroke the joints drift sideways, so that their speed
passes through no zero and a gesture that is not held is one fluid motion.
"""

import math
from collections.abc import Mapping
from math import radians
from typing import TypeGuard

from msgspec.structs import replace

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.behavior_types import SYNC_POINTS
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
    Looks,
    Pointing,
    Pose,
    Posture,
    PostureShift,
    Speech,
    Wait,
    posed,
)
from engage_hri.schemas.units import Degrees, Seconds
from engage_hri.schemas.vocabulary import normal
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import expressions, kinematics
from engage_hri.services.control.figure.course import (
    TRUNK,
    Aim,
    Course,
    Situation,
    angles,
    arm_time,
    course,
    marks,
    moving_time,
    return_time,
    turning_time,
)
from engage_hri.services.control.figure.expressions import SETTLE, sides
from engage_hri.services.control.figure.kinematics import Side, Unreachable
from engage_hri.services.control.motion.motion import WalkPoint, held_around_stroke, held_on_target
from engage_hri.services.control.motion.path import Leg

SLIDE: Seconds = 0.2
OFFSETS: Mapping[str, tuple[int, int]] = {
    "": (0, 0), "RIGHT": (1, 0), "LEFT": (-1, 0), "UP": (0, 1), "DOWN": (0, -1), "UPRIGHT": (1, 1),
    "UPLEFT": (-1, 1), "DOWNRIGHT": (1, -1), "DOWNLEFT": (-1, -1),
}  # fmt: skip
"""Directions of a gaze's offset: shares of its angle to the right and up."""
SETTLING = (FaceShift, PostureShift, Pose)
"""Shifts of what a face or a posture goes back to."""
TYPES: tuple[type[BlockBehavior], ...] = (
    Gaze, GazeShift, HeadDirectionShift, Pointing, Gesture, Head, Face, FaceLexeme, FaceFacs, FaceShift, Posture,
    PostureShift, Pose, Speech, Wait,
)  # fmt: skip
"""Types of behaviors that this body performs."""

Looked = tuple[Aim, tuple[float, ...]]
"""The place of a look, and the angles of the neck on it."""


def plan(behavior: BlockBehavior, situation: Situation) -> Course:
    """Plan the course of `behavior` in `situation`. Speech and wait move nothing and have none. Raises Impossible."""
    made = _planned(behavior, situation)
    is_of_arms = made.parts[0].endswith("_arm")
    return replace(made, trunks=situation.trunks) if is_of_arms and situation.trunks != made.trunks else made


def _planned(behavior: BlockBehavior, situation: Situation) -> Course:
    match behavior:
        case Gaze():
            return replace(_glance(_gaze_aim(behavior, situation), situation), note=note_on(behavior))
        case GazeShift():
            turns = turns_trunk(behavior)
            made = _turn(behavior, situation) if turns else _shift(_gaze_aim(behavior, situation), situation)
            return replace(made, note=note_on(behavior))
        case HeadDirectionShift(target=target):
            return _shift(_neck_aim(target, 0.0, "", situation), situation)
        case Pointing(target=target, mode=mode):
            return _point(entity_of(target, situation.world), mode, situation)
        case Gesture(lexeme=lexeme, mode=mode):
            return expressions.gesture(lexeme, mode, situation)
        case Head():
            return expressions.head(behavior, situation)
        case Face() | FaceLexeme() | FaceFacs():
            face, note = expressions.face(behavior, situation)
            return expressions.excursion({"face": face}, situation, note)
        case FaceShift():
            face, note = expressions.face(behavior, situation)
            return expressions.shift({"face": face}, situation, note)
        case Posture(stance=stance):
            goals, note = expressions.posture(stance, posed(behavior), situation)
            return expressions.excursion(goals, situation, note)
        case PostureShift(stance=stance):
            goals, note = expressions.posture(stance, posed(behavior), situation)
            return expressions.shift(goals, situation, note)
        case Pose():
            goals, note = expressions.posture("", posed(behavior), situation)
            return expressions.shift(goals, situation, note)
        case _:
            raise Impossible("BEHAVIOR_TYPE_NOT_SUPPORTED", f"this body has no {type(behavior).__name__.lower()}")


def entity_of(target: str, world: World) -> Entity:
    """Look up the entity that a target names. Raises Impossible."""
    if (entity := world.entity(target)) is None:
        advice = suggestion(target, (each.id for each in world.entities), "it is empty")
        raise Impossible("NO_SUCH_TARGET", f"the world has no {target!r}", advice)
    return entity


def _neck_aim(target: str, offset: Degrees, direction: str, situation: Situation) -> Looked:
    entity = entity_of(target, situation.world)
    try:
        free = kinematics.look_at(entity.position, situation.pose, kinematics.NOD_RESERVE)
    except Unreachable as error:
        raise Impossible("CANNOT_CREATE_BEHAVIOR", f"cannot look at {target!r}: {error}") from error
    right, up = OFFSETS.get(normal(direction), (0, 0))
    beside, trunk = (-right * radians(offset), up * radians(offset)), angles(TRUNK, situation.pose)
    aim = Aim(target=entity.position, trunk=trunk, beside=beside, reserve=kinematics.NOD_RESERVE)
    return aim, aim.nearest(free)


def _glance(looked: Looked, situation: Situation) -> Course:
    aim, goal = looked
    joints, here = aim.joints, situation.start(aim)
    base = angles(joints, situation.rest)
    out, back = turning_time(here, goal), turning_time(goal, base)
    if out == 0.0:
        goal = here
    if back == 0.0:
        base = goal
    drift = (0.0, 0.0)
    if out > 0.0 and back > 0.0:
        yaw, pitch = goal[0] - here[0], goal[1] - here[1]
        drift = (-0.05 * pitch / out, 0.05 * yaw / out)
    settle = SETTLE if any(drift) else 0.0
    before = tuple(angle - speed * settle for angle, speed in zip(goal, drift, strict=True))
    legs = (
        Leg(goal=before, velocity=drift, seconds=out, marks=(*marks(0.0, *SYNC_POINTS[:3]), ("stroke", 1.0))),
        Leg(goal=goal, velocity=drift, seconds=settle, marks=marks(1.0, "stroke_end", "relax")),
        Leg(goal=base, seconds=back, marks=marks(1.0, "end")),
    )
    ray = kinematics.gaze({**situation.pose, **dict(zip(joints, goal, strict=True))})
    return course(("head",), joints, legs, held_on_target("stroke"), goal, ray, aim=aim)


def _shift(looked: Looked, situation: Situation) -> Course:
    aim, goal = looked
    joints, here = aim.joints, situation.start(aim)
    seconds = turning_time(here, goal)
    goal = goal if seconds else here
    legs = (Leg(goal=goal, seconds=seconds, marks=(("start", 0.0), ("end", 1.0))),)
    ray = kinematics.gaze({**situation.pose, **dict(zip(joints, goal, strict=True))})
    return course(("head",), joints, legs, (WalkPoint("start"), WalkPoint("end")), goal, ray, aim=aim)


def _turn(behavior: GazeShift, situation: Situation) -> Course:
    """Course of a shift with the trunk: the eyes arrive as soon as without it, and stay while it turns."""
    towards = kinematics.turn_towards(entity_of(behavior.target, situation.world).position)
    before = situation.trunk or angles(TRUNK, situation.pose)
    trunk: tuple[float, ...] = (towards, situation.rest["torso_lean"])
    carried = replace(situation, pose={**situation.pose, **dict(zip(TRUNK, trunk, strict=True))}, trunk=before)
    aim, goal = _gaze_aim(behavior, carried)
    joints, here = (*aim.joints, *TRUNK), carried.start(aim)
    turning, looking = moving_time(TRUNK, before, trunk), turning_time(here, goal)
    goal, trunk = goal if looking else here, trunk if turning else before
    seconds = max(turning, looking)
    share = looking / seconds if seconds else 1.0
    # The trunk speeds up and slows down once, wherever on its way the eyes arrive.
    way, speed = share**2 * (3.0 - 2.0 * share), 6.0 * share * (1.0 - share) / (seconds or 1.0)
    under_way = tuple(a + way * (b - a) for a, b in zip(before, trunk, strict=True))
    velocity = tuple(speed * (b - a) for a, b in zip(before, trunk, strict=True))
    legs = (
        Leg(goal=goal + under_way, velocity=(0.0, 0.0, *velocity), seconds=looking, marks=(("start", 0.0),)),
        Leg(goal=goal + trunk, seconds=seconds - looking, marks=(("end", 1.0),)),
    )
    ray = kinematics.gaze({**carried.pose, **dict(zip(aim.joints, goal, strict=True))})
    points = (WalkPoint("start"), WalkPoint("end"))
    return course(("head", "torso"), joints, legs, points, goal + trunk, ray, aim=aim)


def turns_trunk(behavior: BlockBehavior) -> TypeGuard[GazeShift]:
    """True for a shift of the head that turns the trunk."""
    return isinstance(behavior, GazeShift) and behavior.influence.upper() == "WAIST"


def with_head(behavior: BlockBehavior) -> BlockBehavior:
    """The same behavior with the head alone, for once the trunk has turned."""
    return replace(behavior, influence="") if isinstance(behavior, GazeShift) else behavior


def _gaze_aim(behavior: Gaze | GazeShift, situation: Situation) -> Looked:
    return _neck_aim(behavior.target, behavior.offset_angle, behavior.offset_direction, situation)


def note_on(look: Looks) -> str:
    """Note what a neck on a trunk that turns does otherwise than a look asks."""
    if isinstance(look, HeadDirectionShift):
        return ""
    notes = []
    if look.influence.upper() not in ("", "HEAD") and not turns_trunk(look):
        notes.append(f"this body has no influence {look.influence!r} of a gaze; it turns the 'HEAD', the nearest")
    if look.offset_angle and normal(look.offset_direction) not in OFFSETS:
        asked = f"offsetDirection {look.offset_direction!r}"
        notes.append(f"this body has no {asked} of a gaze; it looks at {look.target!r} itself, the nearest")
    return "; ".join(notes)


def _point(entity: Entity, mode: str | None, situation: Situation) -> Course:
    for zone in situation.zones:
        if math.dist(zone.center, entity.position) <= zone.radius:
            raise Impossible("CANNOT_CREATE_BEHAVIOR", f"{entity.id!r} is in a no-point zone")
    arms = sides(mode, lambda side: math.dist(kinematics.SHOULDER[side], entity.position), situation)
    reasons = []
    for side in arms:
        try:
            aim = kinematics.point_at(side, entity.position, entity.radius, situation.pose, situation.trunks)
        except Unreachable as error:
            reasons.append(str(error))
            continue
        hand = f"{side.upper()}_HAND"
        note = f"this body does not point with {mode!r}; it points with its {hand!r}, the nearest"
        return replace(_point_with(entity, side, aim, situation), note=note if mode == "BOTH_HANDS" else "")
    raise Impossible("CANNOT_CREATE_BEHAVIOR", f"cannot point at {entity.id!r}: {'; '.join(reasons)}")


def _point_with(entity: Entity, side: Side, aim: kinematics.ArmAim, situation: Situation) -> Course:
    trunk, pitch = angles(TRUNK, situation.pose), (aim.stroke[1] + aim.held[1]) / 2
    on = Aim(target=entity.position, trunk=trunk, side=side, pitch=pitch)
    joints, here = on.joints, situation.start(on)
    home = angles(joints, situation.rest)
    yaw, lift, elbow = aim.stroke
    ready = (
        here[0] + 0.7 * (yaw - here[0]),
        lift + radians(12),
        max(elbow + 0.4 * (here[2] - elbow), elbow + radians(18)),
    )
    slide = tuple((b - a) / SLIDE for a, b in zip(aim.stroke, aim.held, strict=True))
    raising = arm_time(here, ready, 0.25, 150.0)
    stroke = arm_time(ready, aim.stroke, 0.4, 120.0)
    through = tuple(
        0.35 * ((b - a) / raising + (c - b) / stroke) for a, b, c in zip(here, ready, aim.stroke, strict=True)
    )
    legs = (
        Leg(goal=ready, velocity=through, seconds=raising, marks=(("start", 0.0), ("ready", 1.0))),
        Leg(goal=aim.stroke, velocity=slide, seconds=stroke, marks=(("stroke_start", 0.1 / stroke), ("stroke", 1.0))),
        Leg(goal=aim.held, velocity=slide, seconds=SLIDE, marks=marks(1.0, "stroke_end")),
        lowering(aim.held, home),
    )
    ray = kinematics.arm({**situation.pose, **dict(zip(joints, aim.held, strict=True))}, side)
    return course((f"{side}_arm",), joints, legs, held_around_stroke(), aim.held, ray, aim=on)


def lowering(here: tuple[float, ...], home: tuple[float, ...]) -> Leg:
    """Leg of an arm from a target back to where it belongs."""
    seconds = max(0.4, return_time(here, home))
    return Leg(goal=home, seconds=seconds, marks=(("relax", 0.1 / seconds), ("end", 1.0)))


def eye_target(behavior: BlockBehavior | None) -> str:
    """Id of the entity on the gaze axis once the motion is done; empty: none, as with an offset."""
    if isinstance(behavior, Gaze | GazeShift) and behavior.offset_angle and behavior.offset_direction:
        return ""
    return behavior.target if isinstance(behavior, Looks) else ""

"""Course of each behavior on Reachy Mini: the track that it takes, its way, and its sync points. Pure.

Nods, faces and postures are those of the simulated torso's repertoire, in the size of this robot. It has no face, so
what a face would do its antennas do.
"""

import math
from collections.abc import Mapping, Sequence
from math import radians

from msgspec import Struct

from engage_hri.schemas.behaviors import (
    BlockBehavior,
    Face,
    FaceFacs,
    FaceLexeme,
    FaceShift,
    Gaze,
    GazeShift,
    Head,
    HeadDirectionShift,
    Pose,
    Posture,
    PostureShift,
    posed,
)
from engage_hri.schemas.references import type_name
from engage_hri.schemas.suggestion import suggestion
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.vocabulary import normal
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import expressions
from engage_hri.services.control.figure.choreography import OFFSETS
from engage_hri.services.control.figure.course import Course, Situation
from engage_hri.services.control.figure.repertoire import BUILT_IN, Repertoire
from engage_hri.services.control.motion.path import Leg
from engage_hri.services.control.motion.points import WalkPoint, held_on_target
from engage_hri.services.control.reachy_mini import geometry, joints
from engage_hri.services.control.reachy_mini.geometry import Angles, Mounting

Looks = Gaze | GazeShift | HeadDirectionShift
TYPES_OF_BEHAVIORS: tuple[type[BlockBehavior], ...] = (
    Gaze, GazeShift, HeadDirectionShift, Head, Face, FaceLexeme, FaceFacs, FaceShift, Posture, PostureShift, Pose,
)  # fmt: skip
"""Types of behaviors that move it."""
LEAST = {"head": radians(0.3), "nod": 0.0, "torso": radians(0.4), "face": radians(1.5)}
"""A track that has less to go stays."""
ANTENNAS: Mapping[str, tuple[float, float]] = {
    "brow": (-10.0, 45.0), "lid": (-8.0, 70.0), "mouth_corner": (18.0, 60.0), "lips": (-6.0, -6.0),
    "jaw": (-4.0, -4.0),
}  # fmt: skip
"""Degrees outwards that an antenna turns for what a face would do: by the full way up or open, and down or closed."""
DROOP, RAISED = 130.0, -15.0
"""Degrees outwards from straight up between which an antenna shows a face."""


def points(behavior: BlockBehavior) -> tuple[WalkPoint, ...]:
    """Sync points of a behavior that goes to a goal."""
    match behavior:
        case Gaze():
            return held_on_target("stroke")
        case Face() | FaceLexeme() | FaceFacs() | Posture():
            return held_on_target("ready", "stroke_start", "stroke")
        case _:
            return (WalkPoint("start"), WalkPoint("end"))


class Circumstances(Struct, frozen=True):
    """Circumstances that a behavior begins from. tracks: their angles. base: angles that each goes home to."""

    tracks: Mapping[str, tuple[float, ...]]
    base: Mapping[str, tuple[float, ...]]
    world: World
    mounting: Mounting
    repertoire: Repertoire = BUILT_IN


def course(behavior: BlockBehavior, now: Circumstances) -> Course:
    """Work out a behavior. Raises Impossible."""
    match behavior:
        case Gaze() | GazeShift() | HeadDirectionShift():
            return _look(behavior, now)
        case Head():
            return _nod(behavior, now)
        case Face() | FaceLexeme() | FaceFacs() | FaceShift():
            joints_of_face, note = expressions.face(behavior, _situation(now))
            return _out(behavior, "face", antennas(joints_of_face), now, note=note)
        case Posture() | PostureShift() | Pose():
            return _posture(behavior, now)
        case _:
            raise Impossible("BEHAVIOR_TYPE_NOT_SUPPORTED", f"this body has no {type_name(behavior)}")


def look_at(behavior: Looks, tracks: Mapping[str, tuple[float, ...]], now: Circumstances) -> tuple[Radians, Radians]:
    """Yaw and pitch of the head on the target of a behavior. Raises Impossible: there is no such entity."""
    if (entity := now.world.entity(behavior.target)) is None:
        advice = suggestion(behavior.target, (each.id for each in now.world.entities), "it is empty")
        raise Impossible("NO_SUCH_TARGET", f"the world has no {behavior.target!r}", advice)
    yaw, pitch = geometry.aim(entity.position, joints.summed(tracks), now.mounting)
    if isinstance(behavior, Gaze | GazeShift) and behavior.offset_angle:
        right, up = OFFSETS.get(normal(behavior.offset_direction), (0, 0))
        size = radians(behavior.offset_angle) / (math.hypot(right, up) or 1.0)
        yaw, pitch = yaw - right * size, pitch + up * size
    return yaw, pitch


def seconds(track: str, here: Sequence[float], goal: Sequence[float]) -> Seconds:
    """Natural time of a way; 0: it is none."""
    way = max(abs(b - a) for a, b in zip(here, goal, strict=True))
    if way < LEAST[track] + 1e-9:
        return 0.0
    match track:
        case "head":
            return 0.12 + math.degrees(way) / 110.0
        case "face":
            return 0.25 + math.degrees(way) / 300.0
        case _:
            return 0.3 + math.degrees(way) / 60.0


def antennas(face: Angles) -> tuple[float, float]:
    """Angles of the right and left antenna that stand for a face: raised in surprise, apart in joy, hanging in grief.

    face: shares of the way of the joints of the simulated torso's face, -1 to 1; a lid is 1 when it is shut.
    """
    outwards = []
    for side in ("right", "left"):
        angle = math.degrees(joints.UPRIGHT)
        for joint, share in face.items():
            kind = joint.removeprefix("left_").removeprefix("right_")
            if kind not in ANTENNAS or (kind != joint and not joint.startswith(side)):
                continue
            up, down = ANTENNAS[kind]
            share = -share if kind == "lid" else share  # shut is down
            angle += up * share if share > 0.0 else -down * share
        outwards.append(radians(max(RAISED, min(DROOP, angle))))
    return (-outwards[0], outwards[1])


def _situation(now: Circumstances) -> Situation:
    return Situation({}, {}, now.world, repertoire=now.repertoire)


def _out(
    behavior: BlockBehavior, track: str, goal: tuple[float, ...], now: Circumstances, *, note: str = ""
) -> Course:
    """The way to a goal, at which it may be held, and from which it goes home, or stays."""
    own = points(behavior)
    stays = len(own) == 2
    here = now.tracks[track]
    time = seconds(track, here, goal)
    goal = goal if time else here
    way = own if stays else own[:-1]
    marks = tuple((each.sync, 1.0 if each.held_with or each.sync == "end" else 0.0) for each in way)
    return _course(track, (Leg(goal=goal, seconds=time, marks=marks),), goal, own, note)


def _course(
    track: str, legs: tuple[Leg, ...], goal: tuple[float, ...], own: tuple[WalkPoint, ...], note: str
) -> Course:
    names = tuple(limit.joint for limit in joints.TRACKS[track])
    return Course(
        parts=(track,), joints=names, legs=legs, points=own, on_target=dict(zip(names, goal, strict=True)), note=note
    )


def _look(behavior: Looks, now: Circumstances) -> Course:
    yaw, pitch = look_at(behavior, now.tracks, now)
    turn = now.tracks["torso"][0]
    goal = (yaw, pitch, joints.follow(yaw, turn))
    for limit, angle in zip(joints.TRACKS["head"], goal, strict=True):
        if not limit.low <= angle <= limit.high:
            low, high = math.degrees(limit.low), math.degrees(limit.high)
            wanted = f"{limit.joint} would be at {math.degrees(angle):.0f} degrees"
            reason = f"cannot look at {behavior.target!r}: {wanted}; it goes from {low:.0f} to {high:.0f}"
            advice = "is control.drivers.reachy_mini.position where the robot stands?"
            raise Impossible("CANNOT_CREATE_BEHAVIOR", reason, advice)
    return _out(behavior, "head", goal, now, note=_looked_note(behavior))


def _looked_note(behavior: Looks) -> str:
    """Note what this head does otherwise than a gaze asks."""
    if isinstance(behavior, HeadDirectionShift):
        return ""
    notes = []
    if behavior.influence.upper() not in ("", "HEAD"):
        notes.append(f"this body has no influence {behavior.influence!r} of a gaze; it turns the 'HEAD', the nearest")
    if behavior.offset_angle and normal(behavior.offset_direction) not in OFFSETS:
        asked = f"offsetDirection {behavior.offset_direction!r}"
        notes.append(f"this body has no {asked} of a gaze; it looks at {behavior.target!r} itself, the nearest")
    return "; ".join(notes)


def _nod(behavior: Head, now: Circumstances) -> Course:
    made = expressions.head(behavior, _situation(now))
    size = joints.NOD_SIZE
    legs = tuple(
        Leg(
            goal=tuple(size * angle for angle in leg.goal), velocity=tuple(size * speed for speed in leg.velocity),
            seconds=leg.seconds, marks=leg.marks,
        )
        for leg in made.legs
    )  # fmt: skip
    goal = next(leg.goal for leg in legs if any(sync == "stroke" for sync, _ in leg.marks))
    return _course("nod", legs, goal, made.points, made.note)


def _posture(behavior: Posture | PostureShift | Pose, now: Circumstances) -> Course:
    stance = "" if isinstance(behavior, Pose) else behavior.stance
    parts, note = expressions.posture(stance, posed(behavior), _situation(now))
    if "torso" not in parts:
        raise Impossible("CANNOT_CREATE_BEHAVIOR", "this body has no arms")
    notes = [note] if note else []
    if len(parts) > 1:
        notes.append("this body has no arms; it moves the 'TORSO', the nearest")
    turn, lean = parts["torso"]["torso_turn"], parts["torso"]["torso_lean"]
    goal = []
    for limit, angle in zip(joints.TRACKS["torso"], (turn, lean * joints.LEAN_SIZE), strict=True):
        goal.append(max(limit.low, min(limit.high, angle)))
    return _out(behavior, "torso", tuple(goal), now, note="; ".join(notes))

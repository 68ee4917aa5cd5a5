"""Course of each behavior on Reachy Mini: its track, its way to its goal, how long that takes, its sync points. Pure.

Nods, faces and postures are those of the simulated torso, in the size of this robot. It has no face, so what a face
would do its antennas do.
"""

import math
from collections.abc import Mapping, Sequence
from math import radians

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Gesture, Looks, Pointing, Speech
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.vocabulary import normal
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import choreography, kinematics
from engage_hri.services.control.figure.course import Course, Situation
from engage_hri.services.control.figure.kinematics import Mounting
from engage_hri.services.control.motion.motion import WalkPoint, held_on_target
from engage_hri.services.control.motion.path import Leg
from engage_hri.services.control.reachy_mini import joints
from engage_hri.services.control.reachy_mini.joints import Angles

TYPES = tuple(each for each in choreography.TYPES if each not in (Pointing, Gesture, Speech))
"""Types of behaviors that it performs."""
LEAST = {"head": radians(0.3), "nod": 0.0, "torso": radians(0.4), "face": radians(1.5)}
"""A track that has less to go stays."""
PACES = {"head": (0.12, 110.0), "nod": (0.3, 60.0), "torso": (0.3, 60.0), "face": (0.25, 300.0)}
"""Seconds that a way of each track takes at least, and degrees a second; the antennas are the face."""
ANTENNAS: Mapping[str, tuple[float, float]] = {
    "brow": (-10.0, 45.0), "lid": (-8.0, 70.0), "mouth_corner": (18.0, 60.0), "lips": (-6.0, -6.0),
    "jaw": (-4.0, -4.0),
}  # fmt: skip
"""Degrees outwards that an antenna turns for what a face would do: by the full way up or open, and down or closed."""
DROOP, RAISED = 130.0, -15.0
"""Degrees outwards from straight up between which an antenna shows a face."""


class Circumstances(Struct, frozen=True):
    """Circumstances that a behavior begins from. tracks: their angles."""

    tracks: Mapping[str, tuple[float, ...]]
    world: World
    mounting: Mounting


def course(behavior: BlockBehavior, now: Circumstances) -> Course:
    """Work out a behavior. Raises Impossible."""
    if isinstance(behavior, Looks):
        return _look(behavior, now)
    if not isinstance(behavior, TYPES):
        raise Impossible("BEHAVIOR_TYPE_NOT_SUPPORTED", f"this body has no {type_name(behavior)}")
    made = choreography.plan(behavior, Situation(kinematics.HOME, kinematics.HOME, now.world))
    if made.parts == ("nod",):
        legs = tuple(_smaller(leg) for leg in made.legs)
        return replace(made, legs=legs, on_target=dict(zip(made.joints, legs[1].goal, strict=True)))
    if made.parts == ("face",):
        return _out("face", antennas(made.on_target), now, made.points, made.note)
    if "torso" not in made.parts:
        raise Impossible("CANNOT_CREATE_BEHAVIOR", "this body has no arms")
    notes = [made.note, "this body has no arms; it moves the 'TORSO', the nearest" if len(made.parts) > 1 else ""]
    asked = made.on_target["torso_turn"], made.on_target["torso_lean"] * joints.LEAN_SIZE
    goal = [max(each.low, min(each.high, to)) for each, to in zip(joints.TRACKS["torso"], asked, strict=True)]
    return _out("torso", tuple(goal), now, made.points, "; ".join(filter(None, notes)))


def look_at(look: Looks, pose: Angles, world: World, mounting: Mounting) -> tuple[Radians, Radians]:
    """Yaw and pitch of the head on the target of a look, the body as in `pose`. Raises Impossible: no such entity."""
    yaw, pitch = joints.aim(choreography.entity_of(look.target, world).position, pose, mounting)
    if isinstance(look, Gaze | GazeShift) and look.offset_angle:
        right, up = choreography.OFFSETS.get(normal(look.offset_direction), (0, 0))
        size = radians(look.offset_angle) / (math.hypot(right, up) or 1.0)
        yaw, pitch = yaw - right * size, pitch + up * size
    return yaw, pitch


def seconds(track: str, here: Sequence[float], goal: Sequence[float]) -> Seconds:
    """Natural time of a way; 0: it is none."""
    way = max(abs(b - a) for a, b in zip(here, goal, strict=True))
    least, speed = PACES[track]
    return 0.0 if way < LEAST[track] + 1e-9 else least + math.degrees(way) / speed


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


def _out(
    track: str, goal: tuple[float, ...], now: Circumstances, points: tuple[WalkPoint, ...], note: str
) -> Course:  # fmt: skip
    """The way to a goal, at which it may be held, and from which it goes home, or stays."""
    here, names = now.tracks[track], tuple(limit.joint for limit in joints.TRACKS[track])
    time = seconds(track, here, goal)
    goal = goal if time else here
    way = points if len(points) == 2 else points[:-1]
    marks = tuple((each.sync, 1.0 if each.held_with or each.sync == "end" else 0.0) for each in way)
    return Course(
        parts=(track,), joints=names, legs=(Leg(goal=goal, seconds=time, marks=marks),), points=points,
        on_target=dict(zip(names, goal, strict=True)), note=note,
    )  # fmt: skip


def turned(behavior: BlockBehavior, now: Circumstances) -> tuple[Radians, Radians]:
    """Turn and lean of the body once a behavior has begun: it goes where a shift turns it. Raises Impossible."""
    turn, lean = now.tracks["torso"]
    if choreography.turns_trunk(behavior):
        turn, _ = look_at(behavior, joints.summed(now.tracks), now.world, now.mounting)
        turn = joints.own_turn(turn)
    return turn, lean


def _look(look: Looks, now: Circumstances) -> Course:
    now = replace(now, tracks={**now.tracks, "torso": turned(look, now)})
    yaw, pitch = look_at(look, joints.summed(now.tracks), now.world, now.mounting)
    goal = (yaw, pitch, joints.follow(yaw, now.tracks["torso"][0]))
    for limit, angle in zip(joints.TRACKS["head"], goal, strict=True):
        if not limit.low <= angle <= limit.high:
            low, high = math.degrees(limit.low), math.degrees(limit.high)
            wanted = f"{limit.joint} would be at {math.degrees(angle):.0f} degrees"
            reason = f"cannot look at {look.target!r}: {wanted}; it goes from {low:.0f} to {high:.0f}"
            advice = "is control.drivers.reachy_mini.position where the robot stands?"
            raise Impossible("CANNOT_CREATE_BEHAVIOR", reason, advice)
    points = held_on_target("stroke") if isinstance(look, Gaze) else (WalkPoint("start"), WalkPoint("end"))
    made = _out("head", goal, now, points, choreography.note_on(look))
    return replace(made, parts=("head", "torso")) if choreography.turns_trunk(look) else made


def _smaller(leg: Leg) -> Leg:
    """A leg of a nod in the size that this head has room for."""
    goal, velocity = (tuple(joints.NOD_SIZE * each for each in angles) for angles in (leg.goal, leg.velocity))
    return replace(leg, goal=goal, velocity=velocity)

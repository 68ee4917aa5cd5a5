"""Joints of Reachy Mini: their limits, the tracks along which they move, and where the eyes are with them. Pure.

Angles are Engage's: positive to the left, up, tilted to the left, leaning forward. The daemon tells the head's pose
in the frame of the foot, whatever the body's turn: x ahead, y to the left, z up; its pitch is positive down.

Ranges come from the daemon's inverse kinematics with the motors' limits of its `hardware_config.yaml`: with the head
within 30 degrees of the body's direction, every sum of gaze, nod and lean below is within them, to a degree or two at
the corners. Speeds are those of the vendor's own greeting: 20 degrees of roll in 0.2 s.
"""

import math
from collections.abc import Mapping
from math import radians

from msgspec.structs import replace

from engage_hri.schemas.body import BodyPose, JointAngle, JointLimit, Ray
from engage_hri.schemas.units import Meters, Radians, Vector
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.kinematics import Mounting, limit_in_degrees

ASIDE = radians(30.0)
"""A head that looks further aside than this of the body's direction takes the body along."""
NOD_SIZE = 0.5
"""Share of a nod's amplitude on the simulated torso: the head has half the room."""
LEAN_SIZE = 1.0 / 3.0
"""Share of a lean's angle on the simulated torso: the platform moves 12 mm to and fro."""
UPRIGHT = radians(10.0)
"""Angle of the antennas at rest, outwards from straight up: straight up they tremble."""


HEAD_HEIGHT: Meters = 0.177
"""From the foot to the head's frame while it is at rest: `head_z_offset` of the daemon's kinematics."""
EYES_AHEAD: Meters = 0.0395
EYES_ABOVE: Meters = 0.0525
"""The camera in the head's frame, from the vendor's description of the robot. It looks along the head's x axis."""
Angles = Mapping[str, Radians]


_TURN = limit_in_degrees("body_turn", "torso", -25, 25, 60, 300)
_LEAN = limit_in_degrees("body_lean", "torso", -4, 4, 40, 250)
_ANTENNAS = (
    limit_in_degrees("right_antenna", "face", -180, 180, 450, 6000),
    limit_in_degrees("left_antenna", "face", -180, 180, 450, 6000),
)
TRACKS: Mapping[str, tuple[JointLimit, ...]] = {
    "head": (
        limit_in_degrees("head_yaw", "head", -150, 150, 170, 1700),
        limit_in_degrees("head_pitch", "head", -33, 30, 170, 1700),
        limit_in_degrees("body_follow", "head", -120, 120, 110, 800),
    ),
    "nod": (
        limit_in_degrees("nod_yaw", "head", -8, 8, 110, 1500),
        limit_in_degrees("nod_pitch", "head", -8, 8, 110, 1500),
        limit_in_degrees("nod_roll", "head", -12, 12, 110, 1500),
    ),
    "torso": (_TURN, _LEAN),
    "face": _ANTENNAS,
}
"""Joints of each track. The head's and a nod's add up, and so do the body's own turn and that after the head."""
HOME: Mapping[str, tuple[float, ...]] = {
    "head": (0.0, 0.0, 0.0), "nod": (0.0, 0.0, 0.0), "torso": (0.0, 0.0), "face": (-UPRIGHT, UPRIGHT)
}  # fmt: skip
LIMITS = (
    limit_in_degrees("head_yaw", "head", -160, 160, 280, 3200),
    limit_in_degrees("head_pitch", "head", -41, 40, 280, 3200),
    limit_in_degrees("head_roll", "head", -12, 12, 110, 1500),
    limit_in_degrees("body_yaw", "torso", -145, 145, 170, 1100),
    limit_in_degrees("body_lean", "torso", -4.2, 4.2, 40, 250),
    *_ANTENNAS,
)
"""Joints as they are measured."""


def limits(pace: float) -> Mapping[str, tuple[JointLimit, ...]]:
    """Limits of the tracks at a pace, 1 = as fast as they are trusted to be."""
    return {
        track: tuple(replace(each, speed=each.speed * pace, acceleration=each.acceleration * pace**2) for each in own)
        for track, own in TRACKS.items()
    }


def summed(tracks: Mapping[str, tuple[float, ...]]) -> dict[str, float]:
    """Angles of the joints, from those of the tracks."""
    yaw, pitch, follow = tracks["head"]
    aside, up, roll = tracks["nod"]
    turn, lean = tracks["torso"]
    right, left = tracks["face"]
    return {
        "head_yaw": yaw + aside, "head_pitch": pitch + up, "head_roll": roll, "body_yaw": turn + follow,
        "body_lean": lean, "right_antenna": right, "left_antenna": left,
    }  # fmt: skip


def of_track(track: str, pose: Angles, others: Mapping[str, tuple[float, ...]]) -> tuple[float, ...]:
    """Angles of one track, from those of the joints and of the other tracks."""
    match track:
        case "head":
            aside, up, _ = others["nod"]
            return (pose["head_yaw"] - aside, pose["head_pitch"] - up, pose["body_yaw"] - others["torso"][0])
        case "nod":
            yaw, pitch, _ = others["head"]
            return (pose["head_yaw"] - yaw, pose["head_pitch"] - pitch, pose["head_roll"])
        case "torso":
            return (pose["body_yaw"] - others["head"][2], pose["body_lean"])
        case _:
            return (pose["right_antenna"], pose["left_antenna"])


def own_turn(yaw: float) -> float:
    """Angle nearest to one that the body turns by itself, not after the head."""
    return max(_TURN.low, min(_TURN.high, yaw))


def follow(yaw: float, turn: float) -> float:
    """Angle by which the body turns after a head that looks there, with the body turned already."""
    beyond = max(0.0, abs(yaw - turn) - ASIDE)
    return math.copysign(beyond, yaw - turn)


def pose_message(pose: Angles) -> BodyPose:
    """The pose as it crosses the bus."""
    return BodyPose(joints=tuple(JointAngle(limit.joint, pose[limit.joint]) for limit in LIMITS))


def message(tracks: Mapping[str, tuple[float, ...]]) -> BodyPose:
    """The same, from the angles of the tracks."""
    return pose_message(summed(tracks))


# -- places -------------------------------------------------------------------------------------------------------


def head_place(pose: Angles) -> Vector:
    """Place of the head's frame, against where it is at rest: it leans about the foot, metres."""
    ahead = HEAD_HEIGHT * math.sin(pose["body_lean"])
    down = HEAD_HEIGHT * (1.0 - math.cos(pose["body_lean"]))
    return (ahead * math.cos(pose["body_yaw"]), ahead * math.sin(pose["body_yaw"]), -down)


def lean(x: Meters, y: Meters, body_yaw: Radians) -> Radians:
    """Lean of the body, from the measured place of the head's frame."""
    ahead = x * math.cos(body_yaw) + y * math.sin(body_yaw)
    return math.asin(max(-1.0, min(1.0, ahead / HEAD_HEIGHT)))


def gaze(pose: Angles, mounting: Mounting) -> Ray:
    """Gaze in the robot's frame: from the camera along its axis."""
    ahead, up = kinematics.axes(pose["head_yaw"], pose["head_pitch"], pose["head_roll"])
    x, y, z = head_place(pose)
    eyes = [a + EYES_AHEAD * b + EYES_ABOVE * c for a, b, c in zip((x, y, z + HEAD_HEIGHT), ahead, up, strict=True)]
    return Ray(origin=mounting.from_foot((eyes[0], eyes[1], eyes[2])), axis=mounting.turned(ahead))


def aim(target: Vector, pose: Angles, mounting: Mounting) -> tuple[Radians, Radians]:
    """Yaw and pitch of the head whose gaze axis runs through a place, whether the head comes there or not.

    target: metres in the robot's frame. pose: the turn and lean of the body count.
    """
    (x, y, z), (dx, dy, dz) = mounting.to_foot(target), head_place(pose)
    return kinematics.turned_to(x - dx, y - dy, z - dz - HEAD_HEIGHT, EYES_ABOVE)

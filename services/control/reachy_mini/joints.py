"""Joints of Reachy Mini, what they are trusted with, and the tracks along which they move. Pure.

Ranges come from the daemon's inverse kinematics with the motors' limits of its `hardware_config.yaml`: with the head
within 30 degrees of the body's direction, every sum of gaze, nod and lean below is within them, to a degree or two at
the corners. Speeds are those of the vendor's own greeting: 20 degrees of roll in 0.2 s.
"""

import math
from collections.abc import Mapping
from math import radians

from msgspec.structs import replace

from engage_hri.schemas.body import BodyPose, JointAngle, JointLimit
from engage_hri.services.control.reachy_mini.geometry import Angles

ASIDE = radians(30.0)
"""A head that looks further aside than this of the body's direction takes the body along."""
NOD_SIZE = 0.5
"""Share of a nod's amplitude on the simulated torso: the head has half the room."""
LEAN_SIZE = 1.0 / 3.0
"""Share of a lean's angle on the simulated torso: the platform moves 12 mm to and fro."""
UPRIGHT = radians(10.0)
"""Angle of the antennas at rest, outwards from straight up: straight up they tremble."""


def _joint(name: str, part: str, low: float, high: float, speed: float, acceleration: float) -> JointLimit:
    """Limits in degrees, and per second and per second squared."""
    return JointLimit(
        joint=name, part=part, low=radians(low), high=radians(high), speed=radians(speed),
        acceleration=radians(acceleration),
    )  # fmt: skip


_TURN = _joint("body_turn", "torso", -25, 25, 60, 300)
_LEAN = _joint("body_lean", "torso", -4, 4, 40, 250)
_ANTENNAS = (
    _joint("right_antenna", "face", -180, 180, 450, 6000),
    _joint("left_antenna", "face", -180, 180, 450, 6000),
)
TRACKS: Mapping[str, tuple[JointLimit, ...]] = {
    "head": (
        _joint("head_yaw", "head", -150, 150, 170, 1700),
        _joint("head_pitch", "head", -33, 30, 170, 1700),
        _joint("body_follow", "head", -120, 120, 110, 800),
    ),
    "nod": (
        _joint("nod_yaw", "head", -8, 8, 110, 1500),
        _joint("nod_pitch", "head", -8, 8, 110, 1500),
        _joint("nod_roll", "head", -12, 12, 110, 1500),
    ),
    "torso": (_TURN, _LEAN),
    "face": _ANTENNAS,
}
"""Joints of each track. The head's and a nod's add up, and so do the body's own turn and that after the head."""
HOME: Mapping[str, tuple[float, ...]] = {
    "head": (0.0, 0.0, 0.0), "nod": (0.0, 0.0, 0.0), "torso": (0.0, 0.0), "face": (-UPRIGHT, UPRIGHT)
}  # fmt: skip
PARTS: Mapping[str, str] = {"head": "head", "nod": "head", "torso": "torso", "face": "face"}
"""The part of the body that a track moves."""
LIMITS = (
    _joint("head_yaw", "head", -160, 160, 280, 3200),
    _joint("head_pitch", "head", -41, 40, 280, 3200),
    _joint("head_roll", "head", -12, 12, 110, 1500),
    _joint("body_yaw", "torso", -145, 145, 170, 1100),
    _joint("body_lean", "torso", -4.2, 4.2, 40, 250),
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


def follow(yaw: float, turn: float) -> float:
    """Angle by which the body turns after a head that looks there, with the body turned already."""
    beyond = max(0.0, abs(yaw - turn) - ASIDE)
    return math.copysign(beyond, yaw - turn)


def message(pose: Angles) -> BodyPose:
    """The pose as it crosses the bus."""
    return BodyPose(joints=tuple(JointAngle(limit.joint, pose[limit.joint]) for limit in LIMITS))

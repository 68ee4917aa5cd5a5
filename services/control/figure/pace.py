"""Natural durations of the movements of the simulated torso."""

import math
from collections.abc import Sequence

from engage_hri.schemas.units import Degrees, Seconds
from engage_hri.services.control.figure import kinematics

LEAST_TURN = 0.3
"""Degrees: a gaze that would turn less does not move."""
LEAST_LEAN = 0.8
"""Degrees: a torso that has less to go stays; twice what it drifts on target."""
LEAST_FACE = 0.04
"""A face that has less to go stays. A share of its joints' ranges."""


def turning_time(start: Sequence[float], goal: Sequence[float]) -> Seconds:
    """Natural duration of a turn of the head: 0.3 s for 30 degrees, 0.5 s for 60, nothing for none."""
    turn = kinematics.degrees_between(start, goal)
    return 0.0 if turn < LEAST_TURN else 0.1 + turn / 150.0


def return_time(start: Sequence[float], goal: Sequence[float]) -> Seconds:
    """Natural duration of the way home of an arm, the torso or a face."""
    way = kinematics.degrees_between(start, goal)
    return 0.0 if way < 0.01 else 0.3 + max(abs(math.degrees(b - a)) for a, b in zip(start, goal, strict=True)) / 120


def arm_time(start: Sequence[float], goal: Sequence[float], least: Seconds, speed: Degrees) -> Seconds:
    return max(least, 0.15 + max(abs(math.degrees(b - a)) for a, b in zip(start, goal, strict=True)) / speed)


def moving_time(joints: Sequence[str], start: Sequence[float], goal: Sequence[float]) -> Seconds:
    """Natural duration of the way to an expression of the face or to a posture; nothing if it is hardly any way."""
    ways = {joint: abs(b - a) for joint, a, b in zip(joints, start, goal, strict=True)}
    if kinematics.LIMIT[joints[0]].part == "face":
        return max(map(_face_time, ways, ways.values())) if max(ways.values()) >= LEAST_FACE else 0.0
    return 0.0 if math.degrees(sum(ways.values())) < LEAST_LEAN else 2 * return_time(start, goal)


def _face_time(joint: str, way: float) -> Seconds:
    """Natural duration of the way of one joint of the face. A lid is as quick as a person's: a blink takes 0.24 s."""
    if way < LEAST_FACE:
        return 0.0
    return 0.05 + 0.06 * way if joint.endswith("_lid") else 0.15 + 0.25 * way

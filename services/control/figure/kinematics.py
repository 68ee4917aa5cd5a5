"""The simulated torso: where its joints put its eyes and hands, and which angles look or point at a position.

A torso behind a table: hip, neck with yaw, pitch and roll, two arms with shoulder yaw, shoulder pitch and elbow.
Metres and radians; x ahead, y left, z up, origin on the floor below the robot. Shoulder pitch is measured from
hanging down, forward positive; the elbow flexes the forearm forward, so that an arm stays in one vertical plane.
Other figures share the axes, and the place where their foot stands.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache, lru_cache
from math import atan2, cos, hypot, radians, sin
from typing import Literal

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.body import BodyPose, JointAngle, JointLimit, Ray
from engage_hri.schemas.units import Meters, Radians, Vector, minus, plus, times

Array = NDArray[np.float64]
Side = Literal["left", "right"]
Pose = Mapping[str, float]
"""Angle of each joint; radians, of the face a share of the way, 0 at rest."""

HIP: Vector = (0.0, 0.0, 0.60)
NECK: Vector = (0.0, 0.0, 1.10)
EYES_AHEAD: Meters = 0.05
EYES_ABOVE: Meters = 0.07
SHOULDER: Mapping[Side, Vector] = {"left": (0.0, 0.20, 0.95), "right": (0.0, -0.20, 0.95)}
UPPER_ARM: Meters = 0.20
FOREARM: Meters = 0.25
"""Elbow to the tip of the pointing hand."""
TABLE_TOP: Meters = 0.72
TABLE_EDGE: Meters = 0.20
"""x of the edge at the robot's side."""
CLEARANCE: Meters = 0.01
ROOM: Meters = 0.005
"""Beyond the clearance, of an arm that points while the torso leans: on its way home it comes so much lower."""
REACH: Meters = 1.5
"""Greatest distance from the shoulder to a target of pointing: farther, people can't tell which object is meant."""
HAND_TO_TARGET: Meters = 0.06
"""Least distance from the hand to the surface of a target: pointing is not touching. Physics: `mujoco/limbs.py`."""
NOD_RESERVE: Radians = radians(18.0)
"""Part of the neck's range that gaze keeps free, so that a nod finds room anywhere."""
TURN_RESERVE: Radians = radians(3.0)
"""Part of the torso's range that a turn towards something keeps free, for motors that go a little beyond."""
_PITCHES: tuple[Radians, ...] = tuple(radians(degrees) for degrees in range(20, -32, -2))
"""Pitches of the shoulder at which a pointing is tried, the most extended arm first."""
SLIDE: Radians = radians(2.0)
"""Change of the shoulder pitch from stroke to stroke_end, the axis staying on target: it keeps the arm in motion."""


def limit_in_degrees(joint: str, part: str, low: float, high: float, speed: float, acceleration: float) -> JointLimit:
    """Limits of a joint, given in degrees, and per second and per second squared."""
    low, high, speed, acceleration = map(radians, (low, high, speed, acceleration))
    return JointLimit(joint=joint, part=part, low=low, high=high, speed=speed, acceleration=acceleration)


def _joint(
    name: str, part: str, low: float, high: float, speed: float, acceleration: float, home: float = 0.0
) -> tuple[JointLimit, float]:
    return limit_in_degrees(name, part, low, high, speed, acceleration), radians(home)


def _face_joint(name: str, low: float, speed: float = 25.0, acceleration: float = 3000.0) -> tuple[JointLimit, float]:
    return JointLimit(joint=name, part="face", low=low, high=1.0, speed=speed, acceleration=acceleration), 0.0


def _lid(name: str) -> tuple[JointLimit, float]:
    """Joint of an eyelid, as light as a person's: it closes in 0.03 s."""
    return _face_joint(name, -0.5, speed=70.0, acceleration=14_000.0)


def _arm_joints(side: Side, inward: int) -> list[tuple[JointLimit, float]]:
    """Joints of one arm with their home angles. inward: sign of a yaw towards the middle."""
    low, high = sorted((-45.0 * inward, 80.0 * inward))
    return [
        _joint(f"{side}_shoulder_yaw", f"{side}_arm", low, high, 200, 2000),
        _joint(f"{side}_shoulder_pitch", f"{side}_arm", -35, 110, 200, 2000, home=-15),
        _joint(f"{side}_elbow", f"{side}_arm", 5, 145, 200, 2000, home=115),
    ]


_TABLE = [
    _joint("torso_turn", "torso", -30, 30, 60, 300),
    _joint("torso_lean", "torso", -15, 25, 60, 300),
    _joint("neck_yaw", "head", -85, 85, 500, 10_000),
    _joint("neck_pitch", "head", -80, 40, 500, 10_000),
    _joint("neck_roll", "head", -20, 20, 150, 3000),
    *_arm_joints("left", inward=-1),
    *_arm_joints("right", inward=1),
    _face_joint("left_brow", -1.0),
    _face_joint("right_brow", -1.0),
    _face_joint("brow_slant", -1.0),
    _lid("left_lid"),
    _lid("right_lid"),
    _face_joint("left_mouth_corner", -1.0),
    _face_joint("right_mouth_corner", -1.0),
    _face_joint("lips", 0.0),
    _face_joint("jaw", 0.0),
]
JOINTS: tuple[JointLimit, ...] = tuple(limit for limit, _ in _TABLE)
HOME: Mapping[str, float] = {limit.joint: home for limit, home in _TABLE}
LIMIT: Mapping[str, JointLimit] = {limit.joint: limit for limit in JOINTS}
PARTS: tuple[str, ...] = ("head", "torso", "left_arm", "right_arm", "face")
CARRIES: Mapping[str, tuple[str, ...]] = {"torso": ("head", "left_arm", "right_arm")}
"""Parts that a part moves with it."""


class Mounting:
    """The place of a robot's foot in the robot's frame. position: metres. facing: radians to its left."""

    def __init__(self, position: Vector, facing: Radians) -> None:
        self.position = position
        self._cos, self._sin = cos(facing), sin(facing)

    def to_foot(self, point: Vector) -> Vector:
        """A point of the robot's frame in the frame of the foot, metres."""
        x, y, z = (there - here for there, here in zip(point, self.position, strict=True))
        return (self._cos * x + self._sin * y, self._cos * y - self._sin * x, z)

    def from_foot(self, point: Vector) -> Vector:
        """A point of the frame of the foot in the robot's frame, metres."""
        x, y, z = self.turned(point)
        return (x + self.position[0], y + self.position[1], z + self.position[2])

    def turned(self, axis: Vector) -> Vector:
        """A direction of the frame of the foot in the robot's frame."""
        x, y, z = axis
        return (self._cos * x - self._sin * y, self._sin * x + self._cos * y, z)


class Unreachable(ValueError):
    """No joint angles look or point at the target; the message says why."""


class ArmAim(Struct, frozen=True):
    """Arm angles (shoulder yaw, shoulder pitch, elbow) whose forearm axis runs through a target."""

    stroke: tuple[float, float, float]
    held: tuple[float, float, float]
    """Angles a little later, still on target."""


@cache
def joints_of(part: str) -> tuple[str, ...]:
    return tuple(limit.joint for limit in JOINTS if limit.part == part)


def pose_message(pose: Pose) -> BodyPose:
    return BodyPose(joints=tuple([JointAngle(name, angle) for name, angle in pose.items()]))


def gaze(pose: Pose) -> Ray:
    """Gaze as a ray: from between the eyes along their axis."""
    trunk = _trunk(pose)
    ahead, up = axes(pose["neck_yaw"], pose["neck_pitch"], pose["neck_roll"])
    eyes = plus(NECK, plus(times(ahead, EYES_AHEAD), times(up, EYES_ABOVE)))
    return Ray(origin=_to_world(eyes, trunk), axis=_turned(ahead, trunk))


def axes(yaw: Radians, pitch: Radians, roll: Radians) -> tuple[Vector, Vector]:
    """Axes of a head that is turned so, ahead and up."""
    cos_yaw, sin_yaw, cos_pitch, sin_pitch = cos(yaw), sin(yaw), cos(pitch), sin(pitch)
    ahead = (cos_pitch * cos_yaw, cos_pitch * sin_yaw, sin_pitch)
    left = (-sin_yaw, cos_yaw, 0.0)
    up = (-sin_pitch * cos_yaw, -sin_pitch * sin_yaw, cos_pitch)
    return ahead, plus(times(up, cos(roll)), times(left, sin(roll)))


def turned_to(x: Meters, y: Meters, z: Meters, above: Meters) -> tuple[float, float]:
    """Yaw and pitch of a head whose axis runs through a place, seen from its pivot. above: of the axis over that."""
    distance = hypot(x, y)
    # So the pitch is a little less than the direction from the pivot.
    return atan2(y, x), atan2(z, distance) - math.asin(above / max(hypot(distance, z), above))


def arm(pose: Pose, side: Side) -> Ray:
    """Forearm as a ray: from the elbow, tip at the hand."""
    yaw, pitch, trunk = pose[f"{side}_shoulder_yaw"], pose[f"{side}_shoulder_pitch"], _trunk(pose)
    elbow = plus(SHOULDER[side], times(_arm_direction(yaw, pitch), UPPER_ARM))
    axis = _arm_direction(yaw, pitch + pose[f"{side}_elbow"])
    hand = plus(elbow, times(axis, FOREARM))
    return Ray(origin=_to_world(elbow, trunk), axis=_turned(axis, trunk), tip=_to_world(hand, trunk))


def look_at(target: Vector, pose: Pose, reserve: Radians = 0.0) -> tuple[float, float]:
    """Neck yaw and pitch whose gaze axis runs through `target`, the torso as in `pose`.

    reserve: kept free before the joints' limits, for a nod. Raises Unreachable.
    """
    # What is nearer than the eyes may lie on the gaze axis, but behind them.
    if math.dist(_to_torso(target, pose), NECK) <= math.hypot(EYES_AHEAD, EYES_ABOVE):
        raise Unreachable("it is inside the head")
    angles = neck_angles(target, pose)
    for joint, angle in zip(("neck_yaw", "neck_pitch"), angles, strict=True):
        if not LIMIT[joint].low + reserve <= angle <= LIMIT[joint].high - reserve:
            raise Unreachable(f"{joint} cannot turn to {math.degrees(angle):.0f} degrees")
    return angles


def turn_towards(target: Vector) -> Radians:
    """Turn of the torso whose front is towards `target`, or as near as it comes."""
    limit = LIMIT["torso_turn"]
    turn = atan2(target[1] - HIP[1], target[0] - HIP[0])
    return min(max(turn, limit.low + TURN_RESERVE), limit.high - TURN_RESERVE)


def neck_angles(target: Vector, pose: Pose) -> tuple[float, float]:
    """Neck yaw and pitch whose gaze axis runs through `target`, whether the joints come there or not."""
    return turned_to(*minus(_to_torso(target, pose), NECK), EYES_ABOVE)


def arm_angles(side: Side, target: Vector, pitch: Radians, pose: Pose) -> tuple[float, float, float]:
    """Angles of the `side` arm with the shoulder at `pitch` whose forearm axis runs through `target`, within the
    joints' limits or not."""
    x, y, z = minus(_to_torso(target, pose), SHOULDER[side])
    return _pointing(x, y, z, pitch)


def arm_angles_over(side: Side, target: Vector, pitch: Radians | Array, trunks: Array) -> tuple[Array, Array, Array]:
    """The same for many places of the torso at once. trunks: 2 x places. pitch: one, or any shape x places."""
    (x, y, z), (turn, lean) = minus(target, HIP), trunks
    ahead, aside = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    forward, height = ahead * np.cos(lean) - z * np.sin(lean), z * np.cos(lean) + ahead * np.sin(lean)
    shoulder = minus(SHOULDER[side], HIP)
    x, y, z = forward - shoulder[0], aside - shoulder[1], height - shoulder[2]
    out = np.arctan2(np.hypot(x, y) - UPPER_ARM * np.sin(pitch), -z - UPPER_ARM * np.cos(pitch)) - pitch
    yaw, lift, _ = np.broadcast_arrays(np.arctan2(y, x), pitch, out)
    return yaw, lift, out


def point_at(
    side: Side, target: Vector, radius: Meters, pose: Pose, trunks: tuple[tuple[float, ...], ...] = ()
) -> ArmAim:
    """Angles of the `side` arm that point at `target` without touching it, as extended as the table allows.

    radius: of what is pointed at. trunks: turn and lean of other places of the torso where the arm is to be clear of
    the table as it stays on target. Raises Unreachable.
    """
    aim = _aim(side, target, radius, (pose["torso_turn"], pose["torso_lean"]), trunks)
    if isinstance(aim, str):
        raise Unreachable(aim)
    return aim


@lru_cache(256)  # of one place it is asked from many poses of the arm, with the same answer
def _aim(
    side: Side, target: Vector, radius: Meters, trunk: tuple[float, float], trunks: tuple[tuple[float, ...], ...]
) -> ArmAim | str:
    """Angles that point at `target`, or why there are none."""
    pose = {"torso_turn": trunk[0], "torso_lean": trunk[1]}
    x, y, z = minus(_to_torso(target, pose), SHOULDER[side])
    distance = hypot(x, y, z)
    if distance > REACH:
        return f"it is {distance:.2f} m from the {side} shoulder, farther than {REACH} m"
    reason = ""
    low: list[bool] = []
    for number, pitch in enumerate(_PITCHES):
        stroke, held = (_pointing(x, y, z, angle) for angle in (pitch, pitch - SLIDE))
        reason = _objection(side, stroke, target, radius, pose) or _objection(side, held, target, radius, pose)
        if not reason:
            low = low or _are_low(side, target, [each for each in trunks if any(each)])
            reason = "the table is in the way as the torso moves" if low[number] else ""
        if not reason:
            return ArmAim(stroke, held)
    return f"the {side} arm finds no way to point at it: {reason}"


def _are_low(side: Side, target: Vector, trunks: Sequence[tuple[float, ...]]) -> list[bool]:
    """Tell for each of `_PITCHES` if an arm is in the table, or has no room to it, with the torso at any of `trunks`.

    It points there, or comes as near to that as its joints do.
    """
    if not trunks:
        return [False] * len(_PITCHES)
    pitches = np.array(_PITCHES)[:, None, None] - np.array([0.0, SLIDE])[:, None]
    turned = np.array(trunks).T
    limits = [LIMIT[name] for name in joints_of(f"{side}_arm")]
    free = zip(arm_angles_over(side, target, pitches, turned), limits, strict=True)
    angles = np.array([np.clip(angle, limit.low, limit.high) for angle, limit in free])
    least = above_table(side, angles, turned).min(axis=(1, 2))
    return [above < ROOM for above in least.tolist()]


def touches_table(pose: Pose, sides: Iterable[Side] = ("left", "right")) -> bool:
    """True if an elbow, forearm or hand is in the table or closer than the clearance."""
    return any(_is_in_table(arm(pose, side)) for side in sides)


def above_table(side: Side, arm_angles: Array, trunk: Array | None = None) -> Array:
    """Distances in metres by which an arm stays out of the table, for many poses; where it is in it, below 0.

    arm_angles, trunk: of the joints of the arm, and of the torso (None: upright), joints x poses. The same points
    count as in `touches_table`.
    """
    yaw, pitch, elbow = arm_angles
    forward, sideward, out = np.cos(yaw), np.sin(yaw), pitch + elbow
    ahead, above = UPPER_ARM * np.sin(pitch), -UPPER_ARM * np.cos(pitch)
    further, lower = ahead + FOREARM * np.sin(out), above - FOREARM * np.cos(out)
    (x, y, z), places = SHOULDER[side], []
    for reach, height in ((ahead, above), (further, lower)):
        place = x + reach * forward, z + height
        places.append(place if trunk is None else _carried(place[0], y + reach * sideward, place[1], trunk))
    (elbow_x, elbow_z), (hand_x, hand_z) = places
    is_across = (elbow_x < TABLE_EDGE) & (hand_x > TABLE_EDGE)
    part = (TABLE_EDGE - elbow_x) / np.where(is_across, hand_x - elbow_x, 1.0)
    edge, top = TABLE_EDGE - CLEARANCE, TABLE_TOP + CLEARANCE
    at_edge = np.where(is_across, elbow_z + part * (hand_z - elbow_z) - top, np.inf)
    at_elbow, at_hand = np.maximum(edge - elbow_x, elbow_z - top), np.maximum(edge - hand_x, hand_z - top)
    return np.asarray(np.minimum(np.minimum(at_elbow, at_hand), at_edge))


def _carried(x: Array, y: Array, z: Array, trunk: Array) -> tuple[Array, Array]:
    """Places of points of the torso's frame in the world, as `_to_world` has them: how far ahead, and how high."""
    turn, lean = trunk
    height = z - HIP[2]
    ahead = x * np.cos(lean) + height * np.sin(lean)
    return ahead * np.cos(turn) - y * np.sin(turn), HIP[2] + height * np.cos(lean) - x * np.sin(lean)


def degrees_between(one: Iterable[float], other: Iterable[float]) -> float:
    """Sum over joints of the rotation from one to the other, in degrees."""
    return math.degrees(sum(abs(b - a) for a, b in zip(one, other, strict=True)))


def _pointing(x: float, y: float, z: float, pitch: Radians) -> tuple[float, float, float]:
    """Arm angles whose forearm axis runs through (x, y, z), relative to the shoulder. pitch: of the shoulder."""
    ahead = hypot(x, y) - UPPER_ARM * sin(pitch)
    above = z + UPPER_ARM * cos(pitch)
    return atan2(y, x), pitch, atan2(ahead, -above) - pitch


def _objection(side: Side, angles: tuple[float, float, float], target: Vector, radius: Meters, pose: Pose) -> str:
    names = joints_of(f"{side}_arm")
    for name, angle in zip(names, angles, strict=True):
        if not LIMIT[name].low <= angle <= LIMIT[name].high:
            return f"{name} cannot turn to {math.degrees(angle):.0f} degrees"
    forearm = arm({**pose, **dict(zip(names, angles, strict=True))}, side)
    if _is_in_table(forearm):
        return "the table is in the way"
    is_near = (
        math.dist(_tip(forearm), target) < radius + HAND_TO_TARGET or math.dist(forearm.origin, target) < FOREARM
    )
    return "it is too near" if is_near else ""


def _tip(forearm: Ray) -> Vector:
    assert forearm.tip is not None
    return forearm.tip


def _is_in_table(forearm: Ray) -> bool:
    return any(_in_table(point) for point in (forearm.origin, _tip(forearm), _edge_crossing(forearm)))


def _in_table(point: Vector) -> bool:
    return point[0] > TABLE_EDGE - CLEARANCE and point[2] < TABLE_TOP + CLEARANCE


def _edge_crossing(forearm: Ray) -> Vector:
    """Point at which the forearm passes the table's edge; the hand if it does not."""
    (x0, y0, z0), (x1, y1, z1) = forearm.origin, _tip(forearm)
    if not x0 < TABLE_EDGE < x1:
        return (x1, y1, z1)
    part = (TABLE_EDGE - x0) / (x1 - x0)
    return (TABLE_EDGE, y0 + part * (y1 - y0), z0 + part * (z1 - z0))


def _arm_direction(yaw: Radians, angle: Radians) -> Vector:
    """Unit vector at `angle` from straight down, forward in the vertical plane at `yaw`."""
    ahead = sin(angle)
    return (ahead * cos(yaw), ahead * sin(yaw), -cos(angle))


def _trunk(pose: Pose) -> tuple[float, float, float, float]:
    """Cosine and sine of the torso's lean and of its turn: the same for all that it carries."""
    lean, turn = pose["torso_lean"], pose["torso_turn"]
    return (cos(lean), sin(lean), cos(turn), sin(turn))


def _turned(vector: Vector, trunk: tuple[float, float, float, float]) -> Vector:
    """Torso frame to world, direction only: lean about y, then turn about z."""
    (x, y, z), (cos_lean, sin_lean, cos_turn, sin_turn) = vector, trunk
    x, z = x * cos_lean + z * sin_lean, z * cos_lean - x * sin_lean
    return (x * cos_turn - y * sin_turn, x * sin_turn + y * cos_turn, z)


def _to_world(point: Vector, trunk: tuple[float, float, float, float]) -> Vector:
    return plus(HIP, _turned(minus(point, HIP), trunk))


def _to_torso(point: Vector, pose: Pose) -> Vector:
    (x, y, z), lean, turn = minus(point, HIP), pose["torso_lean"], pose["torso_turn"]
    x, y = x * cos(turn) + y * sin(turn), y * cos(turn) - x * sin(turn)
    x, z = x * cos(lean) - z * sin(lean), z * cos(lean) + x * sin(lean)
    return plus(HIP, (x, y, z))

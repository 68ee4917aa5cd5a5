"""Tracks: the motion of each part of the simulated torso, and the pose they add up to. Pure: time is an argument.

The head has two tracks: gaze, and a nod on top of it. They share the neck's limits, so that their sum keeps them.
Only the nod tilts the head.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import chain
from math import radians

import msgspec
import numpy as np

from engage_hri.schemas.body import BodyPose, JointLimit
from engage_hri.schemas.units import Meters, Radians, Seconds
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.course import NECK, TRUNK, UPRIGHT, Aim, return_time, turning_time
from engage_hri.services.control.motion.motion import Motion, Track, Trunk
from engage_hri.services.control.motion.path import Array, JointMotion, Leg, Path

ALONG = np.linspace(0.0, 1.0, 17)
"""Shares of a path's length at which it is held against the table."""
FINELY = np.linspace(0.0, 1.0, 129)
"""The same where the trunk leans: there is less room."""
COARSELY = 8
"""Of the finer shares one in so many is looked at first."""
UP = (0.2, 0.4, 0.6, 0.8)
"""Radians by which an arm is raised on its way home, in the order in which they are tried."""
RAISING: Seconds = 0.4
MOMENTS = 121
"""Instants at which arms and a trunk that move at once are held against the table."""
GAZE_SHARES = (0.56, 0.42)
"""Shares of the neck's speed and of its acceleration for gaze; the rest is for nods, which are short and quick."""


def _neck_limits(speed: float, acceleration: float, reserve: float | None) -> tuple[JointLimit, ...]:
    """Limits of the neck's joints for one track. speed, acceleration: its shares.

    reserve: kept free at both ends of the range; None: the range is `NOD_RESERVE` around 0.
    """
    limits = []
    for limit in (kinematics.LIMIT[joint] for joint in NECK):
        low, high = -kinematics.NOD_RESERVE, kinematics.NOD_RESERVE
        if reserve is not None:
            low, high = limit.low + reserve, limit.high - reserve
        limits.append(
            msgspec.structs.replace(
                limit, low=low, high=high, speed=speed * limit.speed, acceleration=acceleration * limit.acceleration
            )
        )
    return tuple(limits)


LIMITS: Mapping[str, tuple[JointLimit, ...]] = {
    "head": _neck_limits(*GAZE_SHARES, kinematics.NOD_RESERVE),
    "nod": (*_neck_limits(1.0 - GAZE_SHARES[0], 1.0 - GAZE_SHARES[1], None), kinematics.LIMIT["neck_roll"]),
    **{
        part: tuple(kinematics.LIMIT[joint] for joint in kinematics.joints_of(part))
        for part in ("torso", "left_arm", "right_arm", "face")
    },
}
HOME: Mapping[str, tuple[float, ...]] = {
    part: tuple(0.0 if part == "nod" else kinematics.HOME[limit.joint] for limit in limits)
    for part, limits in LIMITS.items()
}


def home_of(part: str, displaced: Mapping[str, float]) -> tuple[float, ...]:
    """Home angles of a part, with some joints elsewhere."""
    home = zip(LIMITS[part], HOME[part], strict=True)
    return tuple(angle if part == "nod" else displaced.get(limit.joint, angle) for limit, angle in home)


class PartTrack(Track[Aim]):
    """The motion of one part of the torso: a path that comes home clear of the table."""

    def __init__(self, name: str, angles: Sequence[float]) -> None:
        super().__init__(name, LIMITS[name], HOME[name], angles)

    def limits(self, t: Seconds, aim: Aim | None) -> tuple[JointLimit, ...]:
        """Limits of a path with this aim that begins then."""
        return limits_of((self.name,), is_free=aim is not None and not self.is_still(t, aim))

    def return_to(
        self, goal: tuple[float, ...], now: Seconds, aim: Aim | None = None, trunks: Sequence[Trunk] = (UPRIGHT,)
    ) -> None:
        """Leave the current motion and go to rest at `goal`, by a path that is clear of the table.

        aim: the place that it is on at `goal`. trunks: where the trunk may be meanwhile.
        """
        start = self.start_at(now, aim)
        time = turning_time if self.part == "head" else return_time
        seconds = time(start.q.tolist(), goal)
        direct = Path(start, (Leg(goal=goal, seconds=seconds),), self.limits(now, aim))
        if not meets_table(direct, self.joints, trunks):
            self.play(Motion(direct, now), aim=aim)
            return
        # Up first: the elbow bends and the upper arm lifts, which takes elbow and hand away from the table. Where the
        # trunk leans over it the arm is not down before the trunk is up.
        rising = self.trunk.motion.end - now
        stay = Leg(goal=tuple(start.q.tolist()), seconds=rising)
        ways: list[tuple[Leg, ...]] = [(stay, Leg(goal=goal, seconds=seconds))] if rising > RAISING else []
        seconds = max(seconds, RAISING, rising)
        ways = [(Leg(goal=goal, seconds=seconds),), *ways]
        ways += [
            (Leg(goal=above, seconds=RAISING), Leg(goal=goal, seconds=seconds))
            for above in raised(self.angles(now), self.joints)
        ]
        # Or with the elbow bent all the way.
        bent, (yaw, pitch, _) = self.own_limits[2].high, self.angles(now)
        ways.append(
            (
                Leg(goal=(yaw, pitch, bent), seconds=max(RAISING, rising)),
                Leg(goal=(*goal[:2], bent), seconds=seconds),
                Leg(goal=goal, seconds=RAISING),
            )
        )
        found, best = Motion(direct, now), -math.inf
        for legs in ways:
            motion = Motion(Path(start, legs, self.own_limits), now)
            if (above := self._above_table(motion, now)) > best:
                found, best = motion, above
            if best >= 0.0:
                break
        self.play(found)

    def _above_table(self, motion: Motion, now: Seconds) -> Meters:
        """Least distance by which an arm that moves so stays out of the table as the trunk moves."""
        at = np.linspace(now, max(motion.end, self.trunk.motion.end), MOMENTS)
        trunk = self.trunk.motion.positions(at)[:, self.trunk.columns]
        return above_table_along(motion.positions(at), self.joints, trunk)


def raised(arm: tuple[float, ...], joints: Sequence[str]) -> Iterator[tuple[float, ...]]:
    """Angles of an arm on a detour home, from lower to higher."""
    yaw, pitch, elbow = arm
    for up in UP:
        highest = [kinematics.LIMIT[joint].high for joint in joints]
        yield (yaw, min(max(pitch, 0.2) + up, highest[1]), min(elbow + 2 * up, highest[2]))


def bases(tracks: Mapping[str, PartTrack]) -> dict[str, float]:
    """Angles of all joints to which their parts go back."""
    based = {part: track for part, track in tracks.items() if part != "nod"}
    return {
        **kinematics.HOME,
        **{joint: angle for track in based.values() for joint, angle in zip(track.joints, track.base, strict=True)},
    }


def limits_of(parts: Sequence[str], *, is_free: bool = False) -> tuple[JointLimit, ...]:
    """Limits of some parts. is_free: the first without its ranges, for a path to which a trunk adds its share."""
    first, *others = (LIMITS[part] for part in parts)
    if is_free:
        first = tuple(msgspec.structs.replace(limit, low=-math.pi, high=math.pi) for limit in first)
    return tuple(chain(first, *others))


def joined(states: Sequence[JointMotion]) -> JointMotion:
    """The states of several tracks as one, in their order."""
    return JointMotion(
        np.concatenate([state.q for state in states]),
        np.concatenate([state.v for state in states]),
        np.concatenate([state.a for state in states]),
    )


def meets_table(
    path: Path,
    joints: Sequence[str],
    trunks: Sequence[Trunk] = (UPRIGHT,),
    since: Seconds = 0.0,
) -> bool:
    """True if an elbow or hand comes into the table anywhere on `path`, with the trunk at any of `trunks`.

    A path of the trunk, too, has it where it goes. since: where on the path it is.
    """
    if not path.length:
        return False
    is_upright = tuple(trunks) == (UPRIGHT,) and TRUNK[0] not in joints
    shares = ALONG if is_upright else FINELY
    if since:
        shares = min(since / path.length, 1.0) + max(0.0, 1.0 - since / path.length) * shares
    angles = path.positions(shares)
    if TRUNK[0] in joints:
        columns = [list(joints).index(joint) for joint in TRUNK]
        return above_table_along(angles, joints, angles[:, columns]) < 0.0
    places: Trunk | Array = UPRIGHT if is_upright else np.array(trunks)
    # Most paths that meet it do so at one of few poses.
    coarse = () if is_upright else (angles[::COARSELY],)
    return any(above_table(each, joints, places) < 0.0 for each in (*coarse, angles))


def above_table(angles: Array, joints: Sequence[str], trunk: Trunk | Array) -> Meters:
    """Least distance by which arms stay out of the table; below 0: they do not; infinite: `joints` has none of them.

    angles: poses x joints. trunk: a place of the trunk, or places x 2: each pose counts at each of them.
    """
    places = None if isinstance(trunk, tuple) and trunk == UPRIGHT else np.reshape(trunk, (-1, 2)).T[:, :, None]
    return _least(angles[:, None, :].T if places is not None else angles.T, joints, places)


def above_table_each(poses: Array, joints: Sequence[str], trunks: Sequence[Trunk]) -> Array:
    """The same for many groups of poses: the least of each. poses: groups x poses x joints. trunks: count for all."""
    places = np.array(trunks).T[:, None, None, :]
    least = np.full(len(poses), math.inf)
    for above in _by_side(np.moveaxis(poses, 2, 0)[..., None], joints, places):
        least = np.minimum(least, above.min(axis=(1, 2)))
    return least


def above_table_along(angles: Array, joints: Sequence[str], trunks: Array) -> Meters:
    """The same for arms and a trunk that move at once. trunks: the place for each pose, poses x 2.

    angles: may have more axes before these two: of each pose many."""
    return _least(np.moveaxis(angles, -1, 0), joints, trunks.T)


def _least(angles: Array, joints: Sequence[str], trunks: Array | None) -> Meters:
    return min((float(np.min(above)) for above in _by_side(angles, joints, trunks)), default=math.inf)


def _by_side(angles: Array, joints: Sequence[str], trunks: Array | None) -> Iterator[Array]:
    """Tell how far each arm of `joints` stays out of the table. angles: joints x any shape."""
    row = {joint: number for number, joint in enumerate(joints)}
    for side in kinematics.SHOULDER:
        if f"{side}_elbow" in row:
            arm = angles[[row[joint] for joint in kinematics.joints_of(f"{side}_arm")]]
            yield kinematics.above_table(side, arm, trunks)


def pose_at(tracks: Mapping[str, PartTrack], t: Seconds) -> dict[str, float]:
    """The angle of every joint, nod included."""
    pose: dict[str, float] = {}
    for name, track in tracks.items():
        named = zip(track.joints, track.angles(t), strict=True)
        pose.update(named if name != "nod" else [(joint, pose.get(joint, 0.0) + angle) for joint, angle in named])
    return pose


def updated(pose: Mapping[str, float], by: BodyPose | None) -> dict[str, float]:
    """The pose with the angles of a message in place of its own; joints that this body lacks are ignored."""
    angles = {angle.joint: angle.angle for angle in by.joints if angle.joint in pose} if by is not None else {}
    return {**pose, **angles}


Pose = tuple[float, ...]
"""Angles of the joints of one arm, or of both."""

LIFTS: tuple[Radians, ...] = tuple(radians(degrees) for degrees in range(0, 48, 3))
"""Angles by which the upper arm is raised, in the order in which they are tried."""
SIZES = (1.0, 0.85, 0.7, 0.55, 0.4)
"""Shares of the full amplitude, in the order in which they are tried."""
MARGIN: Meters = 0.005
"""Between two poses a path may come so much lower than at both."""


def clear_of_table(
    joints: tuple[str, ...], poses: Sequence[Pose], home: Pose, trunks: tuple[Trunk, ...]
) -> Sequence[Pose]:
    """Raise the poses of a gesture until arms are clear of the table, or make it smaller. Raises Impossible.

    home: where the arms come from and go to. trunks: where the trunk may be meanwhile.
    """
    if trunks == (UPRIGHT,):
        return poses  # So they were made.
    for size in SIZES:
        smaller = [nearer(pose, home, size) for pose in poses]
        raised = [[lifted(joints, pose, lift) for pose in smaller] for lift in LIFTS]
        for made, is_clear in zip(raised, are_clear(joints, raised, trunks), strict=True):
            if is_clear:
                return made
    raise Impossible("CANNOT_CREATE_BEHAVIOR", "the table is in the way of the arm, as the torso leans")


def are_clear(joints: tuple[str, ...], groups: Sequence[Sequence[Pose]], trunks: Sequence[Trunk]) -> Sequence[bool]:
    """For each group of poses, all of a size: True if arms are clear of the table in all, wherever the trunk is."""
    clear: list[bool] = (above_table_each(np.array(groups), joints, trunks) > MARGIN).tolist()
    return clear


def lifted(joints: tuple[str, ...], pose: Pose, by: Radians) -> Pose:
    """The pose with the upper arms raised, as far as they go."""
    return tuple(
        min(angle + by, max(angle, kinematics.LIMIT[joint].high)) if joint.endswith("_shoulder_pitch") else angle
        for joint, angle in zip(joints, pose, strict=True)
    )


def nearer(pose: Pose, home: Pose, by: float) -> Pose:
    """The pose at a share of its way from home."""
    return tuple(rest + by * (angle - rest) for angle, rest in zip(pose, home, strict=True))

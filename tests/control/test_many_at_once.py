"""What the torso works out for many at once, against each by itself, from its definition."""

import math
from random import Random

import numpy as np
import pytest

from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import kinematics, tracks
from engage_hri.services.control.figure.course import TRUNK, UPRIGHT, Aim, Trunk
from engage_hri.services.control.figure.kinematics import (
    CLEARANCE,
    REACH,
    ROOM,
    SLIDE,
    TABLE_EDGE,
    TABLE_TOP,
    Pose,
    Side,
    Unreachable,
)
from engage_hri.services.control.figure.tracks import LIFTS, MARGIN, SIZES, clear_of_table
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import (
    LEAST,
    OUTSIDE,
    SAMPLES,
    SHARE,
    STRETCHES,
    JointMotion,
    Leg,
    Path,
)
from engage_hri.services.control.motion.path import (
    MARGIN as SAMPLED,
)

ROUNDING = 1e-9
SIDES: tuple[Side, ...] = ("left", "right")
SETS = [("left_arm",), ("head",), ("torso",), ("left_arm", "right_arm"), ("torso", "left_arm", "right_arm")]


def above(pose: Pose, side: Side) -> float:
    """Metres by which an arm stays out of the table, looked at by the places of its forearm."""
    forearm = kinematics.arm(pose, side)
    assert forearm.tip is not None
    points = [forearm.origin, forearm.tip]
    (x, _, z), (tip_x, _, tip_z) = points
    if x < TABLE_EDGE < tip_x:
        points.append((math.inf, 0.0, z + (TABLE_EDGE - x) / (tip_x - x) * (tip_z - z)))
    return min(max(TABLE_EDGE - CLEARANCE - x, z - TABLE_TOP - CLEARANCE) for x, _, z in points)


def trunk_at(chance: Random) -> Trunk:
    return (math.radians(chance.uniform(-30, 30)), math.radians(chance.uniform(-15, 25)))


def with_trunk(trunk: Trunk) -> dict[str, float]:
    return {**kinematics.HOME, **dict(zip(TRUNK, trunk, strict=True))}


# -- paths ---------------------------------------------------------------------------------------------------------


def state(chance: Random, parts: tuple[str, ...], hurry: float) -> JointMotion:
    limits = tracks.limits_of(parts)
    return JointMotion(
        np.array([chance.uniform(limit.low, limit.high) for limit in limits]),
        np.array([hurry * chance.uniform(-limit.speed, limit.speed) for limit in limits]),
        np.array([hurry * chance.uniform(-0.5, 0.5) * limit.acceleration for limit in limits]),
    )


def excess(start: JointMotion, goal: np.ndarray, out: np.ndarray, seconds: float, parts: tuple[str, ...]) -> float:
    """By which share a quintic that takes so long exceeds the worst of its limits. Six equations for six numbers."""
    derived = np.array([[math.perm(n, k) * (n >= k) for n in range(6)] for k in range(3)], dtype=float)
    at = [[seconds ** (n - k) if n >= k else 0.0 for n in range(6)] for k in range(3)]
    first = np.array([[float(n == k) for n in range(6)] for k in range(3)]) * derived
    ends = np.vstack((first, derived * np.array(at)))
    c = np.linalg.solve(ends, np.vstack((start.q, start.v, start.a, goal, out, np.zeros_like(goal))))
    limits, worst = tracks.limits_of(parts), -math.inf
    for t in (SAMPLES * seconds).tolist():
        for joint, limit in enumerate(limits):
            q, v, a = (
                sum(math.perm(n, k) * c[n, joint] * t ** (n - k) for n in range(k, 6)) for k in range(3)
            )  # fmt: skip
            worst = max(
                worst,
                abs(v) / limit.speed / SAMPLED - 1.0,
                abs(a) / limit.acceleration / (SAMPLED * SHARE) - 1.0,
                max(limit.low - q, q - limit.high) / (limit.high - limit.low) - OUTSIDE,
            )
    return worst


@pytest.mark.parametrize("parts", SETS, ids="+".join)
def test_a_leg_takes_the_first_duration_that_keeps_the_limits(parts: tuple[str, ...]) -> None:
    chance, longer = Random("+".join(parts)), 0
    for _ in range(6):
        start = state(chance, parts, chance.choice((0.0, 0.3)))
        goal = state(chance, parts, 0.0).q * 0.5
        natural = chance.choice((0.15, 0.4))
        path = Path(start, [Leg(goal=tuple(goal.tolist()), seconds=natural)], tracks.limits_of(parts))
        tried = [max(natural, LEAST) * stretch for stretch in STRETCHES]
        number = min(range(len(tried)), key=lambda each: abs(tried[each] - path.length))
        assert path.length == pytest.approx(tried[number], abs=1e-12)
        if (least := excess(start, goal, np.zeros_like(goal), path.length, parts)) > ROUNDING:
            each = [excess(start, goal, np.zeros_like(goal), seconds, parts) for seconds in tried]
            assert least < min(each) + ROUNDING, "none keeps them: the one that exceeds them least"
            continue
        excesses = [excess(start, goal, np.zeros_like(goal), each, parts) for each in tried[:number]]
        assert all(each > -ROUNDING for each in excesses)
        longer += number > 8
    assert longer


def test_positions_of_a_motion_are_those_of_each_instant() -> None:
    chance = Random(3)
    for _ in range(80):
        limits = tracks.limits_of(("left_arm",))
        goals = [tuple(chance.uniform(limit.low, limit.high) for limit in limits) for _ in range(3)]
        path = Path(state(chance, ("left_arm",), 0.0), [Leg(goal=goal, seconds=0.3) for goal in goals], limits)
        motion = Motion(path, 1.0, cruise=chance.uniform(0.2, 1.5))
        motion.run_at(chance.uniform(0.1, 2.0), since := 1.0 + chance.uniform(0.0, path.length))
        if chance.random() < 0.5:
            motion.brake(since := since + chance.uniform(0.0, 0.5))
        times = np.sort([chance.uniform(since, motion.end + 1.0) for _ in range(20)])
        each = [motion.at(t).q for t in times.tolist()]
        assert np.abs(motion.positions(times) - each).max() < ROUNDING


# -- arms over the table -------------------------------------------------------------------------------------------


def test_offsets_of_an_aim_are_those_of_each_place_of_the_trunk() -> None:
    chance = Random(4)
    for _ in range(80):
        target = (chance.uniform(0.3, 0.9), chance.uniform(-0.5, 0.5), 0.75)
        aim = Aim(target=target, trunk=trunk_at(chance), side=chance.choice(SIDES), pitch=chance.uniform(-0.5, 0.4))
        places = [*(trunk_at(chance) for _ in range(6)), aim.trunk, UPRIGHT]
        each = [aim.offset(place) for place in places]
        assert np.abs(aim.offsets(np.array(places)) - each).max() < ROUNDING


def test_groups_of_poses_are_as_far_out_of_the_table_as_the_lowest_of_each() -> None:
    chance = Random(5)
    joints = tuple(joint for side in SIDES for joint in kinematics.joints_of(f"{side}_arm"))
    for _ in range(40):
        groups = [
            [
                tuple(chance.uniform(kinematics.LIMIT[each].low, kinematics.LIMIT[each].high) for each in joints)
                for _ in range(3)
            ]
            for _ in range(4)
        ]
        places = [trunk_at(chance) for _ in range(5)]
        slowly = [
            min(
                above({**with_trunk(place), **dict(zip(joints, pose, strict=True))}, side)
                for pose in group
                for place in places
                for side in SIDES
            )
            for group in groups
        ]
        assert tracks.above_table_each(np.array(groups), joints, places).tolist() == pytest.approx(slowly, abs=1e-9)


def test_a_gesture_is_raised_by_the_least_lift_that_is_clear() -> None:
    chance, raised, refused = Random(6), 0, 0
    joints = kinematics.joints_of("left_arm")
    home = tuple(kinematics.HOME[joint] for joint in joints)
    for _ in range(100):
        poses = [
            tuple(math.radians(chance.uniform(low, high)) for low, high in ((-20, 10), (-10, 40), (45, 125)))
            for _ in range(3)
        ]
        places = (UPRIGHT, *(trunk_at(chance) for _ in range(2)))

        def is_clear(made: list[tuple[float, ...]], places: tuple[Trunk, ...] = places) -> bool:
            seen = [{**with_trunk(each), **dict(zip(joints, pose, strict=True))} for pose in made for each in places]
            return min(above(pose, "left") for pose in seen) > MARGIN

        expected = None
        for size in SIZES:
            for lift in LIFTS:
                made = [
                    tuple(rest + size * (angle - rest) for angle, rest in zip(pose, home, strict=True))
                    for pose in poses
                ]
                high = kinematics.LIMIT["left_shoulder_pitch"].high
                made = [(yaw, min(pitch + lift, max(pitch, high)), elbow) for yaw, pitch, elbow in made]
                if expected is None and is_clear(made):
                    expected, raised = made, raised + (lift > 0.0)
        if expected is None:
            refused += 1
            with pytest.raises(Impossible):
                clear_of_table(joints, poses, home, places)
        else:
            assert np.abs(np.subtract(clear_of_table(joints, poses, home, places), expected)).max() < ROUNDING
    assert raised > 5, (raised, refused)
    assert refused > 5, (raised, refused)


def pointed(side: Side, target: tuple[float, float, float], trunk: Trunk, trunks: list[Trunk]) -> list[float]:
    """Pitches at which an arm points at a small target, and finds room wherever the trunk goes."""
    found, names = [], kinematics.joints_of(f"{side}_arm")
    for degrees in range(20, -32, -2):
        pitches = (math.radians(degrees), math.radians(degrees) - SLIDE)
        is_good = True
        for pitch in pitches:
            angles = dict(zip(names, kinematics.arm_angles(side, target, pitch, with_trunk(trunk)), strict=True))
            pose = {**with_trunk(trunk), **angles}
            forearm = kinematics.arm(pose, side)
            assert forearm.tip is not None
            is_good &= all(
                kinematics.LIMIT[name].low <= angles[name] <= kinematics.LIMIT[name].high for name in names
            )
            is_good &= above(pose, side) >= 0.0 and math.dist(forearm.origin, target) >= kinematics.FOREARM
            is_good &= math.dist(forearm.tip, target) >= kinematics.HAND_TO_TARGET + 0.02
            for place in trunks:
                free = kinematics.arm_angles(side, target, pitch, with_trunk(place))
                near = {
                    name: min(max(angle, kinematics.LIMIT[name].low), kinematics.LIMIT[name].high)
                    for name, angle in zip(names, free, strict=True)
                }
                is_good &= place == UPRIGHT or above({**with_trunk(place), **near}, side) >= ROOM
        found += [pitches[0]] if is_good else []
    return found


def test_an_arm_points_with_the_most_extended_arm_that_has_room_wherever_the_trunk_goes() -> None:
    chance, found, refused, lower = Random(7), 0, 0, 0
    for _ in range(150):
        side = chance.choice(SIDES)
        target = (chance.uniform(0.3, 0.9), chance.uniform(-0.5, 0.5), 0.75)
        trunk, trunks = trunk_at(chance), [UPRIGHT, *(trunk_at(chance) for _ in range(4))]
        assert math.dist(kinematics.SHOULDER[side], target) < REACH
        pitches = pointed(side, target, trunk, trunks)
        if not pitches:
            refused += 1
            with pytest.raises(Unreachable):
                kinematics.point_at(side, target, 0.02, with_trunk(trunk), tuple(trunks))
            continue
        found += 1
        lower += pitches[0] != (pointed(side, target, trunk, [UPRIGHT]) or [0.0])[0]
        aim = kinematics.point_at(side, target, 0.02, with_trunk(trunk), tuple(trunks))
        assert aim.stroke[1] == pytest.approx(pitches[0], abs=1e-9)
    assert found > 20
    assert refused > 5
    assert lower > 3

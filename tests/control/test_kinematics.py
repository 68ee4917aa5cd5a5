"""Where the simulated torso looks and points."""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from engage_hri.schemas.body import Ray
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.kinematics import HOME, Side, Unreachable

PIECES = [(x / 100, y / 100, 0.73) for x in range(35, 80, 5) for y in range(-40, 45, 10)]
SIDES: tuple[Side, ...] = ("left", "right")


def misses_by(ray: Ray, target: tuple[float, float, float]) -> float:
    """Distance of the target from the ray's axis, ahead of its origin."""
    to = [b - a for a, b in zip(ray.origin, target, strict=True)]
    along = sum(a * b for a, b in zip(to, ray.axis, strict=True))
    assert along > 0
    return math.dist(to, [along * a for a in ray.axis])


@pytest.mark.parametrize("target", PIECES)
def test_every_piece_can_be_looked_at_and_pointed_at_by_one_arm_at_least(target: tuple[float, float, float]):
    pointing = []
    for side in SIDES:
        try:
            pointing.append((side, kinematics.point_at(side, target, 0.035, HOME)))
        except Unreachable:
            continue

    assert pointing
    for side, aim in pointing:
        for angles in (aim.stroke, aim.held):
            pose = {**HOME, **dict(zip(kinematics.joints_of(f"{side}_arm"), angles, strict=True))}
            ray = kinematics.arm(pose, side)
            assert ray.tip is not None
            assert misses_by(ray, target) < 1e-9
            assert math.dist(ray.tip, target) > 0.035
            assert not kinematics.touches_table(pose)


@settings(max_examples=100)
@given(
    x=st.floats(0.3, 2.0), y=st.floats(-1.0, 1.0), z=st.floats(0.4, 1.8),
    lean=st.floats(-0.2, 0.3), turn=st.floats(-0.4, 0.4),
)  # fmt: skip
def test_the_gaze_axis_runs_through_what_is_looked_at(x: float, y: float, z: float, lean: float, turn: float):
    pose = {**HOME, "torso_lean": lean, "torso_turn": turn}
    try:
        yaw, pitch = kinematics.look_at((x, y, z), pose)
    except Unreachable:
        assume(False)

    assert misses_by(kinematics.gaze({**pose, "neck_yaw": yaw, "neck_pitch": pitch}), (x, y, z)) < 1e-9


@settings(max_examples=100)
@given(
    x=st.floats(0.3, 1.2), y=st.floats(-0.6, 0.6), z=st.floats(0.73, 1.4),
    lean=st.floats(-0.1, 0.1), side=st.sampled_from(SIDES),
)  # fmt: skip
def test_the_forearm_axis_runs_through_what_is_pointed_at(x: float, y: float, z: float, lean: float, side: Side):
    pose = {**HOME, "torso_lean": lean}
    try:
        aim = kinematics.point_at(side, (x, y, z), 0.0, pose)
    except Unreachable:
        assume(False)

    there = {**pose, **dict(zip(kinematics.joints_of(f"{side}_arm"), aim.held, strict=True))}
    assert misses_by(kinematics.arm(there, side), (x, y, z)) < 1e-9


def test_the_eyes_and_hands_are_where_a_seated_persons_are():
    eyes, hand = kinematics.gaze(HOME).origin, kinematics.arm(HOME, "left").tip

    assert eyes == pytest.approx((0.05, 0.0, 1.17))
    assert hand == pytest.approx((0.194, 0.2, 0.800), abs=1e-3)
    assert not kinematics.touches_table(HOME)


@pytest.mark.parametrize(
    ("target", "reason"),
    [
        ((3.0, 0.0, 0.8), "farther than"),
        ((-0.5, 0.0, 0.9), "cannot turn"),
        ((0.1, -0.2, 0.76), "too near"),
    ],
)
def test_what_cannot_be_pointed_at_says_why(target: tuple[float, float, float], reason: str):
    with pytest.raises(Unreachable, match=reason):
        kinematics.point_at("right", target, 0.03, HOME)


def test_a_hand_in_the_table_is_noticed():
    down = {**HOME, "left_shoulder_pitch": 0.8, "left_elbow": 0.1}

    assert kinematics.touches_table(down, ("left",))
    assert not kinematics.touches_table(down, ("right",))

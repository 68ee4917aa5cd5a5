"""Heads from points: against points of which the head is known."""

import numpy as np
import pytest

from engage_hri.schemas.perception import FACE_POINTS
from engage_hri.services.perception.eyes.head_pose import LOWER_LIP, average_face, head, turn, yaw_pitch
from engage_hri.services.perception.eyes.looking import packed, unpacked
from tests.perception.eyes.faces import FOCAL, HEIGHT, WIDTH, points
from tests.perception.eyes.people import Pose

EVERYWHERE = [
    Pose((x, y, z), yaw, pitch, roll)
    for (x, y, z) in ((0.0, 0.0, 0.5), (0.4, -0.2, 1.2), (-0.3, 0.15, 0.8), (0.1, 0.0, 3.0))
    for yaw, pitch, roll in ((0, 0, 0), (40, 10, 0), (-40, -30, 8), (15, -20, -30), (-70, 5, 3))
]


@pytest.mark.parametrize("pose", EVERYWHERE)
@pytest.mark.usefixtures("exact_face")
def test_a_head_is_found_where_it_is(pose: Pose):
    found = head(points(pose), WIDTH, HEIGHT, FOCAL)

    assert found is not None
    assert found.place == pytest.approx(pose.at, abs=1e-4)
    assert found.ahead == pytest.approx(pose.ahead, abs=1e-3)


@pytest.mark.usefixtures("exact_face")
def test_points_that_shake_by_a_pixel_turn_the_head_by_less_than_a_degree():
    pose = Pose((0.1, 0.0, 0.8), 20, -15)
    angles = [
        yaw_pitch(found.ahead) for seed in range(50) if (found := head(points(pose, 1.0, seed), WIDTH, HEIGHT, FOCAL))
    ]

    assert len(angles) == 50
    assert np.degrees(np.std(angles, axis=0)).max() < 1.0
    assert np.degrees(np.mean(angles, axis=0)) == pytest.approx((20, -15), abs=0.5)


def test_an_angle_is_to_the_right_of_the_picture_and_up():
    assert yaw_pitch(Pose(yaw=30).ahead) == pytest.approx((np.radians(30), 0.0))
    assert yaw_pitch(Pose(pitch=20).ahead) == pytest.approx((0.0, np.radians(20)))


def test_what_is_no_face_is_no_head():
    chance = np.random.default_rng(1)
    found = [head(chance.uniform(0, 480, (FACE_POINTS, 3)), WIDTH, HEIGHT, FOCAL) for _ in range(20)]

    assert all(each is None or np.isfinite(each.place).all() for each in found)
    assert head(np.full((FACE_POINTS, 3), 200.0), WIDTH, HEIGHT, FOCAL) is None


def test_the_more_a_head_is_turned_aside_the_less_sure_it_is():
    ahead, aside = (head(points(Pose((0, 0, 0.5), yaw)), WIDTH, HEIGHT, FOCAL) for yaw in (0, 40))
    assert ahead is not None
    assert aside is not None

    assert aside.yaw_spread > ahead.yaw_spread > np.radians(0.6)
    assert aside.pitch_spread > ahead.pitch_spread > np.radians(2)
    assert aside.pitch_spread < np.radians(15)


def test_the_mouth_is_measured_whatever_it_does_to_the_head():
    shut = points(Pose((0, 0, 0.7), 10, -10))
    open_ = shut.copy()
    open_[average_face().points[:, 1] > average_face().points[LOWER_LIP, 1] - 1e-4, 1] += 15.0
    first, second = head(shut, WIDTH, HEIGHT, FOCAL), head(open_, WIDTH, HEIGHT, FOCAL)
    assert first is not None
    assert second is not None

    assert second.ahead == pytest.approx(first.ahead, abs=1e-6)
    assert second.mouth > first.mouth + 0.05


def test_points_lose_less_than_a_tenth_of_a_pixel_on_their_way():
    seen = points(Pose((0.2, -0.1, 0.9), 25, -12))

    [back] = unpacked([packed(seen)])
    assert back == pytest.approx(seen, abs=0.07)


def test_a_turn_is_by_its_angle():
    assert turn(np.array([0.0, 0.0, np.pi / 2])) @ [1.0, 0.0, 0.0] == pytest.approx([0.0, 1.0, 0.0])

"""From landmarks to people: where they are, and where they face, in the robot's frame; smooth, and not late."""

import math
from collections.abc import Iterable

import numpy as np
import pytest

from engage_hri.services.perception.eyes.camera import StatedCamera
from engage_hri.services.perception.eyes.config import EyesConfig
from engage_hri.services.perception.eyes.one_euro import OneEuro
from engage_hri.services.perception.eyes.seeing import PersonCame, PersonGone, Seeing, SeenHead
from tests.perception.eyes.faces import landmarks
from tests.perception.eyes.people import Pose

pytestmark = pytest.mark.usefixtures("exact_face")
RATE = 15


def heads(config: EyesConfig, poses: Iterable[Pose], noise: float = 0.0) -> list[SeenHead]:
    seeing, told = Seeing(config), []
    for k, pose in enumerate(poses):
        told += seeing.feed(landmarks([pose], k / RATE, noise), k / RATE)
    return [each for each in told if isinstance(each, SeenHead)]


def test_a_camera_that_looks_ahead_sees_who_sits_there_look_back():
    *_, last = heads(EyesConfig(place=(0.1, 0.0, 1.2)), [Pose((0.2, 0.1, 1.0))] * 30)

    assert last.place == pytest.approx((1.1, -0.2, 1.1), abs=2e-3)
    assert last.direction == pytest.approx((-1, 0, 0), abs=5e-3)


def test_a_camera_that_is_tilted_and_turned_tells_the_same_of_who_has_not_moved():
    """It looks 30 degrees up from the table and 20 to the left: the place in the room is worked out beside it."""
    camera = StatedCamera(60.0, (0.3, 0.1, 0.7), 30.0, 20.0)
    up, left = np.radians(30), np.radians(20)

    assert camera.direction(np.array([0.0, 0.0, 1.0])) == pytest.approx(
        (math.cos(up) * math.cos(left), math.cos(up) * math.sin(left), math.sin(up))
    )
    assert camera.direction(np.array([1.0, 0.0, 0.0])) == pytest.approx((math.sin(left), -math.cos(left), 0))
    assert camera.direction(np.array([0.0, 1.0, 0.0]))[2] == pytest.approx(-math.cos(up))
    assert camera.place(np.array([0.0, 0.0, 2.0]))[2] == pytest.approx(0.7 + 2 * math.sin(up))
    assert camera.focal(640) == pytest.approx(320 / math.tan(np.radians(30)))


def test_a_head_that_stands_is_told_smoother_than_it_is_measured():
    poses = [Pose((0, 0, 1.0), 20, -15)] * 150
    told = heads(EyesConfig(), poses, noise=2.5)[30:]
    raw = heads_unfiltered(poses)
    angles = np.degrees([math.asin(each.direction[2] / math.hypot(*each.direction)) for each in told])

    assert np.std(angles) < 0.6 * raw
    assert np.mean(angles) == pytest.approx(-15, abs=0.5)


def heads_unfiltered(poses: list[Pose]) -> float:
    """Standard deviation of the pitch as it is measured, degrees."""
    from engage_hri.services.perception.eyes.head_pose import head, yaw_pitch
    from engage_hri.services.perception.eyes.looking import unpacked
    from tests.perception.eyes.faces import FOCAL, HEIGHT, WIDTH

    found = []
    for k, pose in enumerate(poses):
        [points] = unpacked(landmarks([pose], k / RATE, 2.5).faces)
        seen = head(points, WIDTH, HEIGHT, FOCAL)
        assert seen is not None
        found.append(math.degrees(yaw_pitch(seen.ahead)[1]))
    return float(np.std(found[30:]))


@pytest.mark.parametrize("degrees", [8, 20, 40])
def test_a_turn_of_the_head_is_told_within_a_picture(degrees: float):
    """Of a turn in 0.3 s the middle is passed at most one picture later than in truth."""
    turns = [degrees * float(np.clip((k / RATE - 2) / 0.3, 0, 1)) for k in range(60)]
    told = heads(EyesConfig(), [Pose((0, 0, 1.0), yaw) for yaw in turns], noise=0.5)
    first = 60 - len(told)
    yaws = np.degrees([math.atan2(-each.direction[1], -each.direction[0]) for each in told])
    crossed = (first + int(np.argmax(yaws > degrees / 2))) / RATE

    assert 2.1 < crossed <= 2.15 + 1.5 / RATE


def test_who_comes_is_told_with_the_first_picture_and_who_goes_with_the_last():
    seeing, told = Seeing(EyesConfig()), []
    for k in range(RATE * 6):
        poses = [Pose((0, 0, 0.9))] if 15 <= k < 45 else []
        told += seeing.feed(landmarks(poses, k / RATE), k / RATE)

    assert [each.at for each in told if isinstance(each, PersonCame)] == [1.0]
    assert [each.at for each in told if isinstance(each, PersonGone)] == [44 / RATE]
    assert seeing.end() == []


def test_at_the_end_all_go():
    seeing = Seeing(EyesConfig())
    for k in range(10):
        seeing.feed(landmarks([Pose((-0.3, 0, 1)), Pose((0.3, 0, 1))], k / RATE), k / RATE)

    assert sorted(each.person for each in seeing.end() if isinstance(each, PersonGone)) == ["face_1", "face_2"]


def test_a_picture_that_comes_twice_or_late_is_none():
    seeing = Seeing(EyesConfig())
    for k in range(10):
        seeing.feed(landmarks([Pose((0, 0, 1))], k / RATE), k / RATE)

    assert seeing.feed(landmarks([Pose((0, 0, 1))], 9 / RATE), 9 / RATE) == []
    assert seeing.feed(landmarks([Pose((0.2, 0, 1))], 5 / RATE), 5 / RATE) == []
    assert len(seeing.feed(landmarks([Pose((0, 0, 1))], 10 / RATE), 10 / RATE)) == 1


def test_what_is_too_far_to_be_a_head_is_none():
    assert heads(EyesConfig(), [Pose((0, 0, 7.0))] * 20) == []


def test_a_filter_follows_what_moves_on_and_rests_where_it_rests():
    filtered = OneEuro(1.5, 12.0)
    values = [float(filtered.feed(np.array([min(k / 15, 1.0)]), k / 15)[0]) for k in range(60)]

    assert values[0] == 0.0
    assert values == sorted(values)
    assert values[14] > 0.85
    assert values[-1] == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize("wrong", [{"tilt": 200.0}, {"field_of_view": 0.0}, {"rate": -1.0}, {"pan": float("nan")}])
def test_a_camera_that_cannot_be_is_refused(wrong: dict[str, float]):
    with pytest.raises(ValueError, match=next(iter(wrong))):
        EyesConfig(**wrong)  # type: ignore[arg-type]

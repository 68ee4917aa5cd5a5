"""Sources that look at pictures, on rendered people: what they find, and what they do when nothing can be seen."""

from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.perception.eyes.head_pose import head, yaw_pitch
from engage_hri.services.perception.eyes.looking import Floats, SourceSettings, unpacked
from engage_hri.services.runtime.parcels import DETECTOR
from tests.perception.eyes.cases import cases
from tests.perception.eyes.fetched import MODELS, needs_eyes
from tests.perception.eyes.people import (
    CAMERA,
    FITTED,
    JUDGED,
    Person,
    Picture,
    Pose,
    covered,
    drawn,
    noisy,
)

needs_eyes()

import cv2  # noqa: E402

from engage_hri.services.perception.eyes.sources.litert import Crop, FaceFinder  # noqa: E402
from engage_hri.services.perception.eyes.sources.pictures import FilmSource  # noqa: E402
from engage_hri.services.perception.pictures import Blindness, CameraBlind  # noqa: E402

PLACE = (0.1, 0.02, 0.75)


@cache
def picture(number: int, pose: Pose) -> Picture:
    return noisy(drawn([(Person(JUDGED[number]), pose)], seed=number), 3, number)


def finder(most: int = 4) -> FaceFinder:
    return FaceFinder(MODELS, most)


@pytest.mark.parametrize("number", [0, 3, 7])
def test_a_rendered_person_is_found_and_faces_where_they_do(number: int):
    pose = Pose(PLACE, 18, -12)
    [(points, confidence)] = finder().find(picture(number, pose))
    found = head(points, CAMERA.width, CAMERA.height, CAMERA.focal)
    assert found is not None

    assert confidence > 0.9
    assert np.degrees(yaw_pitch(found.ahead)) == pytest.approx((18, -12), abs=8)
    assert found.distance == pytest.approx(np.linalg.norm(PLACE), rel=0.15)


def test_heads_of_people_of_whom_nothing_was_learned_are_as_near_the_truth_as_is_stated():
    beside, shares = list[float](), list[Floats]()
    for number, looks in enumerate(JUDGED):
        for case in cases(looks, 2000 + number, 0, 2, fine=1):
            [(points, _)] = finder().find(case.picture)
            found = head(points, CAMERA.width, CAMERA.height, CAMERA.focal)
            assert found is not None
            wrong = np.subtract(yaw_pitch(found.ahead), yaw_pitch(case.pose.ahead))
            beside.append(float(np.degrees(np.hypot(*wrong))))
            shares.append(np.abs(wrong) / (found.yaw_spread, found.pitch_spread))

    assert np.mean(beside) < 4.2
    assert (np.array(shares) < 1).mean() < 0.85
    assert (np.array(shares) < 2).mean() > 0.85


def test_an_open_mouth_is_seen_of_faces_that_are_followed():
    def mouth(number: int, share: float) -> float:
        looks = finder(most=1)
        seen = [looks.find(picture(number, Pose(PLACE, mouth=share))) for _ in range(4)]
        found = head(seen[-1][0][0], CAMERA.width, CAMERA.height, CAMERA.focal)
        assert found is not None
        return found.mouth

    wider = [mouth(number, 0.5) - mouth(number, 0.0) for number in (1, 2, 3)]
    assert min(wider) > 0.025
    assert np.mean(wider) > 0.05


def test_the_last_digits_of_how_sure_a_square_is_do_not_move_a_face(monkeypatch: pytest.MonkeyPatch):
    exact, chance = FaceFinder._meshed, np.random.default_rng(1)

    def shaken(self: FaceFinder, image: Picture, crop: Crop) -> tuple[Floats, float]:
        points, confidence = exact(self, image, crop)
        return points, confidence - chance.uniform(0, 1e-6)

    monkeypatch.setattr(FaceFinder, "_meshed", shaken)
    found = [finder().find(picture(3, Pose(PLACE, 18, -12)))[0][0] for _ in range(6)]
    assert max(np.abs(each - found[0]).max() for each in found) < 0.01


def test_two_people_are_two_faces_and_a_far_one_is_found():
    people = [(Person(FITTED[1]), Pose((-0.25, 0, 0.9))), (Person(FITTED[5]), Pose((0.5, 0, 1.9)))]
    both, far = drawn(people), drawn([(Person(FITTED[0]), Pose((0.6, -0.1, 2.4)))])

    looks, one = finder(), finder(most=1)
    assert max(len(looks.find(both)) for _ in range(2 * 15)) == 2  # who is far is looked for in parts, in two seconds
    assert len(looks.find(both)) == 2
    assert max(len(one.find(both)) for _ in range(2 * 15)) == 1
    assert len(finder().find(far)) == 1


def test_a_face_is_followed_without_being_looked_for():
    looks = finder()
    first = looks.find(picture(3, Pose(PLACE)))[0][0]
    again = looks.find(picture(3, Pose((0.12, 0.02, 0.75))))[0][0]

    shift = (again - first)[:, 0].mean()
    assert shift == pytest.approx(0.02 / 0.75 * CAMERA.focal, abs=3)


def test_nobody_is_in_an_empty_room_and_none_is_told_of_a_face_that_is_covered():
    looks = finder()
    assert looks.find(drawn([], seed=4)) == []
    assert len(looks.find(picture(3, Pose(PLACE)))) == 1

    hidden = covered(picture(3, Pose(PLACE)), (300, 120, 520, 420))
    assert looks.find(hidden) == []
    assert len(looks.find(picture(3, Pose(PLACE)))) == 1


def settings(path: Path) -> SourceSettings:
    return SourceSettings(path=str(path), rate=10.0, models=str(MODELS))


@pytest.fixture
def shown(tmp_path: Path) -> Iterator[Path]:
    """A folder of pictures of somebody who goes."""
    for number, image in enumerate([picture(0, Pose(PLACE))] * 3 + [drawn([], seed=0)] * 2):
        cv2.imwrite(str(tmp_path / f"{number:03}.png"), image[:, :, ::-1])
    return tmp_path


def test_a_folder_of_pictures_is_a_film(shown: Path):
    told = list(FilmSource(settings(shown)).look())

    assert [len(each.faces) for each in told] == [1, 1, 1, 0, 0]
    assert [each.at.seconds for each in told] == pytest.approx([0, 0.1, 0.2, 0.3, 0.4])
    assert (told[0].width, told[0].height) == (640, 480)
    [points] = unpacked(told[0].faces)
    assert np.linalg.norm(points[[33, 263], :2].mean(0) - [405, 257]) < 20


def test_a_film_has_the_times_of_its_pictures(tmp_path: Path):
    path = tmp_path / "film.avi"
    film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), 20, (640, 480))
    for _ in range(4):
        film.write(picture(0, Pose(PLACE))[:, :, ::-1].copy())
    film.release()

    told = list(FilmSource(settings(path)).look())
    assert [len(each.faces) for each in told] == [1] * 4
    assert [b.at.seconds - a.at.seconds for a, b in pairwise(told)] == pytest.approx([0.05] * 3)


def test_what_is_no_film_is_refused(tmp_path: Path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "film.mp4").write_bytes(b"none")

    for path, reason in (("nowhere", "no such file"), ("empty", "no picture"), ("film.mp4", "no film")):
        with pytest.raises(InputRefused, match=reason):
            FilmSource(settings(tmp_path / path))


def test_without_models_it_is_said_how_to_have_them(tmp_path: Path):
    with pytest.raises(InputRefused, match=DETECTOR) as refused:
        FaceFinder(tmp_path, 1)
    assert refused.value.fault.advice == "engage eyes install"


@pytest.mark.parametrize("kind", ["black", "the same"])
def test_a_camera_that_gives_nothing_to_see_is_told_and_says_nothing_of_people(kind: str):
    blindness, chance, image = Blindness("eyes.source"), np.random.default_rng(1), picture(0, Pose(PLACE))
    dark = [chance.integers(0, 8, image.shape).astype(np.uint8) for _ in range(60)]
    given = dark if kind == "black" else [image] * 60

    seen = list[bool]()

    def look() -> None:
        for k, each in enumerate(given):
            seen.append(not blindness.is_blind(each, k / 15))

    with pytest.raises(CameraBlind, match=kind) as blind:
        look()
    assert sum(seen) <= 1
    assert len(seen) / 15 < 2
    assert blind.value.fault.advice


def test_a_camera_that_sees_again_is_not_blind():
    blindness = Blindness("eyes.source")
    for k in range(150):
        image = np.zeros((48, 64, 3), np.uint8) if k % 20 < 10 else noisy(np.full((48, 64, 3), 90, np.uint8), 3, k)
        assert blindness.is_blind(image, k / 15) == (k % 20 < 10)

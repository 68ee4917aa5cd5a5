"""Where a camera stands, and how wide it sees, from pictures of the sheet that were drawn with a known truth."""

import math
import xml.etree.ElementTree as tree

import cv2
import numpy as np
import pytest

from engage_hri.schemas.faults import RunFailed
from engage_hri.services.perception.eyes.camera import StatedCamera
from engage_hri.services.perception.eyes.head_pose import MeasuredHead
from engage_hri.services.perception.eyes.placing import (
    FLAT,
    UPRIGHT,
    SheetFinder,
    placed_by_seat,
    placed_by_sheet,
    sheet,
    size,
)
from tests.perception.eyes.drawing import Floats, Picture
from tests.perception.pieces.tables import Eye

LAID = (0.6, 0.05, 0.72)


def printed() -> Picture:
    """The sheet as a printer would print its SVG: five pixels a millimetre."""
    image = np.full((210 * 5, 297 * 5), 255, np.uint8)
    for each in tree.fromstring(sheet()).iter("{http://www.w3.org/2000/svg}rect"):
        x, y, wide, tall = (float(each.get(name, 0)) * 5 for name in ("x", "y", "width", "height"))
        if each.get("fill") != "white":
            image[round(y) : round(y + tall), round(x) : round(x + wide)] = 0
    return image


PAPER = printed()


def shown(eye: Eye, middle: Floats, axes: Floats, seed: int) -> Picture:
    """A picture of the sheet. middle: of its markers; axes: right, down and into it, in columns."""
    wide, tall = size()
    left, top = (0.297 - wide) / 2, (0.210 - tall) / 2 - 0.003
    corners = np.array([[0, 0], [0.297, 0], [0.297, 0.210], [0, 0.210]]) - [left + wide / 2, top + tall / 2]
    places = corners @ axes[:, :2].T + middle
    fine = 3
    across = np.array([[0, 0], [1485, 0], [1485, 1050], [0, 1050]], np.float32)
    there = cv2.getPerspectiveTransform(across, (eye(places) * fine).astype(np.float32))
    large = (eye.width * fine, eye.height * fine)
    paper = cv2.warpPerspective(PAPER, there, large, flags=cv2.INTER_AREA, borderValue=110)
    image = cv2.resize(paper, (eye.width, eye.height), interpolation=cv2.INTER_AREA).astype(float)
    rng = np.random.default_rng(seed)
    image = cv2.GaussianBlur(image, (0, 0), 0.8) * rng.uniform(0.5, 1) + rng.normal(0, 6, image.shape)
    return np.asarray(np.repeat(np.clip(image, 0, 255).astype(np.uint8)[..., None], 3, 2))


def slanted(rng: np.random.Generator) -> Floats:
    """Axes of a sheet that somebody holds before a camera."""
    return UPRIGHT @ cv2.Rodrigues(rng.uniform(-0.7, 0.7, 3))[0]


@pytest.mark.parametrize(
    ("eye", "axes", "at"),
    [
        (Eye(), FLAT, LAID),
        (Eye(at=(0.1, 0.2, 1.4), down=47, left=-8, lean=3, field=55), FLAT, LAID),
        (
            Eye(at=(0.05, 0.0, 1.17), down=-4, left=3, lean=-2, field=62, width=640, height=480),
            UPRIGHT,
            (0.9, 0.0, 1.1),
        ),
    ],
)
def test_a_camera_is_found_by_the_sheet(eye: Eye, axes: Floats, at: tuple[float, float, float]):
    finder, rng = SheetFinder(), np.random.default_rng(1)
    ahead = np.array([math.cos(math.radians(eye.down)), 0.0, -math.sin(math.radians(eye.down))])
    moved = []
    for seed in range(12):
        middle = eye.at + ahead * rng.uniform(0.5, 0.9) + rng.normal(0, 0.04, 3)
        tipped = cv2.Rodrigues(np.array([0.0, math.radians(eye.down), 0.0]))[0] @ slanted(rng)
        if (seen := finder.find(shown(eye, middle, tipped, seed))) is not None:
            moved.append(seen)
    laid = [seen for seed in (20, 21, 22) if (seen := finder.find(shown(eye, np.array(at), axes, seed))) is not None]

    found = placed_by_sheet(moved, laid, axes, at, eye.width, eye.height)

    assert len(moved) > 6
    assert found.field_of_view == pytest.approx(eye.field, abs=0.5)
    assert found.error < 0.5
    assert found.place == pytest.approx(eye.at, abs=0.008)
    assert (found.tilt, found.pan, found.roll) == pytest.approx((-eye.down, eye.left, eye.lean), abs=0.5)


def test_a_sheet_that_faces_the_camera_squarely_leaves_the_field_open_and_that_is_said():
    eye, finder = Eye(down=0, at=(0.05, 0.0, 1.17), width=640, height=480), SheetFinder()
    seen = [finder.find(shown(eye, np.array([0.7, 0.0, 1.17]), UPRIGHT, seed)) for seed in range(3)]
    laid = [each for each in seen if each is not None]

    assert len(laid) == 3
    with pytest.raises(RunFailed, match="how wide the camera sees"):
        placed_by_sheet([], laid, UPRIGHT, (0.7, 0.0, 1.17), 640, 480)


@pytest.mark.parametrize(("tilt", "pan", "field"), [(0.0, 0.0, 60.0), (-12.0, 8.0, 75.0), (9.0, -20.0, 50.0)])
def test_somebody_at_a_known_seat_tells_where_a_camera_looks_and_how_wide(tilt: float, pan: float, field: float):
    place, seat = (0.05, 0.02, 1.17), (1.2, 0.1, 1.25)
    camera, assumed = StatedCamera(field, place, tilt, pan), StatedCamera(60.0, place, 0.0, 0.0)
    [(u, v)] = camera.pixels(np.array([seat]), 640, 480)
    focal, true = assumed.focal(640), camera.focal(640)
    # A head is as far as it is small: with a shorter focal length it is taken for nearer, in the same ratio.
    line = np.array([(u - 320) / true, (v - 240) / true, 1.0])
    depth = math.dist(seat, place) / np.linalg.norm(line)
    head = np.array([(u - 320) / focal, (v - 240) / focal, 1.0]) * depth * focal / true

    heads = [MeasuredHead(head, np.array([0.0, 0.0, -1.0]), 0.0, 0.1, 0.1)] * 5
    found = placed_by_seat(heads, focal, seat, place, 640)

    assert found.field_of_view == pytest.approx(field, abs=0.1)
    assert (found.tilt, found.pan) == pytest.approx((tilt, pan), abs=0.1)
    assert found.beside < 0.5

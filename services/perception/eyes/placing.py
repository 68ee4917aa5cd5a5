"""Place of a camera, and how wide it sees, from pictures of a printed sheet, or of somebody at a known seat. Pure.

The sheet has twelve markers of ArUco. Held at a slant, nearer and farther, it tells how wide the camera sees: what is
twice as far is half as large, by as much as the field of view says. Laid at a known place it tells where the camera
is. Pictures in which it only faces the camera squarely leave the field of view open, and are refused.

Somebody at a known seat tells less: how far the face seems is how wide the camera sees, and where it is in the
picture is where the camera looks; its place has to be known, and that it hangs straight.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np

from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.units import Degrees, Meters, Vector
from engage_hri.services.perception.eyes.camera import StatedCamera
from engage_hri.services.perception.eyes.head_pose import MeasuredHead
from engage_hri.services.perception.eyes.looking import Floats
from engage_hri.services.perception.pictures import Image

ACROSS, DOWN = 4, 3
MARKER: Meters = 0.055
GAP: Meters = 0.012
CELLS = 6
"""Fields of a marker, its border too."""
STILL, OTHER = 1.5, 0.05
"""Pixels by which a sheet that lies still may move; share of the width of a picture by which one has to that is held
differently."""
HELD, LAID = 8, 10
"""Pictures of each kind that are enough."""
OPEN: Degrees = 1.0
"""Standard deviation of the field of view from which on it is not known."""
BEGINNINGS = 0.6, 1.0, 1.7
"""Focal lengths from which the search begins, in widths of the picture: fields of view from 80 to 33 degrees."""
LEAST = 4
"""Markers that have to be seen for a picture to count."""
FLAT = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""Axes of a sheet, in columns, that lies on a table, and reads upright from the robot: right, down, and into it."""
UPRIGHT = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""The same of one that stands, and faces the robot."""


class SeenSheet(NamedTuple):
    """The sheet in a picture. places: of corners of its markers, from its middle. pixels: the same in the picture."""

    places: Floats
    pixels: Floats


class PlacedCamera(NamedTuple):
    """A camera as it was found. error: standard deviation of its field of view. beside: of what it sees, pixels."""

    field_of_view: Degrees
    place: Vector
    tilt: Degrees
    pan: Degrees
    roll: Degrees
    error: Degrees
    beside: float


def _board() -> Any:
    dictionary = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    return cv2.aruco.GridBoard((ACROSS, DOWN), MARKER, GAP, dictionary)


def size() -> tuple[Meters, Meters]:
    """Width and height of the markers of the sheet together."""
    return ACROSS * (MARKER + GAP) - GAP, DOWN * (MARKER + GAP) - GAP


def sheet() -> str:
    """Draw the sheet as SVG: A4, on its side, in millimetres."""
    wide, tall = (1000 * each for each in size())
    left, top, cell = (297 - wide) / 2, (210 - tall) / 2 - 3, 1000 * MARKER / CELLS
    rows = [
        '<svg xmlns="http://www.w3.org/2000/svg" width="297mm" height="210mm" viewBox="0 0 297 210">',
        '<rect width="297" height="210" fill="white"/>',
    ]
    board = _board()
    for number, corners in zip(board.getIds().ravel(), board.getObjPoints(), strict=True):
        cells = cv2.aruco.generateImageMarker(board.getDictionary(), int(number), CELLS)
        x, y = left + 1000 * float(corners[0][0]), top + 1000 * float(corners[0][1])
        for row, column in zip(*np.nonzero(cells == 0), strict=True):
            # A hair larger, lest a white line shows between two of them.
            rows.append(
                f'<rect x="{x + column * cell:.3f}" y="{y + row * cell:.3f}" width="{cell + 0.02:.3f}" '
                f'height="{cell + 0.02:.3f}"/>'
            )
    rows += [
        f'<path d="M{left:.1f} 203h100m0 -2v4m-100 0v-4" stroke="black" stroke-width="0.4" fill="none"/>',
        f'<text x="{left + 103:.1f}" y="204.5" font-size="4">100 mm: print it without scaling. '
        "This edge is the near one, or the lower.</text>",
        "</svg>",
    ]
    return "\n".join(rows) + "\n"


class SheetFinder:
    """Finds the sheet in pictures."""

    def __init__(self) -> None:
        self._board = _board()
        settings = cv2.aruco.DetectorParameters()
        settings.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
        self._detector = cv2.aruco.ArucoDetector(self._board.getDictionary(), settings)

    def find(self, image: Image) -> SeenSheet | None:
        """Find it; None: too little of it is seen."""
        found, ids, _ = self._detector.detectMarkers(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))
        if ids is None or len(ids) < LEAST:
            return None
        places, pixels = self._board.matchImagePoints(found, ids)
        if places is None or len(places) < 4 * LEAST:
            return None
        middle = np.array([*size(), 0.0]) / 2
        return SeenSheet(places.reshape(-1, 3) - middle, pixels.reshape(-1, 2) + 0.5)  # OpenCV counts by middles


class SheetViews:
    """The pictures of a sheet that is moved to and fro, and then laid down.

    moved: some in which it is held differently. laid: the last ones, since it lies still.
    """

    def __init__(self, width: int) -> None:
        """width: of the pictures, pixels."""
        self._width = width
        self.moved: list[SeenSheet] = []
        self.laid: list[SeenSheet] = []

    @property
    def are_enough(self) -> bool:
        """True if it was held differently often enough, and lies still for long enough."""
        return len(self.moved) > HELD and len(self.laid) >= LAID

    def feed(self, seen: SeenSheet) -> None:
        """Take what is seen in the next picture."""
        if self.laid and _moved(self.laid[-1], seen) > STILL:
            self.laid = []
        self.laid.append(seen)
        if all(_moved(other, seen) > OTHER * self._width for other in self.moved):
            self.moved.append(seen)


def _moved(one: SeenSheet, other: SeenSheet) -> float:
    """Distance by which the sheet has moved, pixels, by the markers that both pictures show."""
    pixels = {tuple(np.round(place, 4)): pixel for place, pixel in zip(one.places, one.pixels, strict=True)}
    both = [
        pixels[key] - pixel
        for place, pixel in zip(other.places, other.pixels, strict=True)
        if (key := tuple(np.round(place, 4))) in pixels
    ]
    return float(np.linalg.norm(both, axis=1).max()) if both else math.inf


class _Calibrated(NamedTuple):
    """Focal length in pixels, with its deviation; turns and shifts of the sheet in each picture; pixels it is off."""

    focal: float
    spread: float
    turns: Sequence[Any]
    shifts: Sequence[Any]
    beside: float


def _calibrated(views: Sequence[SeenSheet], width: int, height: int, begin: float) -> _Calibrated:
    """Fit a camera to pictures of the sheet. begin: the focal length from which the search begins, in pixels."""
    start = np.array([[begin, 0, width / 2], [0, begin, height / 2], [0, 0, 1]], float)
    flags = (
        cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_FIX_PRINCIPAL_POINT | cv2.CALIB_FIX_ASPECT_RATIO
        | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_FIX_K3
    )  # fmt: skip
    beside, matrix, _, turns, shifts, spreads, _, _ = cv2.calibrateCameraExtended(
        [view.places.astype(np.float32) for view in views], [view.pixels.astype(np.float32) for view in views],
        (width, height), start, np.zeros(5), flags=flags,
    )  # fmt: skip
    spread = float(spreads.ravel()[:2].max())  # one of the two is held to the other
    return _Calibrated(float(matrix[0, 0]), spread, turns, shifts, float(beside))


def placed_by_sheet(
    moved: Sequence[SeenSheet], laid: Sequence[SeenSheet], axes: Floats, at: Vector, width: int, height: int
) -> PlacedCamera:
    """Find a camera by its pictures of the sheet. moved: held anywhere; laid: at its place, with these axes.

    Raises RunFailed: they leave open how wide it sees.
    """
    # Where pictures leave the focal length open, each beginning of the search ends elsewhere, and each is sure of it.
    found = [_calibrated([*moved, *laid], width, height, begin * width) for begin in BEGINNINGS]
    fields = [_field(each.focal, width) if each.focal > 0 else math.inf for each in found]
    focal, spread, turns, shifts, beside = found[1]
    error = _field(focal, width) - _field(focal + spread, width) if focal > 0 and spread > 0 else math.inf
    if error > OPEN or not max(fields) - min(fields) <= OPEN:
        advice = "before it is laid down hold it at a slant, to all sides, nearer and farther"
        raise RunFailed(Fault(reason="these pictures leave open how wide the camera sees", advice=advice))
    placed, directions = [], []
    for turn, shift in zip(turns[len(moved) :], shifts[len(moved) :], strict=True):
        rotation = cv2.Rodrigues(turn)[0]
        placed.append(axes @ (-rotation.T @ shift.ravel()) + at)
        directions.append(axes @ rotation.T)
    u, _, v = np.linalg.svd(np.mean(directions, 0))
    return _stated(np.mean(placed, 0), u @ v, _field(focal, width), error, beside)


def placed_by_seat(
    heads: Sequence[MeasuredHead], focal: float, seat: Vector, place: Vector, width: int
) -> PlacedCamera:
    """Find where a camera at a place looks, and how wide, by a head that is at the seat.

    heads: as they were measured with this focal length, pixels.
    """
    # With a focal length that is k times as long a head is taken for k times as far, and as far aside as before.
    x, y, z = np.median([head.place for head in heads], 0)
    away = math.dist(seat, place)
    stretch = math.sqrt(max(away**2 - x**2 - y**2, 1e-6)) / z
    z *= stretch
    distances = np.array([head.distance for head in heads])
    spread = float(distances.std() / distances.mean())
    goal = np.array(seat) - place
    seen = np.array([x, y, z]) / np.linalg.norm([x, y, z])
    goal /= np.linalg.norm(goal)
    # Without roll: up in the picture is -(cos t) y + (sin t) z of the camera.
    tilt = math.asin(goal[2] / math.hypot(seen[1], seen[2])) + math.atan2(seen[1], seen[2])
    ahead = math.cos(tilt) * seen[2] + math.sin(tilt) * seen[1]
    pan = math.atan2(goal[1], goal[0]) + math.atan2(seen[0], ahead)
    camera = StatedCamera(90.0, place, math.degrees(tilt), math.degrees(pan))
    beside = math.acos(float(np.clip(np.array(camera.direction(seen)) @ goal, -1, 1)))
    made = _field(focal * stretch, width)
    error = made - _field(focal * stretch * (1 + spread), width)
    return PlacedCamera(made, place, math.degrees(tilt), math.degrees(pan), 0.0, error, focal * beside)


def _stated(place: Floats, axes: Floats, field: Degrees, error: Degrees, beside: float) -> PlacedCamera:
    """Say where a camera is by tilt, pan and roll. axes: right, down and ahead, in columns."""
    right, down, ahead = axes.T
    tilt, pan = math.asin(float(np.clip(ahead[2], -1, 1))), math.atan2(ahead[1], ahead[0])
    level = np.array([math.sin(pan), -math.cos(pan), 0.0])
    roll = math.atan2(-float(down @ level), float(right @ level))
    x, y, z = place.tolist()
    return PlacedCamera(field, (x, y, z), math.degrees(tilt), math.degrees(pan), math.degrees(roll), error, beside)


def _field(focal: float, width: int) -> Degrees:
    return math.degrees(2 * math.atan(width / 2 / focal))

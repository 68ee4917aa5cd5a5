"""Head of a person from the points of a face: where it is, where it faces, how sure that is. Pure.

A rigid face is laid onto the points as a camera would see it (perspective-n-point): the rotation and the place at
which its points, weighted by how well each is known, are nearest to those of the picture. Mouth and chin move, and
are left out. The face is not that of one person, so yaw and pitch have an error that grows away from the camera's
axis; the table has what was left over of both for people of whom the face knew nothing.

The face and the table are in `average_face.npz`: `python -m tests.perception.eyes.learning` makes it from rendered
people, with what this file does not know of a head before a camera.
"""

from functools import cache
from importlib.resources import files
from math import hypot
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.units import Meters, Radians
from engage_hri.services.perception.eyes.looking import Floats

TURNS = 4
"""Steps of Gauss and Newton: the last one changes nothing any more."""
UPPER_LIP, LOWER_LIP, FOREHEAD, CHIN = 13, 14, 10, 152
AHEAD = np.array([0.0, 0.0, -1.0])
"""Direction of the nose of a face that looks into the camera."""


class AverageFace(NamedTuple):
    """A face. points: in the axes of a camera that it faces, from between the eyes, metres. weights: of each point;
    0: it moves. errors: coefficients of the standard deviation of yaw and of pitch (`spread`)."""

    points: Floats
    weights: Floats
    errors: Floats


class Head(NamedTuple):
    """A head in camera axes. place: between the eyes, metres. rotation: from a face that looks along the axis.

    mouth: gap between the lips as a share of the height of the face. yaw_spread, pitch_spread: standard deviations.
    """

    place: Floats
    rotation: Floats
    mouth: float
    yaw_spread: Radians
    pitch_spread: Radians

    @property
    def ahead(self) -> Floats:
        """Direction of the nose."""
        return np.asarray(self.rotation @ AHEAD)

    @property
    def distance(self) -> Meters:
        return float(np.linalg.norm(self.place))


@cache
def average_face() -> AverageFace:
    """Load the face. It comes with this package."""
    with (files(__package__ or "") / "average_face.npz").open("rb") as file, np.load(file) as kept:
        return AverageFace(kept["points"] / 1e5, kept["weights"] / 100, kept["errors"] / 1.0)


def head(points: Floats, width: int, height: int, focal: float, face: AverageFace | None = None) -> Head | None:
    """Find the head to which points belong; None: these are no points of a face.

    points: x, y and depth of each, pixels. width, height: of the picture. focal: of its camera, pixels. face: None:
    the average one.
    """
    face = face or average_face()
    used = face.weights > 0
    model, weights = face.points[used], face.weights[used]
    seen = (points[:, :2] - [width / 2, height / 2]) / focal
    rotation, place = _start(model, weights, seen[used], points[used, 2] / focal)
    for _ in range(TURNS):
        turned = model @ rotation.T
        at = turned + place
        if at[:, 2].min() < 0.05:
            return None
        flat = at[:, :2] / at[:, 2:]
        slope = np.zeros((len(at), 2, 3))
        slope[:, 0, 0] = slope[:, 1, 1] = 1 / at[:, 2]
        slope[:, :, 2] = -flat / at[:, 2:]
        rows = np.concatenate([slope @ -_crossing(turned), slope], axis=2) * weights[:, None, None]
        left = ((seen[used] - flat) * weights[:, None]).reshape(-1)
        rows = rows.reshape(-1, 6)
        step = np.linalg.solve(rows.T @ rows, rows.T @ left)
        rotation, place = turn(np.asarray(step[:3])) @ rotation, place + step[3:]
    gap = float(np.linalg.norm(points[UPPER_LIP] - points[LOWER_LIP]))
    tall = float(np.linalg.norm(points[FOREHEAD] - points[CHIN]))
    return Head(place, rotation, gap / max(tall, 1e-6), *spread(rotation, place, focal, face.errors))


def spread(rotation: Floats, place: Floats, focal: float, errors: Floats) -> tuple[Radians, Radians]:
    """Standard deviations of yaw and pitch. errors: a row for each of both, of what `features` tells."""
    yaw, pitch = errors @ features(rotation, place, focal)
    return max(float(yaw), 0.01), max(float(pitch), 0.01)


def features(rotation: Floats, place: Floats, focal: float) -> Floats:
    """What the error depends on: nothing, how far the head is turned from the line of sight, how small it is."""
    sight = -place / np.linalg.norm(place)
    beside = float(np.arccos(np.clip(rotation @ AHEAD @ sight, -1, 1)))
    return np.array([1.0, beside, float(place[2]) / focal * 100])


def turn(by: Floats) -> Floats:
    """Rotation about an axis by its length in radians (Rodrigues)."""
    angle = float(np.linalg.norm(by))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = by / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def yaw_pitch(direction: Floats) -> tuple[Radians, Radians]:
    """Angles of a direction in camera axes: to the right of the picture and up, from that into the camera."""
    x, y, z = direction
    return float(np.arctan2(x, -z)), float(np.arctan2(-y, hypot(x, z)))


def _start(model: Floats, weights: Floats, seen: Floats, depth: Floats) -> tuple[Floats, Floats]:
    """A first guess: the points with their depths, as if from far away, then turned to the line of sight."""
    share = (weights / weights.sum())[:, None]
    cloud = np.column_stack([seen, depth])
    middle, centre = (share * cloud).sum(0), (share * model).sum(0)
    mixed = ((cloud - middle) * share).T @ (model - centre)
    u, _, v = np.linalg.svd(mixed)
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
    size = np.sqrt(
        (share[:, 0] * ((model - centre) ** 2).sum(1)).sum() / (share[:, 0] * ((cloud - middle) ** 2).sum(1)).sum()
    )
    sight = np.array([middle[0], middle[1], 1.0])
    axis = np.cross([0.0, 0.0, 1.0], sight / np.linalg.norm(sight))
    rotation = turn(axis) @ rotation
    return rotation, size * sight - rotation @ centre


def _crossing(points: NDArray[np.float64]) -> Floats:
    """Matrices that take the cross product with each of some points."""
    made = np.zeros((len(points), 3, 3))
    made[:, 0, 1], made[:, 0, 2], made[:, 1, 2] = -points[:, 2], points[:, 1], -points[:, 0]
    made[:, 1, 0], made[:, 2, 0], made[:, 2, 1] = points[:, 2], -points[:, 1], points[:, 0]
    return made

"""Head of a person from the points of a face: where it is, where it faces, how sure that is. Pure.

A rigid face is laid onto the points as a camera would see it (perspective-n-point): the rotation and the place at
which its points, weighted by how well each is known, are nearest to those of the picture. Mouth and chin move, and
are left out. Nobody has the average face, and who finds the points draws them towards the usual one, so a face that
is laid onto them is beside the truth, most in pitch. By how much can be told from what is left over: how far each
point, and its depth, is beside that of the face. So yaw and pitch are mended by that, as it was in rendered people.
What is wrong even then of those among them from whom it was not learned, by how far a head is turned, is the spread.

The face, what mends it and the spread are in `average_face.npz`, which `python -m tests.perception.eyes.learning`
makes from rendered people.
"""

from functools import cache
from importlib.resources import files
from math import cos, hypot, pi, sin
from typing import NamedTuple

import numpy as np

from engage_hri.schemas.units import Meters, Radians
from engage_hri.services.perception.eyes.looking import Floats

MOST_STEPS = 8
"""Steps of Gauss and Newton."""
SMALL = 5e-3
"""Step, in radians and metres, after which the next would change nothing."""
SMALLEST = 8
"""Pixels that a face has to be wide and high."""
LEARNED: Radians = 0.8
"""Angle from the line of sight up to which the mending was learned."""
MOST_BESIDE = 30.0
"""Millimetres by which a point is beside that of the face at most: hardly one of 1000 is."""
LEAST_SPREAD, MOST_SPREAD = 0.01, pi / 4
UPPER_LIP, LOWER_LIP, FOREHEAD, CHIN = 13, 14, 10, 152
AHEAD = np.array([0.0, 0.0, -1.0])
"""Direction of the nose of a face that looks into the camera."""


class AverageFace(NamedTuple):
    """A face. points: in the axes of a camera that it faces, from between the eyes, metres. weights: of each point;
    0: it moves. mends: coefficients of what is added to yaw and pitch, by `LaidFace.signs`. errors: of their standard
    deviations."""

    points: Floats
    weights: Floats
    mends: Floats
    errors: Floats


class MeasuredHead(NamedTuple):
    """A head in camera axes. place: between the eyes, metres. ahead: direction of the nose, of length 1.

    mouth: gap between the lips as a share of the height of the face. yaw_spread, pitch_spread: standard deviations.
    """

    place: Floats
    ahead: Floats
    mouth: float
    yaw_spread: Radians
    pitch_spread: Radians

    @property
    def distance(self) -> Meters:
        return float(np.linalg.norm(self.place))


@cache
def average_face() -> AverageFace:
    """Load the face. It comes with this package."""
    with (files(__package__ or "") / "average_face.npz").open("rb") as file, np.load(file) as kept:
        return AverageFace(kept["points"] / 1e5, kept["weights"] / 100, kept["mends"], kept["errors"])


def head(
    points: Floats, width: int, height: int, focal: float, face: AverageFace | None = None
) -> MeasuredHead | None:
    """Find the head to which points belong; None: these are no points of a face.

    points: x, y and depth of each, pixels. width, height: of the picture. focal: of its camera, pixels. face: None:
    the average one.
    """
    face = face or average_face()
    laid = solved(points, width, height, focal, face)
    if laid is None:
        return None
    yaw, pitch = laid.angles + face.mends @ laid.signs
    gap = float(np.linalg.norm(points[UPPER_LIP] - points[LOWER_LIP]))
    tall = float(np.linalg.norm(points[FOREHEAD] - points[CHIN]))
    spread = np.clip(face.errors @ laid.features, LEAST_SPREAD, MOST_SPREAD).tolist()
    return MeasuredHead(laid.place, direction(yaw, pitch), gap / max(tall, 1e-6), *spread)


class LaidFace(NamedTuple):
    """A face on the points of a picture. place: of the head. angles: yaw and pitch.

    signs: what mends these: angles from the line of sight, their squares, and how far each point is beside that of
    the face, in the axes of the head, millimetres. features: what their error depends on: nothing, and how far the
    head is turned from the line of sight.
    """

    place: Floats
    angles: Floats
    signs: Floats
    features: Floats


def solved(points: Floats, width: int, height: int, focal: float, face: AverageFace) -> LaidFace | None:
    """Lay a face onto points, as in `head`, and mend nothing."""
    used = face.weights > 0
    model, weights = face.points[used], face.weights[used]
    seen = (points[used, :2] - [width / 2, height / 2]) / focal
    if np.ptp(seen, axis=0).min() < SMALLEST / focal:
        return None
    depth = points[used, 2] / focal
    rotation, place = _start(model, weights, seen, depth)
    for _ in range(MOST_STEPS):
        turned = model @ rotation.T
        at = turned + place
        if at[:, 2].min() < 0.05:
            return None
        rows, left = _equations(turned, at, seen, weights)
        step = np.linalg.solve(rows.T @ rows, rows.T @ left)
        rotation, place = turn(np.asarray(step[:3])) @ rotation, place + step[3:]
        if np.abs(step).max() < SMALL:
            break
    ahead = rotation @ AHEAD
    angles = np.array(yaw_pitch(ahead))
    a, b = np.clip(angles - yaw_pitch(-place), -LEARNED, LEARNED)
    beside = _beside(model @ rotation.T, place, weights, seen, depth) @ rotation
    signs = np.hstack([1.0, a, b, a * a, b * b, a * b, beside.ravel()])
    turned_by = float(np.arccos(np.clip(-ahead @ place / np.linalg.norm(place), -1, 1)))
    return LaidFace(place, angles, signs, np.array([1.0, turned_by]))


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


def direction(yaw: Radians, pitch: Radians) -> Floats:
    """Direction of length 1 with these angles (`yaw_pitch`)."""
    return np.array([sin(yaw) * cos(pitch), -sin(pitch), -cos(yaw) * cos(pitch)])


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


def _equations(turned: Floats, at: Floats, seen: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Slopes of where points are seen by a turn and a move of the face, and how far they are from there.

    turned: points of the face after its rotation. at: in camera axes. seen: on a plane at distance 1.
    """
    (x, y, z), (u, v) = turned.T, at[:, :2].T / at[:, 2]
    rows = np.zeros((6, 2, len(at)))
    rows[0, 0], rows[1, 0], rows[2, 0], rows[3, 0], rows[5, 0] = -u * y, z + u * x, -y, 1.0, -u
    rows[0, 1], rows[1, 1], rows[2, 1], rows[4, 1], rows[5, 1] = -z - v * y, v * x, x, 1.0, -v
    rows *= weights / at[:, 2]
    left = (seen.T - np.stack([u, v])) * weights
    return rows.reshape(6, -1).T, left.reshape(-1)


def _beside(turned: Floats, place: Floats, weights: Floats, seen: Floats, depth: Floats) -> Floats:
    """Distances of points from those of a face that was laid onto them, in camera axes, millimetres.

    turned, place, seen: as above. depth: of each point from all of them, on that plane.
    """
    at = turned + place
    flat = seen * at[:, 2:] - at[:, :2]
    deep = depth * place[2] - turned[:, 2]
    beside = np.column_stack([flat, deep - np.average(deep, weights=weights)]) * 1000
    return np.asarray(np.clip(beside, -MOST_BESIDE, MOST_BESIDE))

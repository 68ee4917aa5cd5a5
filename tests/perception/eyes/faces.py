"""Faces without pictures: the points that a camera sees of the average face, wherever it is."""

from collections.abc import Callable, Iterable
from pathlib import Path

import numpy as np

from engage_hri.schemas import keys
from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.perception.eyes.camera import StatedCamera
from engage_hri.services.perception.eyes.head_pose import average_face
from engage_hri.services.perception.eyes.looking import Floats, packed
from tests.perception.eyes.people import Pose
from tests.recording.files import sample, saved

WIDTH, HEIGHT = 640, 480
FOCAL = StatedCamera(60.0, (0.0, 0.0, 0.0), 0.0, 0.0).focal(WIDTH)
Heads = Callable[[Seconds], Iterable[Pose]]
"""Who is where, by time."""


def points(pose: Pose, noise: float = 0.0, seed: int = 0) -> Floats:
    """Points of a head as a camera of 60 degrees has them, pixels. noise: their standard deviation."""
    at = average_face().points @ pose.rotation.T + pose.at
    flat = at[:, :2] / at[:, 2:] * FOCAL + [WIDTH / 2, HEIGHT / 2]
    depth = (at[:, 2:] - pose.at[2]) / pose.at[2] * FOCAL
    return np.hstack([flat, depth]) + np.random.default_rng(seed).normal(0, noise, (len(at), 3))


def landmarks(poses: Iterable[Pose], at: Seconds, noise: float = 0.0) -> FaceLandmarks:
    """What a source tells of these heads."""
    faces = tuple(packed(points(pose, noise, round(at * 1000) + n)) for n, pose in enumerate(poses))
    return FaceLandmarks(at=Stamp("loop", at), width=WIDTH, height=HEIGHT, faces=faces)


def recorded(path: Path, heads: Heads, seconds: Seconds, rate: float = 15.0, noise: float = 0.3) -> Path:
    """A recording of a source that has seen these heads."""
    times = [number / rate for number in range(round(seconds * rate))]
    told = [landmarks(heads(at), at, noise) for at in times]
    return saved(path, [sample(keys.landmarks("eyes"), each, at) for each, at in zip(told, times, strict=True)])

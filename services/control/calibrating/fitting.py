"""Fit of a calibration to measurements: offsets of joints by least squares, and how far off the rays are then. Pure.

A measurement says where a part pointed, by the angles that its joints measured, and a place at which it really
pointed. The offsets of its joints are those with which the body's own geometry comes nearest to all these places
(Gauss and Newton, from zero). A weak belief that offsets are small decides between offsets that the measurements
cannot tell apart, such as two joints that turn the forearm alike.
"""

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.body import BodyPose, JointAngle, Ray
from engage_hri.schemas.units import Degrees, Radians, Vector

Geometry = Callable[[BodyPose], Ray | None]
"""Ray of a part by the angles of all joints; None: not known."""
Array = NDArray[np.float64]

UNLIKELY: Radians = math.radians(5.0)
"""Standard deviation of the belief about an offset."""
MEASURED: Radians = math.radians(0.3)
"""Standard deviation of a measured direction, against which that belief is weighed."""
STEP: Radians = 1e-5
ROUNDS = 20
COVERED = 0.95
"""Share of the looks or points that lie within the error that is stated."""
LEAST: Degrees = 0.1
"""Least error that is stated: nobody tells smaller ones with people and tape measures."""


class Measurement(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One look or point, as it was meant and as it was.

    part: head, left_arm or right_arm. joints: degrees that the joints measured, all of them. said: where the body
    says that it looked or pointed. seen: a place in metres, in the robot's frame, at which it really did.
    """

    part: str
    joints: Mapping[str, Degrees]
    said: Ray
    seen: Vector

    @property
    def pose(self) -> BodyPose:
        return BodyPose(
            joints=tuple([JointAngle(joint, math.radians(angle)) for joint, angle in self.joints.items()])
        )


class Fit(Struct, frozen=True, kw_only=True):
    """A fit to the measurements of one part.

    offsets: by joint. error: within which `COVERED` of new ones will be; inf: too few measurements to say. before,
    after: the mean square root of the angles beside without the offsets and with them, and the greatest of them.
    """

    part: str
    number: int
    offsets: Mapping[str, Degrees]
    error: Degrees
    before: tuple[Degrees, Degrees]
    after: tuple[Degrees, Degrees]


def fit(part: str, measurements: Sequence[Measurement], geometry: Geometry, joints: Sequence[str]) -> Fit:
    """Fit the offsets of these joints to measurements of one part.

    Without joints, or where the geometry is not known, there are no offsets, and what the body says counts.
    Raises ValueError: there is no measurement.
    """
    if not measurements:
        raise ValueError(f"no measurement of the {part}")
    joints = joints if geometry(measurements[0].pose) is not None else ()
    offsets = np.zeros(len(joints))
    for _ in range(ROUNDS if joints else 0):
        off, slope = _off(measurements, geometry, joints, offsets), _slope(measurements, geometry, joints, offsets)
        step = np.linalg.solve(_normal(slope), -(slope.T @ off) - _belief(joints) @ offsets)
        offsets = offsets + step
        if float(np.max(np.abs(step))) < 1e-10:
            break
    before, after = (_off(measurements, geometry, joints, each) for each in (np.zeros(len(joints)), offsets))
    return Fit(
        part=part, number=len(measurements),
        offsets={joint: math.degrees(offset) for joint, offset in zip(joints, offsets.tolist(), strict=True)},
        error=_error(after, _slope(measurements, geometry, joints, offsets)),
        before=_summary(before), after=_summary(after),
    )  # fmt: skip


def _off(measurements: Sequence[Measurement], geometry: Geometry, joints: Sequence[str], offsets: Array) -> Array:
    """Radians by which the rays with these offsets miss the places that were seen: two across each ray."""
    return np.concatenate([_beside(_ray(each, geometry, joints, offsets), each.seen) for each in measurements])


def _ray(measured: Measurement, geometry: Geometry, joints: Sequence[str], offsets: Array) -> Ray:
    if not joints:
        return measured.said
    by = dict(zip(joints, offsets.tolist(), strict=True))
    pose = BodyPose(
        joints=tuple([JointAngle(each.joint, each.angle + by.get(each.joint, 0.0)) for each in measured.pose.joints])
    )
    ray = geometry(pose)
    assert ray is not None, "asked before"
    return ray


def _beside(ray: Ray, seen: Vector) -> Array:
    """Angles from the axis of a ray to a place, to the left and up; as long as the angle between them."""
    axis, way = np.asarray(ray.axis, dtype=float), np.subtract(seen, ray.origin)
    axis, way = axis / np.linalg.norm(axis), way / np.linalg.norm(way)
    left = np.cross((0.0, 0.0, 1.0), axis)
    left = left / np.linalg.norm(left) if np.linalg.norm(left) > 1e-6 else np.array((0.0, 1.0, 0.0))
    up = np.cross(axis, left)
    across = np.array((float(way @ left), float(way @ up)))
    length, angle = float(np.linalg.norm(across)), math.atan2(float(np.linalg.norm(across)), float(way @ axis))
    return across if length < 1e-12 else across * (angle / length)


def _slope(measurements: Sequence[Measurement], geometry: Geometry, joints: Sequence[str], offsets: Array) -> Array:
    columns = []
    for number in range(len(joints)):
        step = np.zeros(len(joints))
        step[number] = STEP
        ahead, behind = (_off(measurements, geometry, joints, offsets + each) for each in (step, -step))
        columns.append((ahead - behind) / (2 * STEP))
    return np.stack(columns, axis=1) if columns else np.zeros((2 * len(measurements), 0))


def _belief(joints: Sequence[str]) -> Array:
    return np.eye(len(joints)) * (MEASURED / UNLIKELY) ** 2


def _normal(slope: Array) -> Array:
    return slope.T @ slope + np.eye(slope.shape[1]) * (MEASURED / UNLIKELY) ** 2


def _error(off: Array, slope: Array) -> Degrees:
    """Degrees within which `COVERED` of new measurements will be.

    Each residual is taken as if its own measurement had not been there (its leverage is taken out), so that a fit to
    few measurements is not taken for a good one.
    """
    angles, freedom = [], len(off) - slope.shape[1]
    if freedom <= 0:
        return math.inf
    hat = slope @ np.linalg.solve(_normal(slope), slope.T) if slope.shape[1] else np.zeros((len(off), len(off)))
    for at in range(0, len(off), 2):
        alone = np.linalg.solve(np.eye(2) - hat[at : at + 2, at : at + 2], off[at : at + 2])
        angles.append(float(np.linalg.norm(alone)))
    variance = sum(angle * angle for angle in angles) / len(off)
    # Quantile of F with 2 and `freedom` degrees of freedom: two directions, and a spread that is itself estimated.
    quantile = freedom / 2 * ((1.0 - COVERED) ** (-2.0 / freedom) - 1.0)
    # Near places are measured worse, in degrees, than far ones: no less than the worst is stated.
    return max(LEAST, math.degrees(max(math.sqrt(2.0 * variance * quantile), *angles)))


def _summary(off: Array) -> tuple[Degrees, Degrees]:
    angles = np.linalg.norm(off.reshape(-1, 2), axis=1)
    return math.degrees(float(np.sqrt(np.mean(angles**2)))), math.degrees(float(np.max(angles)))

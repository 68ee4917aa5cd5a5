"""Calibration of a body: where it really looks and points is measured, and offsets of its joints are fitted to that.

A measurement says where a part pointed, by the angles that its joints measured, and a place at which it really
pointed. The offsets of its joints are those with which the body's own geometry comes nearest to all these places
(Gauss and Newton, from zero). A weak belief that offsets are small decides between offsets that the measurements
cannot tell apart, such as two joints that turn the forearm alike.
"""

import math
from collections.abc import AsyncGenerator, Callable, Collection, Mapping, Sequence
from contextlib import aclosing
from math import degrees
from typing import Protocol

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.behaviors import Gaze, Hand, Pointing
from engage_hri.schemas.body import BodyPose, JointAngle, Ray
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Degrees, Meters, Radians, Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.contract.body import (
    Arrived,
    BehaviorRefused,
    Body,
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    within,
)

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


# -- measuring -------------------------------------------------------------------------------------------------------

ON_TARGET = "stroke"
"""The last point that a look or a point may pass: it stands on its target from then on."""
HANDS: dict[str, Hand] = {"left_arm": "LEFT_HAND", "right_arm": "RIGHT_HAND"}
TABLE: Meters = 0.73
"""Height of the marks on the table."""
COLUMNS: tuple[Meters, ...] = (-0.45, -0.3, -0.15, 0.0, 0.15, 0.3, 0.45)
ROWS: tuple[Meters, ...] = (0.38, 0.52, 0.66)
FACES: tuple[Vector, ...] = ((1.3, -0.4, 1.2), (1.3, 0.0, 1.3), (1.3, 0.4, 1.2))
OTHER_ROWS: tuple[Meters, ...] = (0.45, 0.59)
PATIENCE: Seconds = 10.0
"""Seconds that nothing may come of a look or a point, besides `SLOWEST` times what all of it takes."""
SLOWEST = 30.0
HOME: Seconds = 60.0
"""Seconds in which a body comes home."""


class Stuck(Exception):
    """A look or a point that does not go on; the message says why it is believed to be."""


class Eyes(Protocol):
    """Source of where a part really looks or points."""

    async def place(self, part: str, mark: Entity, state: BodyState) -> Vector | None:
        """A place in metres at which it really does; None: they cannot say. state: what the body measures."""


class SimulatedEyes:
    """Eyes of a simulation, which see the truth but for a spread. spread: standard deviation along each axis."""

    def __init__(self, body: Body, spread: Meters, seed: int = 0) -> None:
        self._body = body
        self._spread = spread
        self._chance = np.random.default_rng(seed)

    async def place(self, part: str, mark: Entity, state: BodyState) -> Vector | None:
        seen = self._body.seen() or state
        ray: Ray | None = seen.gaze if part == "head" else getattr(seen, part)
        if ray is None:
            return None
        origin, axis = np.asarray(ray.origin), np.asarray(ray.axis)
        place = origin + axis * np.linalg.norm(np.subtract(mark.position, origin))
        x, y, z = (place + self._chance.normal(0.0, self._spread, 3)).tolist()
        return (x, y, z)


def marks(rows: Sequence[Meters] = ROWS, faces: Sequence[Vector] = FACES) -> World:
    """Marks in a grid on the table, and some where faces would be."""
    places = [*((x, y, TABLE) for x in rows for y in COLUMNS), *faces]
    return World(
        entities=tuple([Entity(id=f"mark-{n}", kind="object", position=place) for n, place in enumerate(places, 1)])
    )


async def measured(
    body: Body, world: World, parts: Collection[str], eyes: Eyes, tell: Callable[[str], None]
) -> list[Measurement]:
    """Make the body look and point at all of the world that it can reach; returns where it really did.

    parts: head, left_arm, right_arm. tell: told what could not be done. A part that gets stuck is measured no
    further. Raises BodyFailed: it does not come home.
    """
    body.see(world)
    found: list[Measurement] = []
    await _home(body)
    try:
        for part in parts:
            try:
                for mark in world.objects:
                    measurement = await _one(body, world, part, mark, eyes, tell)
                    found += [measurement] if measurement is not None else []
            except Stuck as stuck:
                tell(f"{stuck}; the {part} is measured no further")
    finally:
        await _home(body)
    return found


async def _home(body: Body) -> None:
    try:
        await within(HOME, body.home())
    except TimeoutError as late:
        reason = f"it is not in its safe pose {HOME:g} s after it was told to go there"
        raise BodyFailed(Fault(reason=reason, where="home", service="control")) from late


async def _one(
    body: Body, world: World, part: str, mark: Entity, eyes: Eyes, tell: Callable[[str], None]
) -> Measurement | None:
    behavior: Gaze | Pointing = Gaze(id=f"look-{mark.id}", target=mark.id)
    if part != "head":
        behavior = Pointing(id=f"point-{mark.id}", target=mark.id, mode=HANDS[part])
    estimate = body.estimate(behavior, None, world)
    if not estimate.feasible:
        return None
    planned = sum(phase.natural for phase in estimate.phases)
    authority, found = MovementAuthority(behavior, ON_TARGET), None
    try:
        async with aclosing(body.perform(behavior, authority)) as stream:
            while (progress := await _next(stream, planned, f"{part} at {mark.id}")) is not None:
                if isinstance(progress, Arrived):
                    state = body.state()
                    said = state.gaze if part == "head" else getattr(state, part)
                    if said is not None and (seen := await eyes.place(part, mark, state)) is not None:
                        joints = {angle.joint: degrees(angle.angle) for angle in state.pose.joints}
                        found = Measurement(part=part, joints=joints, said=said, seen=seen)
                    authority.extend("end")
    except (BehaviorRefused, BodyFailed) as error:
        tell(f"{part} at {mark.id}: {error}")
    return found


async def _next(stream: AsyncGenerator[Progress, None], planned: Seconds, what: str) -> Progress | None:
    """The next progress of a behavior; None: it is over. planned: seconds that it takes. Raises Stuck."""
    limit = PATIENCE + SLOWEST * planned
    try:
        return await within(limit, anext(stream, None))
    except TimeoutError as late:
        raise Stuck(f"{what}: nothing has come of it for {limit:.0f} s; {planned:.1f} s were planned") from late

"""Joint angles that look or point at a place, on any model: damped least squares within the limits of the joints.

The Jacobian is exact: each joint turns what hangs on it about its axis. The arithmetic is checked against finite
differences in a test.
"""

import math
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.body import Ray
from engage_hri.schemas.units import Meters, Radians, Vector
from engage_hri.services.control.mujoco.robot import Place
from engage_hri.services.runtime.steps import Steps

Array = NDArray[np.float64]

ROUNDS = 30
ELEMENTS = 128
"""Elements that a round counts for (see `steps`)."""
DAMPING = 1e-4
LONGEST_STEP: Radians = 0.5
NO_STEP: Radians = 2e-4
POSTURE = 0.2
"""Share of the way to the preferred pose that a step takes, as far as the aim leaves it open."""
KEPT: Meters = 0.001
"""Kept above the least height and distance: there a solution may swing."""
WEIGHT = 3.0
"""Weight of a metre against a radian."""
MARGIN: Radians = math.radians(1.0)
"""Kept free before the limits of joints."""
ON_AXIS: Radians = math.radians(0.3)
"""An aim that is off by more has not come out."""


class Solution(Struct, frozen=True):
    """angles: of the chain's joints. off: radians between the axis and the direction of the target. low: metres by
    which the worst point lies lower than it may."""

    angles: dict[str, Radians]
    off: Radians
    low: Meters


class Chain:
    """Joints that move an axis: that of eyes, or that from elbow to hand."""

    def __init__(
        self, model: mujoco.MjModel, joints: Sequence[str], place: Place, hand: Place | None = None, prefix: str = ""
    ) -> None:
        """place: eyes or elbow. hand: of an arm. prefix: before the names of joints and bodies in the model."""
        self.joints = tuple(joints)
        self._model = model
        self._data = mujoco.MjData(model)
        self._ids = np.array([model.joint(prefix + joint).id for joint in joints])
        self._adr = np.array([model.joint(prefix + joint).qposadr[0] for joint in joints])
        self._low, self._high = model.jnt_range[self._ids].T + np.array([[MARGIN], [-MARGIN]])
        self._place, self._hand = place, hand
        self._bodies = [model.body(prefix + each.body).id for each in (place, hand or place)]
        self._moves = np.array([[self._carries(joint, body) for joint in self._ids] for body in self._bodies])

    def ray(self, qpos: Array, angles: Mapping[str, Radians] | None = None) -> Ray:
        """The axis in a state of the model, with these joints at `angles`."""
        self._data.qpos[:] = qpos
        if angles is not None:
            self._data.qpos[self._adr] = [angles[joint] for joint in self.joints]
        mujoco.mj_kinematics(self._model, self._data)
        origin, axis, tip = self._axis()
        return Ray(origin=_vector(origin), axis=_vector(axis), tip=None if self._hand is None else _vector(tip))

    def aiming(
        self, qpos: Array, target: Vector, preferred: Mapping[str, Radians], *, floor: Meters = -math.inf,
        distance: Meters = 0.0,
    ) -> Steps[Solution]:  # fmt: skip
        """Angles whose axis runs through `target`, as near to the preferred ones as that leaves open.

        qpos: of all other joints. floor: height under which elbow and hand may not come. distance: from the hand to
        the target, at least. In steps, each a round: between them the chain may be asked for other things.
        """
        wanted, like = np.asarray(target), np.array([preferred[joint] for joint in self.joints])
        middle = (self._low + self._high) / 2
        best: Solution | None = None
        for start in (like, middle, 0.5 * (like + middle)):
            found = yield from self._solve(qpos, wanted, like, start, floor, distance)
            if best is None or (found.low, found.off) < (best.low, best.off):
                best = found
            if best.off < ON_AXIS and best.low <= 1e-3:
                break
        assert best is not None
        return best

    def _solve(
        self, qpos: Array, target: Array, like: Array, start: Array, floor: Meters, distance: Meters
    ) -> Steps[Solution]:
        q = np.clip(start, self._low, self._high)
        for _ in range(ROUNDS):
            yield ELEMENTS
            self._data.qpos[:] = qpos
            self._place_at(q)
            residual, jacobian = self._errors(target, floor, distance)
            step = self._step(q, residual, jacobian, like)
            before, q = q, np.clip(q + step, self._low, self._high)
            if np.abs(q - before).max() < NO_STEP:
                break
        self._place_at(q)
        origin, axis, tip = self._axis()
        way = target - origin
        off = math.acos(max(-1.0, min(1.0, float(axis @ way) / max(1e-9, float(np.linalg.norm(way))))))
        low = max(0.0, floor - float(min(origin[2], tip[2])), distance - float(np.linalg.norm(target - tip)))
        return Solution(dict(zip(self.joints, q.tolist(), strict=True)), off, low if self._hand is not None else 0.0)

    def _place_at(self, q: Array) -> None:
        self._data.qpos[self._adr] = q
        mujoco.mj_kinematics(self._model, self._data)

    def _step(self, q: Array, residual: Array, jacobian: Array, like: Array) -> Array:
        """The step that takes the errors away, and with what it leaves open goes towards the preferred pose.

        A joint that would leave its range stays, and the others do without it.
        """
        free = np.ones(len(q), dtype=bool)
        step = np.zeros_like(q)
        for _ in range(2):
            if not free.any():
                break
            own = jacobian[:, free]
            inverse = own.T @ np.linalg.inv(own @ own.T + DAMPING * np.eye(len(residual)))
            open_to = (like - q)[free] * POSTURE
            step[:] = 0.0
            step[free] = -inverse @ residual + open_to - inverse @ (own @ open_to)
            beyond = free & ((q + step < self._low - 1e-9) | (q + step > self._high + 1e-9))
            at_edge = beyond & ((q <= self._low + 1e-6) | (q >= self._high - 1e-6))
            if not at_edge.any():
                break
            free &= ~at_edge
        return step * min(1.0, LONGEST_STEP / max(1e-12, float(np.abs(step).max())))

    def _errors(self, target: Array, floor: Meters, distance: Meters) -> tuple[Array, Array]:
        """Errors of the pose in which the model is, and how they change with each joint."""
        origin, axis, tip = self._axis()
        turns, anchors = self._data.xaxis[self._ids], self._data.xanchor[self._ids]
        moved_origin = _cross(turns, origin - anchors) * self._moves[0][:, None]
        moved_tip = moved_origin
        if self._hand is None:
            moved_axis = _cross(turns, axis) * self._moves[0][:, None]
        else:
            moved_tip = _cross(turns, tip - anchors) * self._moves[1][:, None]
            moved_axis = _across(moved_tip - moved_origin, axis) / float(np.linalg.norm(tip - origin))
        way = target - origin
        far = max(1e-6, float(np.linalg.norm(way)))
        toward = way / far
        moved_toward = -_across(moved_origin, toward) / far
        wrong, change = _cross(axis, toward), _cross(moved_axis, toward) + _cross(axis, moved_toward)
        if float(axis @ toward) < 0.0:  # behind it the cross product falls again
            wrong = wrong / max(0.05, float(np.linalg.norm(wrong)))
        if self._hand is None:
            return wrong, change.T
        rows, columns = [wrong], [change.T]
        for point, moved in ((origin, moved_origin), (tip, moved_tip)):
            if point[2] < floor + KEPT:
                rows.append(np.array([floor + KEPT - point[2]]) * WEIGHT)
                columns.append(-WEIGHT * moved[:, 2][None, :])
        gap = target - tip
        if (near := float(np.linalg.norm(gap))) < distance + KEPT:
            rows.append(np.array([distance + KEPT - near]) * WEIGHT)
            columns.append(WEIGHT * (moved_tip @ (gap / max(near, 1e-6)))[None, :])
        return np.concatenate(rows), np.vstack(columns)

    def _axis(self) -> tuple[Array, Array, Array]:
        """Origin, direction and tip of the axis now."""
        origin = self._point(self._place, self._bodies[0])
        if self._hand is None:
            turned = self._data.xmat[self._bodies[0]].reshape(3, 3) @ np.asarray(self._place.axis)
            return origin, turned / np.linalg.norm(turned), origin
        tip = self._point(self._hand, self._bodies[1])
        way = tip - origin
        return origin, way / max(1e-9, float(np.linalg.norm(way))), tip

    def _point(self, place: Place, body: int) -> Array:
        return np.asarray(self._data.xpos[body] + self._data.xmat[body].reshape(3, 3) @ np.asarray(place.at))

    def _carries(self, joint: int, body: int) -> bool:
        """True if a body hangs on a joint."""
        holder = int(self._model.jnt_bodyid[joint])
        while body:
            if body == holder:
                return True
            body = int(self._model.body_parentid[body])
        return False


def _cross(one: Array, other: Array) -> Array:
    """Cross products; numpy's own takes ten times as long for so few."""
    x, y, z = one[..., 0], one[..., 1], one[..., 2]
    a, b, c = other[..., 0], other[..., 1], other[..., 2]
    return np.stack([y * c - z * b, z * a - x * c, x * b - y * a], axis=-1)


def _across(moved: Array, axis: Array) -> Array:
    """The part of each motion that is across an axis."""
    return np.asarray(moved - np.outer(moved @ axis, axis))


def _vector(values: Array) -> Vector:
    return (float(values[0]), float(values[1]), float(values[2]))

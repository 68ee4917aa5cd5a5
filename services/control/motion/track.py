"""Tracks: the motion of a few joints along a path in time, and places that they stay on while a trunk moves. Pure.

A path that has a target is laid as if the trunk stood still. Where the trunk is elsewhere, or moves, the angles that
it takes to be on target change; this difference is added to the path at each instant, as eyes do against a turn of
the head. So who is on target stays there, and comes there at the instant that the path says.
"""

from collections.abc import Sequence
from math import inf
from typing import Generic, TypeVar

import numpy as np

from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import Array, JointMotion, Path, resting

Trunk = tuple[float, ...]
"""Angles of the trunk: turn, lean."""
SAME = 1e-9
"""Radians that tell no two places of the trunk apart."""
_FIRST, _SECOND = 1e-4, 1e-3
"""Radians of the trunk over which first and second derivatives are taken."""


class Place:
    """A place that a part is on, and the place of the trunk for which its path is laid."""

    trunk: Trunk

    def offset(self, trunk: Sequence[float] | Array) -> Array:
        """Difference that has to be added to the joint angles of the path, with the trunk at `trunk`."""
        raise NotImplementedError

    def within(self, angles: Array) -> Array:
        """The angles, or the nearest that the joints can take."""
        return angles

    def is_laid_for(self, trunk: Sequence[float] | Array) -> bool:
        """True if the path is laid for the trunk at `trunk`."""
        turn, lean = trunk
        return bool(abs(turn - self.trunk[0]) < SAME and abs(lean - self.trunk[1]) < SAME)

    def added(self, path: JointMotion, trunk: JointMotion) -> JointMotion:
        """The state of the joints whose path is in the state `path`, while the trunk is in the state `trunk`."""
        by = self._moved(trunk)
        return JointMotion(path.q + by.q, path.v + by.v, path.a + by.a)

    def removed(self, joints: JointMotion, trunk: JointMotion) -> JointMotion:
        """The state of a path on which the joints are in the state `joints`."""
        by = self._moved(trunk)
        return JointMotion(joints.q - by.q, joints.v - by.v, joints.a - by.a)

    def _moved(self, trunk: JointMotion) -> JointMotion:
        """The offset as a state of motion, while the trunk moves."""
        here = self.offset(trunk.q)
        velocity, acceleration = np.zeros_like(here), np.zeros_like(here)
        if (speed := float(np.max(np.abs(trunk.v)))) > SAME:
            velocity = self._slope(trunk.q, trunk.v, _FIRST / speed)
            step = _SECOND / speed * trunk.v
            curve = self.offset(trunk.q + step) - 2 * here + self.offset(trunk.q - step)
            acceleration = curve * (speed / _SECOND) ** 2
        if (change := float(np.max(np.abs(trunk.a)))) > SAME:
            acceleration = acceleration + self._slope(trunk.q, trunk.a, _FIRST / change)
        return JointMotion(here, velocity, acceleration)

    def _slope(self, at: Array, along: Array, step: float) -> Array:
        return (self.offset(at + step * along) - self.offset(at - step * along)) / (2 * step)


P = TypeVar("P", bound=Place)


class Track(Generic[P]):
    """The motion of a few joints. Two arms that move as one share a motion, each with its columns of it.

    base: angles to which it goes back; those of the safe pose until a shift changes them. aim: the place that it is
    on, or on its way to; None: it moves with the trunk. trunk: the track of the trunk.
    """

    def __init__(
        self,
        name: str,
        limits: tuple[JointLimit, ...],
        home: tuple[float, ...],
        angles: Sequence[float] | None = None,
    ) -> None:
        """home: angles of the safe pose. angles: where the joints are; None: there."""
        self.name, self.own_limits, self.home = name, limits, home
        self.base = home
        self.aim: P | None = None
        self.trunk: Track[P] = self
        self.joints = tuple(limit.joint for limit in limits)
        self.motion = Motion(Path(resting(home if angles is None else angles), (), limits), 0.0)
        self.columns = slice(0, len(self.joints))
        """Which of the joints of the motion are its own."""
        self._last: Array | None = None
        """Position whose angles are known as numbers: of a motion that is over, it is the same all the time."""
        self._angles: tuple[float, ...] = ()

    @property
    def part(self) -> str:
        """The part of the body that it moves: a nod is one of the head."""
        return "head" if self.name == "nod" else self.name

    def play(self, motion: Motion, column: int = 0, aim: P | None = None) -> None:
        self.motion, self.aim, self._last = motion, aim, None
        self.columns = slice(column, column + len(self.joints))

    def at(self, t: Seconds) -> JointMotion:
        state, columns = self.motion.at(t), self.columns
        state = JointMotion(state.q[columns], state.v[columns], state.a[columns])
        if self.aim is None or self.is_still(t, self.aim):
            return state
        state = self.aim.added(state, self.trunk.at(t))
        return JointMotion(self.aim.within(state.q), state.v, state.a)

    def start_at(self, t: Seconds, aim: P | None) -> JointMotion:
        """State in which a path with this aim begins."""
        state = self.at(t)
        return state if aim is None or self.is_still(t, aim) else aim.removed(state, self.trunk.at(t))

    def is_still(self, t: Seconds, aim: P) -> bool:
        """True if the trunk rests where the path of an aim supposes it."""
        return not self.trunk.is_moving(t) and aim.is_laid_for(self.trunk.angles(t))

    def angles(self, t: Seconds) -> tuple[float, ...]:
        position, columns = self.motion.position(t), self.columns
        if self.aim is not None and not self.is_still(t, self.aim):
            return tuple(self.aim.within(position[columns] + self.aim.offset(self.trunk.angles(t))).tolist())
        if position is not self._last:
            self._last, self._angles = position, tuple(position[columns].tolist())
        return self._angles

    def going(self, trunk: Trunk | None = None) -> tuple[float, ...]:
        """Angles at which it comes to rest. trunk: where the trunk is then; None: where its path supposes it."""
        rests = self.motion.at(inf).q[self.columns]
        if trunk is not None and self.aim is not None:
            rests = rests + self.aim.offset(trunk)
        return tuple(rests.tolist())

    def is_moving(self, t: Seconds) -> bool:
        return t < self.motion.end

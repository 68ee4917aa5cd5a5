"""A behavior worked out as a motion, and the play of its path in time under a movement authority. Pure.

s(t) is made of few parabolas, so that the instant at which a sync point is crossed is a formula, without stepping
through the trajectory. A motion runs at a steady rate, brakes to a stop exactly at the authority's limit, and goes on
without having stopped if the limit is moved in time.

A track is the motion of a few joints, and the place that they stay on while a trunk moves. A path that has a target
is laid as if the trunk stood still. Where the trunk is elsewhere, or moves, the angles that it takes to be on target
change; this difference is added to the path at each instant, as eyes do against a turn of the head. So who is on
target stays there, and comes there at the instant that the path says.
"""

import math
from collections.abc import Mapping, Sequence
from functools import cache
from math import inf, sqrt
from typing import Generic, TypeVar

import numpy as np
from msgspec import Struct

from engage_hri.schemas.behavior_types import SYNC_POINTS
from engage_hri.schemas.behaviors import BlockBehavior, GazeShift, HeadDirectionShift
from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.motion.path import Array, JointMotion, Leg, Path, resting


class WalkPoint(Struct, frozen=True):
    """A sync point on the way of a behavior.

    held_with: the hold point at which it waits; its own name if it is one itself; empty: it is passed without a stop.
    stands_at: the later point up to which the motion may go while it waits here: it is on target at both.
    is_told: false for a place on the way that nobody is told of, as where a motor stalls; the motion stops there.
    """

    sync: str
    held_with: str = ""
    stands_at: str = ""
    is_told: bool = True


@cache
def held_on_target(*arrival: str) -> tuple[WalkPoint, ...]:
    """Sync points of a course that can hold while it is on target. arrival: points at which it is first there."""
    before = SYNC_POINTS[: SYNC_POINTS.index("stroke_end")]
    points = [WalkPoint(sync, "stroke", "relax") if sync in arrival else WalkPoint(sync) for sync in before]
    return (*points, WalkPoint("stroke_end", "relax"), WalkPoint("relax", "relax"), WalkPoint("end"))


@cache
def held_around_stroke(strokes: tuple[str, ...] = ()) -> tuple[WalkPoint, ...]:
    """Sync points of a course that can hold before and after its stroke. strokes: the stroke's repetitions."""
    number = SYNC_POINTS.index("stroke_end")
    syncs = (*SYNC_POINTS[:number], *strokes, *SYNC_POINTS[number:])
    return tuple(WalkPoint(sync, sync if sync in ("stroke_start", "stroke_end") else "") for sync in syncs)


class MotionPlan(Struct, frozen=True, kw_only=True):
    """A behavior worked out: `legs` for `joints` from where they are, and its sync points in order."""

    parts: tuple[str, ...]
    joints: tuple[str, ...]
    legs: tuple[Leg, ...]
    points: tuple[WalkPoint, ...]
    on_target: Mapping[str, float] = {}
    """Joint angles at the stroke, or at the end of a shift."""
    note: str = ""
    """Warning, if this is only the nearest to what was asked: names both."""

    @property
    def arrival(self) -> str:
        """The sync point that says that a behavior has come to its target."""
        return "stroke" if any(point.sync == "stroke" for point in self.points) else "end"

    @property
    def stays(self) -> bool:
        """True for a shift: it goes nowhere from its goal."""
        return len(self.points) == 2

    @property
    def goal(self) -> tuple[float, ...]:
        """Angles of its joints on target."""
        return tuple(self.on_target.values())


def is_shift(behavior: BlockBehavior) -> bool:
    """True for a shift of the head: it says where the head belongs when no look lies over it."""
    return isinstance(behavior, GazeShift | HeadDirectionShift)


SLOWEST = 0.01
"""The least steady rate: a time that the author of a block has fixed is kept, however slow that looks."""


class _Piece(Struct, frozen=True):
    """A parabola of s(t), from instant `t` on. slope: change of the rate per second."""

    t: Seconds
    s: Seconds
    rate: float
    slope: float

    def s_at(self, t: Seconds) -> Seconds:
        since = t - self.t
        return self.s + self.rate * since + self.slope * since * since / 2

    def rate_at(self, t: Seconds) -> float:
        return max(0.0, self.rate + self.slope * (t - self.t))


class Motion:
    """A path that is played from `start` on. Pure: it answers for any instant from its last change on.

    cruise: the steady rate, 1 = natural. limit: the s where it has to stop, until `extend` moves it.
    """

    def __init__(self, path: Path, start: Seconds, *, cruise: float = 1.0, limit: Seconds = inf) -> None:
        self.path = path
        self.cruise = min(cruise, path.fastest)
        self.limit = limit
        self._rest: JointMotion | None = None
        """State of the joints after the end, once it has been asked for."""
        # From rest the rate may jump: nothing moves yet. A path that starts in motion was built for rate 1.
        self._replan(start, 0.0, self.cruise if path.start.at_rest else 1.0)

    def extend(self, limit: Seconds, now: Seconds) -> None:
        """Move the limit further along. A motion that still brakes for the old one picks up speed again."""
        if limit > self.limit:
            s, rate = self.s(now), self.rate(now)
            self.limit = limit
            self._replan(now, s, rate)

    def run_at(self, cruise: float, now: Seconds) -> None:
        """Go on at another steady rate, as far as the limits permit."""
        s, rate = self.s(now), self.rate(now)
        self.cruise = min(cruise, self.path.fastest)
        # Where nothing moves yet the rate may jump.
        self._replan(now, s, self.cruise if self.path.rests_at(s) else rate)

    def reach(self, s: Seconds, at: Seconds, now: Seconds, fastest: float) -> None:
        """Change the rate such that `s` is reached at `at`, or as near to that as between `SLOWEST` and `fastest`."""
        here, rate = self.s(now), self.rate(now)
        left, time, change = s - here, at - now, self.path.gentlest_brake
        fastest = min(fastest, self.path.fastest)
        if time <= 0.0 or left >= fastest * time:
            cruise = fastest
        elif self.path.rests_at(here):
            cruise = left / time
        elif left >= rate * time:
            reach = rate + change * time
            room = reach * reach - rate * rate - 2 * change * left
            cruise = reach - sqrt(room) if room >= 0.0 else fastest
        else:
            reach = change * time - rate
            cruise = sqrt(max(0.0, reach * reach - rate * rate + 2 * change * left)) - reach
        self.run_at(min(max(cruise, SLOWEST), fastest), now)

    def brake(self, now: Seconds, at: Seconds | None = None) -> None:
        """Stop as soon as the limits permit, or at position `at`, where it can (see `can_stop_at`)."""
        s, rate = self.s(now), self.rate(now)
        self.limit = min(self.limit, s + rate * rate / (2 * self.path.gentlest_brake) if at is None else at)
        self._replan(now, s, rate)

    def reaches(self, s: Seconds, at: Seconds) -> bool:
        """True if s is reached by `at`, as it moves now."""
        crossing = self.crossing(s)
        return crossing is not None and crossing <= at

    def can_stop_at(self, s: Seconds, now: Seconds) -> bool:
        """True if it has not passed s, and can come to rest there."""
        left, rate = s - self.s(now), self.rate(now)
        if left < -1e-9 or self.path.rests_at(s):
            return left >= -1e-9
        return rate * rate <= 2 * self.path.steepest_brake(s, rate) * left + 1e-9

    def s(self, t: Seconds) -> Seconds:
        if t >= self.end:
            return self._stop
        return min(self._piece(t).s_at(t), self._stop)

    def rate(self, t: Seconds) -> float:
        return 0.0 if t >= self.end else self._piece(t).rate_at(t)

    def at(self, t: Seconds) -> JointMotion:
        """Position, velocity and acceleration of the joints at t."""
        if t >= self.end:
            if self._rest is None:
                self._rest = resting(self.path.at(self._stop).q)
            return self._rest
        piece = self._piece(t)
        rate, state = piece.rate_at(t), self.path.at(min(piece.s_at(t), self._stop))
        return JointMotion(state.q, state.v * rate, state.a * rate * rate + state.v * piece.slope)

    def position(self, t: Seconds) -> Array:
        """Position of the joints at t alone: after the end the same array each time."""
        if t >= self.end:
            return self.at(t).q
        return self.path.position(min(self._piece(t).s_at(t), self._stop))

    def positions(self, times: Sequence[Seconds] | Array) -> Array:
        """Positions of the joints at instants in order: an array of instants x joints."""
        length = self.path.length or 1.0
        return self.path.positions(self._along(np.asarray(times, dtype=np.float64)) / length)

    def _along(self, times: Array) -> Array:
        """s at many instants: as `s` has it at each."""
        pieces = np.array([(piece.t, piece.s, piece.rate, piece.slope) for piece in self._pieces])
        number = np.maximum(np.searchsorted(pieces[:, 0], times, side="right") - 1, 0)
        t, s, rate, slope = pieces[number].T
        since = times - t
        way = np.minimum(s + rate * since + slope * since * since / 2, self._stop)
        return np.where(times >= self.end, self._stop, way)

    def crossing(self, s: Seconds) -> Seconds | None:
        """Instant at which s is reached; None if s lies beyond the limit."""
        if s > self._stop + 1e-12:
            return None
        if s >= self._stop - 1e-12:
            return self.end
        piece = next((piece for piece in reversed(self._pieces) if piece.s <= s), self._pieces[0])
        root = sqrt(max(0.0, piece.rate * piece.rate + 2 * piece.slope * (s - piece.s)))
        return piece.t + 2 * (s - piece.s) / (piece.rate + root) if s > piece.s else piece.t

    def _piece(self, t: Seconds) -> _Piece:
        for piece in reversed(self._pieces):
            if piece.t <= t:
                return piece
        return self._pieces[0]

    def _replan(self, now: Seconds, s: Seconds, rate: float) -> None:
        self._stop = max(s, min(self.limit, self.path.length))
        self._rest = None
        self._pieces: list[_Piece] = []
        left = self._stop - s
        if left <= 0.0:
            self.end = now
            self._pieces.append(_Piece(now, s, 0.0, 0.0))
            return
        if rate == 0.0 and self.path.rests_at(s):
            rate = self.cruise
        brake = inf
        if not self.path.rests_at(self._stop):
            brake = self.path.steepest_brake(self._stop, max(rate, self.cruise))
        top, braking = _top_rate(rate, self.cruise, left, self.path.gentlest_brake, brake)
        now, s, rate = self._ramp(now, s, rate, top)
        steady = self._stop - s - braking
        if rate > 0.0 and steady > 0.0:
            self._pieces.append(_Piece(now, s, rate, 0.0))
            now, s = now + steady / rate, s + steady
        if braking > 0.0:
            self._pieces.append(_Piece(now, s, rate, -rate * rate / (2 * (self._stop - s))))
            now += 2 * (self._stop - s) / rate
        if not self._pieces:
            self._pieces.append(_Piece(now, s, 0.0, 0.0))
        self.end = now

    def _ramp(self, now: Seconds, s: Seconds, rate: float, to: float) -> tuple[Seconds, Seconds, float]:
        if math.isclose(rate, to, rel_tol=1e-12, abs_tol=1e-12):
            return now, s, to
        slope, stop = math.copysign(self.path.gentlest_brake, to - rate), self._stop
        seconds = (to - rate) / slope
        piece = _Piece(now, s, rate, slope)
        self._pieces.append(piece)
        if piece.s_at(now + seconds) >= stop:
            root = sqrt(max(0.0, rate * rate + 2 * slope * (stop - s)))
            return now + 2 * (stop - s) / (rate + root), stop, root
        return now + seconds, piece.s_at(now + seconds), to


def _top_rate(rate: float, cruise: float, left: Seconds, change: float, brake: float) -> tuple[float, Seconds]:
    """The highest rate from which the motion can stop within `left`, and the part of `left` that braking takes."""
    if brake == inf:
        return cruise, 0.0
    ramp = abs(cruise * cruise - rate * rate) / (2 * change)
    if ramp + cruise * cruise / (2 * brake) <= left:
        return cruise, cruise * cruise / (2 * brake)
    if rate * rate / (2 * brake) >= left:
        return rate, left
    top = sqrt((left + rate * rate / (2 * change)) / (1 / (2 * change) + 1 / (2 * brake)))
    top = max(rate, min(top, max(rate, cruise)))
    return top, top * top / (2 * brake)


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

"""Path of a motion through joint space, in closed form.

A twice differentiable curve q(s), where s is the time in seconds at natural speed; each sync point lies at some s.

Speed and acceleration limits: q'' alone stays within `SHARE` of the acceleration, which leaves the rest to changes of
the rate: |q''| rate^2 + |q'| |rate'| <= limit.
"""

from collections.abc import Collection, Iterator, Sequence
from copy import copy
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import replace
from numpy.typing import NDArray

from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.units import Seconds

Array = NDArray[np.float64]

SHARE = 0.6
MARGIN = 0.97
"""Share of a limit that sampled peaks may reach: between two samples a peak may be higher."""
OUTSIDE = 1e-9
"""Share of a joint's range by which a path may be outside of it."""
AT_REST = 1e-9
SAMPLES = np.linspace(0.0, 1.0, 33)
STRETCHES = tuple(1.1**step for step in range(40)) + tuple(0.9**step for step in range(1, 12))
"""Factors of a leg's natural duration, in the order in which they are tried."""

LEAST: Seconds = 0.02
"""Least time of a leg on which something moves."""
RESTS = 8
"""Places of which a path remembers whether anything moves there."""
_NOTHINGS: tuple[Seconds, ...] = (0.0004, 0.001, 0.002, 0.005, 0.01)
"""Times to try for a leg that needs none: whoever is all but there, and all but at rest, is there at once."""


class JointMotion(Struct, frozen=True):
    """Position, velocity and acceleration of some joints, in the order of their limits."""

    q: Array
    v: Array
    a: Array

    @property
    def at_rest(self) -> bool:
        # As plain numbers: with so few of them, numpy takes eight times as long.
        still = (-AT_REST < each < AT_REST for each in (*self.v.tolist(), *self.a.tolist()))
        return all(still)


def resting(q: Sequence[float] | Array) -> JointMotion:
    position = np.asarray(q, dtype=np.float64)
    return JointMotion(position, np.zeros_like(position), np.zeros_like(position))


class Leg(Struct, frozen=True, kw_only=True, gc=False):
    """A stretch of a path. Its end is passed with `velocity` (empty: rest) and without acceleration.

    seconds: natural duration; longer if the limits ask for it.
    marks: sync points, with the fraction of the leg's duration at which they lie.
    """

    goal: tuple[float, ...]
    seconds: Seconds
    velocity: tuple[float, ...] = ()
    marks: tuple[tuple[str, float], ...] = ()


class _Segment(Struct, frozen=True):
    """One leg of a path as a polynomial. start: in seconds at natural speed."""

    start: Seconds
    seconds: Seconds
    coefficients: Array
    """Array of 6 x joints, for ascending powers of the time since `start`."""


class Path:
    """Legs joined into one curve, from a state that may be in motion.

    marks: sync point -> s. length: seconds at natural speed.
    """

    def __init__(self, start: JointMotion, legs: Sequence[Leg], limits: Sequence[JointLimit]) -> None:
        self.legs = tuple(legs)
        self.start = start
        self.marks: dict[str, Seconds] = {}
        self._limits = _Limits(limits)
        self._segments: list[_Segment] = []
        self._peaks: list[tuple[float, float]] = []
        self._leg_starts: list[Seconds] = []
        self._rests: dict[Seconds, bool] = {}
        self.length = 0.0
        state = self._limits.softened(start)
        for leg in self.legs:
            state = self._append(leg, state)

    def _append(self, leg: Leg, state: JointMotion) -> JointMotion:
        goal = np.asarray(leg.goal, dtype=np.float64)
        velocity = np.asarray(leg.velocity or np.zeros_like(goal), dtype=np.float64)
        end = JointMotion(goal, velocity, np.zeros_like(goal))
        self._leg_starts.append(self.length)
        still = state.at_rest and not velocity.any() and bool(np.all(np.abs(state.q - goal) < 1e-7))
        seconds = 0.0
        if not (still and leg.seconds <= 0.0):
            connection = self._limits.connect(state, end, leg.seconds)
            seconds = connection.seconds
            self._segments.append(_Segment(self.length, seconds, connection.coefficients))
            self._peaks.append((connection.speed, connection.acceleration))
        for sync, fraction in leg.marks:
            self.marks[sync] = self.length + fraction * seconds
        self.length += seconds
        return end

    def at(self, s: Seconds) -> JointMotion:
        """Position q at s, and its derivatives q' and q''."""
        if not self._segments:
            return resting(self.legs[-1].goal if self.legs else self.start.q)
        segment = self._segment(s)
        return JointMotion(*_evaluated(segment.coefficients, min(max(s - segment.start, 0.0), segment.seconds)))

    def position(self, s: Seconds) -> Array:
        """Position q at s alone, as in `at`."""
        if not self._segments:
            return self.at(s).q
        segment = self._segment(s)
        powers = np.power(min(max(s - segment.start, 0.0), segment.seconds), _POWERS)
        return np.asarray(np.dot(powers, segment.coefficients))

    def rests_at(self, s: Seconds) -> bool:
        """True if nothing moves at s. It is asked again and again of few places: where a motion starts or stops."""
        if (is_resting := self._rests.get(s)) is None:
            if len(self._rests) >= RESTS:
                self._rests.clear()
            is_resting = self._rests[s] = self.at(s).at_rest
        return is_resting

    def positions(self, shares: Array) -> Array:
        """Positions q at these shares of the length, in order: an array of shares x joints."""
        if not self._segments:
            return np.tile(self.at(0.0).q, (len(shares), 1))
        found = [np.power(passed, _POWERS) @ c for c, passed in self._passed(shares * self.length)]
        return np.concatenate(found)

    def _speeds(self, s: Array) -> Array:
        """Derivatives q' at these s, in order: an array of s x joints."""
        if not self._segments:
            return np.zeros((len(s), len(self.start.q)))
        return np.concatenate([_evaluated(c, passed)[1] for c, passed in self._passed(s)])

    def _passed(self, s: Array) -> Iterator[tuple[Array, Array]]:
        """Coefficients of each segment, and a column of those of these s that lie on it, counted from its start."""
        since = 0
        for number, segment in enumerate(self._segments):
            is_last = number == len(self._segments) - 1
            until = len(s) if is_last else int(np.searchsorted(s, segment.start + segment.seconds))
            yield segment.coefficients, np.clip(s[since:until] - segment.start, 0.0, segment.seconds)[:, None]
            since = max(since, until)

    def after(self, s: Seconds, unreported: Collection[str] = ()) -> tuple[Leg, ...]:
        """Legs that are left at s, with the sync points beyond s. Those in `unreported` that are not come at once."""
        index = max((i for i, start in enumerate(self._leg_starts) if start <= s + 1e-12), default=0)
        ends = [*self._leg_starts[1:], self.length]
        legs = []
        for leg, start, end in list(zip(self.legs, self._leg_starts, ends, strict=True))[index:]:
            since = max(start, s)
            left = end - since
            if left <= 1e-12 and end - start > 0.0:
                continue
            marks = tuple(
                (sync, (self.marks[sync] - since) / left if left > 0.0 else 1.0)
                for sync, _ in leg.marks
                if self.marks[sync] > s + 1e-12
            )
            legs.append(Leg(goal=leg.goal, velocity=leg.velocity, seconds=left, marks=marks))
        missed = tuple([(sync, 0.0) for sync in self.marks if sync in unreported and self.marks[sync] <= s + 1e-12])
        if missed:
            first = legs[0] if legs else Leg(goal=self.legs[-1].goal, seconds=0.0)
            legs[:1] = [replace(first, marks=(*missed, *first.marks))]
        return tuple(legs)

    def travel(self, s: Seconds) -> float:
        """Way of all joints from the start to s, there and back counted twice; in their units."""
        parts = [(each, min(each.seconds, s - each.start)) for each in self._segments if each.start < s]
        ways = [_evaluated(each.coefficients, (SAMPLES * seconds)[:, None])[0] for each, seconds in parts]
        return sum(float(np.sum(np.abs(np.diff(way, axis=0)))) for way in ways)

    def marked(self, sync: str, s: Seconds) -> "Path":
        """The same path with one more mark."""
        path = copy(self)
        path.marks = {**self.marks, sync: s}
        return path

    def unmarked(self, sync: str) -> "Path":
        """The same path without that mark."""
        path = copy(self)
        path.marks = {each: s for each, s in self.marks.items() if each != sync}
        return path

    @cached_property
    def fastest(self) -> float:
        """The highest steady rate that the limits permit; at least 1."""
        speed = max((speed for speed, _ in self._peaks), default=0.0)
        acceleration = max((acceleration for _, acceleration in self._peaks), default=0.0)
        return max(1.0, min(4.0, MARGIN / max(speed, 0.01), sqrt(MARGIN * SHARE / max(acceleration, 0.01))))

    def steepest_brake(self, s: Seconds, rate: float = 1.0) -> float:
        """Speed at which the rate may fall to 0 at s, in 1/s: high where the path is slow anyway."""
        brake = 40.0
        while brake > 0.5:
            window = np.linspace(max(0.0, s - rate * rate / (2 * brake)), s, 9)
            if self._limits.permits_brake(self._speeds(window), brake):
                break
            brake *= 0.8
        return brake

    @property
    def gentlest_brake(self) -> float:
        """Speed at which the rate may change anywhere on this path, in 1/s."""
        return self._limits.brake_anywhere

    def _segment(self, s: Seconds) -> _Segment:
        for segment in self._segments:
            if s < segment.start + segment.seconds:
                return segment
        return self._segments[-1]


class _Limits:
    def __init__(self, limits: Sequence[JointLimit]) -> None:
        self.low = np.array([limit.low for limit in limits])
        self.high = np.array([limit.high for limit in limits])
        self.speed = np.array([limit.speed for limit in limits])
        self.acceleration = np.array([limit.acceleration for limit in limits])
        self.brake_anywhere = float(np.min((1 - SHARE) * self.acceleration / self.speed)) if len(limits) else 1.0

    def softened(self, state: JointMotion) -> JointMotion:
        """The state with an acceleration that a path may have."""
        bound = MARGIN * SHARE * self.acceleration
        return JointMotion(state.q, state.v, np.clip(state.a, -bound, bound))

    def connect(self, start: JointMotion, end: JointMotion, seconds: Seconds) -> "_Connection":
        """The quintic between two states that takes `seconds`, or as near to it as keeps the limits."""
        natural = max(seconds, LEAST)
        best: _Connection | None = None
        for each in (*(_NOTHINGS if seconds <= 0.0 else ()), *(natural * stretch for stretch in STRETCHES)):
            made = self._with_peaks(_quintic(start, end, each), each)
            if best is None or made.excess < best.excess:
                best = made
            if best.excess <= 0.0:
                break
        assert best is not None
        return best

    def permits_brake(self, speeds: Array, brake: float) -> bool:
        """speeds: instants x joints."""
        return bool(np.all(np.abs(speeds) * brake <= (1 - SHARE) * self.acceleration))

    def _with_peaks(self, coefficients: Array, seconds: Seconds) -> "_Connection":
        """A quintic with its highest speed and acceleration, and how far it is outside, as shares of the limits."""
        position, velocity, change = _evaluated(coefficients, (SAMPLES * seconds)[:, None])
        outside = float((np.maximum(self.low - position, position - self.high) / (self.high - self.low)).max())
        speed = float((np.abs(velocity) / self.speed).max())
        acceleration = float((np.abs(change) / self.acceleration).max())
        excess = max(speed / MARGIN - 1.0, acceleration / (MARGIN * SHARE) - 1.0, outside - OUTSIDE)
        return _Connection(coefficients, seconds, speed, acceleration, excess)


class _Connection(Struct, frozen=True):
    """A quintic with its peaks, as fractions of the joints' limits. excess: of the worst; <= 0: all are kept."""

    coefficients: Array
    seconds: Seconds
    speed: float
    acceleration: float
    excess: float


def _quintic(start: JointMotion, end: JointMotion, t: Seconds) -> Array:
    """Coefficients of the polynomial of degree five that joins two states in the time t."""
    h, t2 = end.q - start.q, t**2
    return np.array(
        [
            start.q,
            start.v,
            start.a / 2,
            (20 * h - (8 * end.v + 12 * start.v) * t - (3 * start.a - end.a) * t2) / (2 * t**3),
            (-30 * h + (14 * end.v + 16 * start.v) * t + (3 * start.a - 2 * end.a) * t2) / (2 * t**4),
            (12 * h - 6 * (end.v + start.v) * t + (end.a - start.a) * t2) / (2 * t**5),
        ]
    )


_POWERS = np.arange(6.0)
_FIRST = np.arange(1.0, 6.0)
_SECOND = np.arange(2.0, 6.0) * np.arange(1.0, 5.0)


def _evaluated(c: Array, t: Seconds | Array) -> tuple[Any, Any, Any]:
    """Value and first two derivatives of the polynomials at t, or at each t of a column."""
    powers = np.power(t, _POWERS)
    return np.dot(powers, c), np.dot(powers[..., :5] * _FIRST, c[1:]), np.dot(powers[..., :4] * _SECOND, c[2:])

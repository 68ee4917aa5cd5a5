"""Fluid motion in closed form: a path through joint space, and its play in time under a movement authority.

A `Path` is a twice differentiable curve q(s), where s is the time in seconds at natural speed; each sync point lies
at some s. A `Motion` plays it: s(t) is made of few parabolas, so that the instant at which a sync point is crossed
is a formula, without stepping through the trajectory. It runs at a steady rate, brakes to a stop exactly at
the authority's limit, and goes on without having stopped if the limit is moved in time.

Speed and acceleration limits: q'' alone stays within `SHARE` of the acceleration, which leaves the rest to changes of
the rate: |q''| rate^2 + |q'| |rate'| <= limit.
"""

import math
from collections.abc import Collection, Sequence
from math import inf, sqrt
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
AT_REST = 1e-9
SLOWEST = 0.01
"""The least steady rate: a time that the author of a block has fixed is kept, however slow that looks."""
SAMPLES = np.linspace(0.0, 1.0, 33)
_STRETCHES = tuple(1.1**step for step in range(40)) + tuple(0.9**step for step in range(1, 12))


class JointMotion(Struct, frozen=True):
    """Position, velocity and acceleration of some joints, in the order of their limits."""

    q: Array
    v: Array
    a: Array

    @property
    def at_rest(self) -> bool:
        return bool(np.all(np.abs(self.v) < AT_REST) and np.all(np.abs(self.a) < AT_REST))


def resting(q: Sequence[float] | Array) -> JointMotion:
    position = np.asarray(q, dtype=np.float64)
    return JointMotion(position, np.zeros_like(position), np.zeros_like(position))


class Leg(Struct, frozen=True, kw_only=True):
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
            connection = self._limits.connect(state, end, max(leg.seconds, 0.02))
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

    @property
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
            if all(self._limits.permits_brake(self.at(float(point)), brake) for point in window):
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
        best: _Connection | None = None
        for stretch in _STRETCHES:
            connection = self._with_peaks(_quintic(start, end, seconds * stretch), seconds * stretch)
            if connection.excess <= 0.0:
                return connection
            if best is None or connection.excess < best.excess:
                best = connection
        assert best is not None
        return best

    def permits_brake(self, state: JointMotion, brake: float) -> bool:
        return bool(np.all(np.abs(state.v) * brake <= (1 - SHARE) * self.acceleration))

    def _with_peaks(self, coefficients: Array, seconds: Seconds) -> "_Connection":
        position, velocity, change = _evaluated(coefficients, (SAMPLES * seconds)[:, None])
        speed = float(np.max(np.abs(velocity) / self.speed))
        acceleration = float(np.max(np.abs(change) / self.acceleration))
        outside = float(np.max(np.maximum(self.low - position, position - self.high) / (self.high - self.low)))
        excess = max(speed / MARGIN - 1.0, acceleration / (MARGIN * SHARE) - 1.0, outside - 1e-9)
        return _Connection(coefficients, seconds, speed, acceleration, excess)


class _Connection(Struct, frozen=True):
    """A quintic with its peaks, as fractions of the joints' limits. excess: of the worst; <= 0: all are kept."""

    coefficients: Array
    seconds: Seconds
    speed: float
    acceleration: float
    excess: float


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
        self._replan(now, s, self.cruise if self.path.at(s).at_rest else rate)

    def reach(self, s: Seconds, at: Seconds, now: Seconds, fastest: float) -> None:
        """Change the rate such that `s` is reached at `at`, or as near to that as between `SLOWEST` and `fastest`."""
        here, rate = self.s(now), self.rate(now)
        left, time, change = s - here, at - now, self.path.gentlest_brake
        fastest = min(fastest, self.path.fastest)
        if time <= 0.0 or left >= fastest * time:
            cruise = fastest
        elif self.path.at(here).at_rest:
            cruise = left / time
        elif left >= rate * time:
            reach = rate + change * time
            cruise = reach - sqrt(max(0.0, reach * reach - rate * rate - 2 * change * left))
        else:
            reach = change * time - rate
            cruise = sqrt(max(0.0, reach * reach - rate * rate + 2 * change * left)) - reach
        self.run_at(min(max(cruise, SLOWEST), fastest), now)

    def brake(self, now: Seconds, at: Seconds | None = None) -> None:
        """Stop as soon as the limits permit, or at position `at`, where it can (see `can_stop_at`)."""
        s, rate = self.s(now), self.rate(now)
        self.limit = min(self.limit, s + rate * rate / (2 * self.path.gentlest_brake) if at is None else at)
        self._replan(now, s, rate)

    def can_stop_at(self, s: Seconds, now: Seconds) -> bool:
        """True if it has not passed s, and can come to rest there."""
        left, rate = s - self.s(now), self.rate(now)
        if left < -1e-9 or self.path.at(s).at_rest:
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
        return next((piece for piece in reversed(self._pieces) if piece.t <= t), self._pieces[0])

    def _replan(self, now: Seconds, s: Seconds, rate: float) -> None:
        self._stop = max(s, min(self.limit, self.path.length))
        self._rest = None
        self._pieces: list[_Piece] = []
        left = self._stop - s
        if left <= 0.0:
            self.end = now
            self._pieces.append(_Piece(now, s, 0.0, 0.0))
            return
        if rate == 0.0 and self.path.at(s).at_rest:
            rate = self.cruise
        brake = inf
        if not self.path.at(self._stop).at_rest:
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


def _quintic(start: JointMotion, end: JointMotion, seconds: Seconds) -> Array:
    """Coefficients of the polynomial of degree five that joins two states in `seconds`."""
    t, h = seconds, end.q - start.q
    return np.array(
        [
            start.q,
            start.v,
            start.a / 2,
            (20 * h - (8 * end.v + 12 * start.v) * t - (3 * start.a - end.a) * t**2) / (2 * t**3),
            (-30 * h + (14 * end.v + 16 * start.v) * t + (3 * start.a - 2 * end.a) * t**2) / (2 * t**4),
            (12 * h - 6 * (end.v + start.v) * t + (end.a - start.a) * t**2) / (2 * t**5),
        ]
    )


_POWERS = np.arange(6)
_FIRST = np.arange(1, 6)
_SECOND = np.arange(2, 6) * np.arange(1, 5)


def _evaluated(c: Array, t: Seconds | Array) -> tuple[Any, Any, Any]:
    """Value and first two derivatives of the polynomials at t, or at each t of a column."""
    powers = t**_POWERS
    return powers @ c, (powers[..., :5] * _FIRST) @ c[1:], (powers[..., :4] * _SECOND) @ c[2:]

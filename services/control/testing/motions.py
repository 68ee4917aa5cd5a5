"""Watching a body move: samples of its joints, what they say about limits, and stops that nothing required.

Limits are judged by differences over several spans of time. A joint that keeps its speed keeps it over every span,
and the longer the span, the less the noise of an encoder counts in it.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import asynccontextmanager
from typing import Any

import numpy as np
from msgspec import Struct
from msgspec.structs import replace
from numpy.lib.stride_tricks import sliding_window_view

from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.findings import angles

STEP: Seconds = 0.004
"""Time between two samples."""
LONGEST_SPAN: Seconds = 0.3
USED = 0.2
"""Share of its greatest speed that some joint is expected to come to, in all that it does."""
DEVIATIONS = 6.0
"""Standard deviations of noise that no difference is ever blamed for."""
Array = np.ndarray[Any, np.dtype[np.float64]]


class Violation(Struct, frozen=True, kw_only=True):
    """A joint that has left one of its limits.

    what: `range`, `speed` or `acceleration`. measured, limit: radians, per second, per second squared. at: seconds.
    explained: standard deviation of the noise of encoders, radians, from which on this is no violation.
    """

    joint: str
    what: str
    measured: float
    limit: float
    at: Seconds
    explained: Radians = 0.0

    @property
    def unit(self) -> str:
        """End of the unit of the two numbers, behind `degrees`."""
        return {"range": "", "speed": "/s", "acceleration": "/s^2"}[self.what]


class Recording:
    """Joint angles of a body over time, sampled at a steady rate."""

    def __init__(self, joints: Iterable[str]) -> None:
        self.joints = tuple(joints)
        self.times: list[Seconds] = []
        self.samples: list[list[Radians]] = []

    def take(self, body: Body) -> None:
        """Take a sample now."""
        now, measured = asyncio.get_running_loop().time(), angles(body.state().pose)
        if self.times and now <= self.times[-1]:
            return
        self.times.append(now)
        self.samples.append([measured[joint] for joint in self.joints])

    @property
    def angles(self) -> Array:
        """Angles of shape (samples, joints), radians."""
        return np.array(self.samples)

    @property
    def speeds(self) -> Array:
        """Speeds from sample to sample, radians per second."""
        return np.asarray(np.diff(self.angles, axis=0) / np.diff(self.times)[:, None])

    @property
    def scatter(self) -> Array:
        """Standard deviation of the readings of each joint, radians. Slow motion counts for nothing."""
        samples = self.angles
        fresh = np.flatnonzero(np.any(np.diff(samples, axis=0) != 0.0, axis=1)) + 1
        if len(fresh) < 3:
            return np.zeros(len(self.joints))
        return np.asarray(np.diff(samples[fresh], axis=0).std(axis=0) / math.sqrt(2.0))

    @property
    def repeats(self) -> Seconds:
        """Time for which most readings come again while the joints move: those of a driver are old for so long."""
        fresh = np.flatnonzero(np.any(np.diff(self.angles, axis=0) != 0.0, axis=1)) + 1
        return float(np.median(np.diff(np.array(self.times)[fresh]))) if len(fresh) > 1 else 0.0

    def fastest(self, noise: Radians) -> dict[str, float]:
        """The fastest that each joint was, radians per second: the slope of a line through all readings of 20 ms.

        noise: of one reading. With noise it is 100 ms, over which 0.3 degrees of noise are 2 degrees/s of the slope.
        """
        span = 25 if noise else 6
        if len(self.times) < span:
            return {}
        times = sliding_window_view(np.array(self.times), span)
        angles = sliding_window_view(self.angles, span, axis=0)
        since = times - times.mean(axis=1, keepdims=True)
        slopes = (angles * since[:, None, :]).sum(axis=2) / (since**2).sum(axis=1)[:, None]
        return dict(zip(self.joints, np.abs(slopes).max(axis=0).tolist(), strict=True))

    def at(self, time: Seconds) -> dict[str, Radians]:
        """Angle of each joint at an instant, between the two samples about it."""
        columns = self.angles.T if self.samples else np.empty((0, 0))
        return {
            joint: float(np.interp(time, self.times, column))
            for joint, column in zip(self.joints, columns, strict=True)
        }


@asynccontextmanager
async def recorded(body: Body, joints: Iterable[str] = ()) -> AsyncIterator[Recording]:
    """Record everything that `body` does inside the `async with`; by default of all its joints."""
    recording = Recording(joints or (limit.joint for limit in body.capabilities.joints))

    async def sample() -> None:
        while True:
            recording.take(body)
            await asyncio.sleep(STEP)

    sampling = asyncio.create_task(sample(), name="recording")
    try:
        yield recording
    finally:
        sampling.cancel()
        (ended,) = await asyncio.gather(sampling, return_exceptions=True)
        if isinstance(ended, Exception):
            raise ended


def violations(
    recording: Recording, limits: Iterable[JointLimit], noise: Radians = 0.0, age: Seconds = 0.0
) -> list[Violation]:
    """List joints that leave their range, their speed or their acceleration.

    noise: standard deviation of one reading. age: by how much one reading may be older than another.
    """
    found: list[Violation] = []
    times, samples, step = _readings(recording)
    late = max(age, step)
    for limit in limits:
        if limit.joint not in recording.joints or len(times) < 3:
            continue
        column = samples[:, recording.joints.index(limit.joint)]
        found += _out_of_range(limit, times, column, noise)
        found += _too_fast(limit, times, column, noise, late)
    return found


def _readings(recording: Recording) -> tuple[Array, Array, Seconds]:
    """Samples that are new readings, and by how much their times may be off.

    Drivers often hand out the last message of their hardware: a reading that comes again in motion is old.
    """
    times, samples = np.array(recording.times), recording.angles
    if len(times) < 3:
        return times, samples, 0.0
    fresh = np.flatnonzero(np.any(np.diff(samples, axis=0) != 0.0, axis=1)) + 1
    gaps = np.diff(times[fresh])
    gaps = gaps[gaps < LONGEST_SPAN]  # longer: the body stands
    step = float(np.median(np.diff(times)))
    if len(gaps) < 3 or float(np.median(gaps)) < 1.5 * step:
        return times, samples, 0.0
    return times[fresh], samples[fresh], step


def _out_of_range(limit: JointLimit, times: Array, column: Array, noise: Radians) -> Iterable[Violation]:
    slack = DEVIATIONS * noise + 1e-6
    for index, bound in ((int(column.argmin()), limit.low), (int(column.argmax()), limit.high)):
        if not limit.low - slack <= column[index] <= limit.high + slack:
            yield Violation(
                joint=limit.joint, what="range", measured=float(column[index]), limit=bound, at=float(times[index])
            )


def _too_fast(limit: JointLimit, times: Array, column: Array, noise: Radians, late: Seconds) -> Iterable[Violation]:
    """Compare divided differences with the limits: each is one that the joint has really had."""
    worst: dict[str, Violation] = {}
    step = float(np.median(np.diff(times)))
    span = 1
    while span == 1 or span * step <= LONGEST_SPAN:
        if 2 * span >= len(times):
            break
        between = times[span:] - times[:-span]
        speed = (column[span:] - column[:-span]) / between
        sure = np.abs(speed) - 2.0 * np.abs(speed) * late / between - limit.speed * (1 + 1e-6)
        needed = sure * between / (DEVIATIONS * math.sqrt(2.0))
        _note(worst, limit.joint, "speed", needed, noise, limit.speed, times[:-span], speed)
        around = (between[:-span] + between[span:]) / 2.0
        change = (speed[span:] - speed[:-span]) / around
        shortest = np.minimum(between[:-span], between[span:])
        fastest = np.maximum(np.abs(speed[:-span]), np.abs(speed[span:]))
        sure = np.abs(change) - 4.0 * fastest * late / shortest**2 - limit.acceleration * (1 + 1e-6)
        needed = sure * shortest**2 / (DEVIATIONS * math.sqrt(6.0))
        _note(worst, limit.joint, "acceleration", needed, noise, limit.acceleration, times[: -2 * span], change)
        span *= 2
    return worst.values()


def _note(
    worst: dict[str, Violation],
    joint: str,
    what: str,
    needed: Array,
    noise: Radians,
    limit: float,
    times: Array,
    measured: Array,
) -> None:
    """Keep the worst violation of one kind. needed: noise that would explain each difference, radians."""
    index = int(needed.argmax())
    most, value = float(needed[index]), abs(float(measured[index]))
    if most > noise:
        before = worst.get(what)
        if before is None or value > before.measured:
            at = float(times[index])
            worst[what] = Violation(joint=joint, what=what, measured=value, limit=limit, at=at, explained=most)
        if before is not None:
            worst[what] = replace(worst[what], explained=max(most, before.explained))


def unused(limits: Iterable[JointLimit], fastest: Mapping[str, float]) -> tuple[str, ...]:
    """Say so if no joint ever comes near the speed that it states.

    fastest: that joints were seen to be, radians per second.
    """
    shares = {each.joint: fastest[each.joint] / each.speed for each in limits if fastest.get(each.joint)}
    if not shares or (most := max(shares.values())) >= USED:
        return ()
    joint = max(shares, key=lambda each: shares[each])
    seen = f"{joint}, with {math.degrees(fastest[joint]):.0f} degrees/s, came nearest, to {100 * most:.0f} %"
    return (f"no joint was ever near the speed that it states ({seen}): are these the limits of its motors?",)

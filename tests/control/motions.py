"""Watching a body move: samples of its joints, what they say about limits, and stops that nothing required."""

import asyncio
from collections.abc import AsyncIterator, Iterable
from contextlib import asynccontextmanager

import numpy as np

from engage_hri.schemas.body import JointLimit
from engage_hri.services.control.body import Body

STEP = 0.004
"""Seconds between two samples."""


class Recording:
    """Joint angles of a body over time, sampled at a steady rate."""

    def __init__(self, joints: Iterable[str]) -> None:
        self.joints = tuple(joints)
        self.times: list[float] = []
        self.samples: list[list[float]] = []

    def take(self, body: Body) -> None:
        angles = {angle.joint: angle.angle for angle in body.state().pose.joints}
        self.times.append(asyncio.get_running_loop().time())
        self.samples.append([angles[joint] for joint in self.joints])

    @property
    def angles(self) -> np.ndarray:
        return np.array(self.samples)

    @property
    def speeds(self) -> np.ndarray:
        return np.diff(self.angles, axis=0) / np.diff(self.times)[:, None]

    @property
    def accelerations(self) -> np.ndarray:
        return np.diff(self.speeds, axis=0) / STEP


@asynccontextmanager
async def recorded(body: Body, joints: Iterable[str] = ()) -> AsyncIterator[Recording]:
    """Everything that `body` does inside the `async with`; by default of all its joints."""
    recording = Recording(joints or (limit.joint for limit in body.capabilities.joints))

    async def sample() -> None:
        while True:
            recording.take(body)
            await asyncio.sleep(STEP)

    sampling = asyncio.create_task(sample())
    try:
        yield recording
    finally:
        sampling.cancel()
        await asyncio.gather(sampling, return_exceptions=True)


def violations(recording: Recording, limits: Iterable[JointLimit]) -> list[str]:
    """Every joint that leaves its range, its speed or its acceleration."""
    found = []
    all_angles, all_speeds, all_accelerations = recording.angles, recording.speeds, recording.accelerations
    for limit in limits:
        if limit.joint not in recording.joints:
            continue
        column = recording.joints.index(limit.joint)
        angles = all_angles[:, column]
        if angles.min() < limit.low - 1e-6 or angles.max() > limit.high + 1e-6:
            reached = f"{angles.min():.3f}..{angles.max():.3f}"
            found.append(f"{limit.joint} at {reached}, its range is {limit.low:.3f}..{limit.high:.3f}")
        speed = np.abs(all_speeds[:, column]).max()
        if speed > limit.speed * (1 + 1e-6):
            found.append(f"{limit.joint} moves at {speed:.2f} rad/s, the limit is {limit.speed:.2f}")
        acceleration = np.abs(all_accelerations[:, column]).max()
        if acceleration > limit.acceleration * (1 + 1e-6):
            found.append(f"{limit.joint} accelerates at {acceleration:.1f}, the limit is {limit.acceleration:.1f}")
    return found


def stops(recording: Recording, start: float, end: float) -> int:
    """How often the joints' speed falls under 1 % of its peak between `start` and `end`, after it has risen above."""
    times = np.array(recording.times[1:])
    inside = (times > start) & (times <= end)
    speed = np.linalg.norm(recording.speeds[inside], axis=1)
    moving = speed >= 0.01 * speed.max()
    # The last samples before the end are the end of the motion, not a stop in it.
    first, last = int(np.argmax(moving)), len(moving) - int(np.argmax(moving[::-1]))
    return int(np.sum(np.diff(moving[first:last].astype(int)) == -1))

"""What the daemon was told, against the limits that the driver states: a daemon does whatever it is told, at once."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from engage_hri.schemas.body import JointLimit

SIGNS = {"head_yaw": ("yaw", 1), "head_pitch": ("pitch", -1), "head_roll": ("roll", -1), "body_yaw": ("body_yaw", 1),
         "right_antenna": ("right", 1), "left_antenna": ("left", 1)}  # fmt: skip
PAUSE = 0.1
"""Seconds between two commands after which the joints have stood."""


def too_much(commands: Sequence[tuple[float, Mapping[str, float]]], limits: Iterable[JointLimit]) -> list[str]:
    """Joints that were sent out of their range, or on at more than their speed or acceleration, by differences."""
    found = []
    times = np.array([at for at, _ in commands])
    for limit in limits:
        if limit.joint not in SIGNS:
            continue
        name, sign = SIGNS[limit.joint]
        angles = sign * np.array([pose[name] for _, pose in commands])
        if angles.min() < limit.low - 1e-6 or angles.max() > limit.high + 1e-6:
            found.append(f"{limit.joint} is sent to {angles.min():.3f}..{angles.max():.3f}")
        for stretch in np.split(np.arange(len(times)), np.flatnonzero(np.diff(times) > PAUSE) + 1):
            if len(stretch) < 3:
                continue
            step = np.diff(times[stretch])
            speeds = np.diff(angles[stretch]) / step
            changes = np.diff(speeds) / ((step[1:] + step[:-1]) / 2)
            if (fastest := np.abs(speeds).max()) > limit.speed * 1.001:
                found.append(f"{limit.joint} is sent on at {fastest:.2f} rad/s, its limit is {limit.speed:.2f}")
            if (most := np.abs(changes).max()) > limit.acceleration * 1.001:
                found.append(f"{limit.joint} is sped up by {most:.1f} rad/s^2, its limit is {limit.acceleration:.1f}")
    return found

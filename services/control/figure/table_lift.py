"""Free gestures over a table that the trunk leans to: raised, or made smaller, until they are clear of it. Pure."""

from collections.abc import Sequence
from math import radians

import numpy as np

from engage_hri.schemas.units import Meters, Radians
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import kinematics, tracks
from engage_hri.services.control.figure.aiming import UPRIGHT
from engage_hri.services.control.motion.track import Trunk

Pose = tuple[float, ...]
"""Angles of the joints of one arm, or of both."""

LIFTS: tuple[Radians, ...] = tuple(radians(degrees) for degrees in range(0, 48, 3))
"""Angles by which the upper arm is raised, in the order in which they are tried."""
SIZES = (1.0, 0.85, 0.7, 0.55, 0.4)
"""Shares of the full amplitude, in the order in which they are tried."""
MARGIN: Meters = 0.005
"""Between two poses a path may come so much lower than at both."""


def clear_of_table(
    joints: tuple[str, ...], poses: Sequence[Pose], home: Pose, trunks: tuple[Trunk, ...]
) -> Sequence[Pose]:
    """Raise the poses of a gesture until arms are clear of the table, or make it smaller. Raises Impossible.

    home: where the arms come from and go to. trunks: where the trunk may be meanwhile.
    """
    if trunks == (UPRIGHT,):
        return poses  # So they were made.
    for size in SIZES:
        smaller = [nearer(pose, home, size) for pose in poses]
        raised = [[lifted(joints, pose, lift) for pose in smaller] for lift in LIFTS]
        for made, is_clear in zip(raised, are_clear(joints, raised, trunks), strict=True):
            if is_clear:
                return made
    raise Impossible("CANNOT_CREATE_BEHAVIOR", "the table is in the way of the arm, as the torso leans")


def are_clear(joints: tuple[str, ...], groups: Sequence[Sequence[Pose]], trunks: Sequence[Trunk]) -> Sequence[bool]:
    """For each group of poses, all of a size: True if arms are clear of the table in all, wherever the trunk is."""
    clear: list[bool] = (tracks.above_table_each(np.array(groups), joints, trunks) > MARGIN).tolist()
    return clear


def lifted(joints: tuple[str, ...], pose: Pose, by: Radians) -> Pose:
    """The pose with the upper arms raised, as far as they go."""
    return tuple(
        min(angle + by, max(angle, kinematics.LIMIT[joint].high)) if joint.endswith("_shoulder_pitch") else angle
        for joint, angle in zip(joints, pose, strict=True)
    )


def nearer(pose: Pose, home: Pose, by: float) -> Pose:
    """The pose at a share of its way from home."""
    return tuple(rest + by * (angle - rest) for angle, rest in zip(pose, home, strict=True))

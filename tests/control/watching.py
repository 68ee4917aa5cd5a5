"""Watching bodies in tests: stops that nothing required, poses, and a witness of its own for any of them."""

import numpy as np

from engage_hri.schemas.body import BodyPose
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.testing.findings import angles, turned
from engage_hri.services.control.testing.motions import Recording
from engage_hri.services.control.testing.suite import Suite


class Bystander(Suite):
    """What a witness asks of a suite, for a body that was made elsewhere."""

    def make(self) -> Body:
        raise AssertionError("it is there")


def stops(recording: Recording, start: Seconds, end: Seconds) -> int:
    """Count how often the joints' speed falls under 1 % of its peak between `start` and `end`, once it was above."""
    times = np.array(recording.times[1:])
    inside = (times > start) & (times <= end)
    speed = np.linalg.norm(recording.speeds[inside], axis=1)
    moving = speed >= 0.01 * speed.max()
    # The last samples before the end are the end of the motion, not a stop in it.
    first, last = int(np.argmax(moving)), len(moving) - int(np.argmax(moving[::-1]))
    return int(np.sum(np.diff(moving[first:last].astype(int)) == -1))


def poses_agree(one: BodyPose, other: BodyPose, within: Radians = 0.01) -> bool:
    """True if each joint of one pose is where it is in the other."""
    return turned(angles(one), angles(other)) < within

"""Joints that are beside the angles that they measure, and where eyes and forearms really are then. Pure."""

from collections.abc import Mapping
from math import radians

from engage_hri.schemas.body import BodyPose, Ray
from engage_hri.schemas.units import Radians
from engage_hri.services.control.contract.extras import Seen
from engage_hri.services.control.contract.variability import Deviations
from engage_hri.services.control.figure import kinematics, tracks


def beside(deviations: Deviations, offsets: Mapping[str, Radians]) -> dict[str, Radians]:
    """Angles by which the true ones are more than those that the body tells: miscalibrated, less what is corrected.

    offsets: by which the body corrects what its joints measure.
    """
    by = {joint: -offset for joint, offset in offsets.items()}
    for fault, amount in deviations.of("miscalibrated"):
        for joint in [limit.joint for limit in kinematics.JOINTS if fault.part in ("", limit.part, limit.joint)]:
            if kinematics.LIMIT[joint].part != "face":
                by[joint] = by.get(joint, 0.0) + radians(amount)
    return {joint: angle for joint, angle in by.items() if angle}


def seen(told: kinematics.Pose, by: Mapping[str, Radians]) -> Seen | None:
    """Tell what people see of a body that tells these angles and is so much beside; None: just that."""
    if not by:
        return None
    angles = {joint: angle + by.get(joint, 0.0) for joint, angle in told.items()}
    arms = kinematics.arm(angles, "left"), kinematics.arm(angles, "right")
    return Seen(gaze=kinematics.gaze(angles), left_arm=arms[0], right_arm=arms[1])


def ray_at(part: str, pose: BodyPose) -> Ray | None:
    """Tell where a part looks or points at a pose; None: it does neither."""
    angles = tracks.updated(kinematics.HOME, pose)
    match part:
        case "head":
            return kinematics.gaze(angles)
        case "left_arm":
            return kinematics.arm(angles, "left")
        case "right_arm":
            return kinematics.arm(angles, "right")
    return None

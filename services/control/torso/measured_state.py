"""Measurements of a torso: its pose as a message, and the rays of its eyes and arms, as its joints tell them."""

from collections.abc import Mapping

from msgspec import Struct

from engage_hri.schemas.body import BodyPose, Ray
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.tracks import Track, pose_of


class Measured(Struct, frozen=True):
    """A pose with its rays. angles: of each track."""

    angles: Mapping[str, tuple[float, ...]]
    pose: BodyPose
    gaze: Ray
    left_arm: Ray
    right_arm: Ray


def measured(tracks: Mapping[str, Track], t: Seconds, before: Measured | None = None) -> Measured:
    """Measure at loop time t.

    before: what was measured last. Often nothing has moved since, and hardly ever everything: what has not is taken
    from there.
    """
    angles = {part: track.angles(t) for part, track in tracks.items()}
    if before is None:
        moved = set(angles)
    elif angles == before.angles:
        return before
    else:
        moved = {part for part, at in angles.items() if at != before.angles[part]}
    pose = pose_of(tracks, angles.values())
    return Measured(
        angles,
        kinematics.pose_message(pose),
        kinematics.gaze(pose) if before is None or moved & {"torso", "head", "nod"} else before.gaze,
        kinematics.arm(pose, "left") if before is None or moved & {"torso", "left_arm"} else before.left_arm,
        kinematics.arm(pose, "right") if before is None or moved & {"torso", "right_arm"} else before.right_arm,
    )

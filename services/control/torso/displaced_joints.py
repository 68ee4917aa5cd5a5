"""Joints that are elsewhere than the torso believes: somebody moves an arm that rests, and it does not know. Pure."""

from collections.abc import Mapping
from math import degrees

from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.figure.pace import return_time
from engage_hri.services.control.figure.tracks import LIMITS, pose_at
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import Leg, Path, resting
from engage_hri.services.control.torso.torso import Torso

Angles = Mapping[str, float]
"""True angles of displaced joints, radians."""


def objection(torso: Torso, on: Angles, angles: Angles) -> str:
    """Say why these joints cannot be displaced now; empty: they can. on: those that are already."""
    now, new = torso.clock.time(), _new(on, angles)
    for joint, angle in new.items():
        limit = kinematics.LIMIT[joint]
        if joint not in torso.tracks[limit.part].joints:
            return f"{joint} cannot be displaced: it is at rest where it adds nothing"
        if not limit.low <= angle <= limit.high:
            low, high = degrees(limit.low), degrees(limit.high)
            return f"{joint} cannot be displaced to {degrees(angle):.0f} degrees: expected {low:.0f}..{high:.0f}"
        if limit.part in torso.runs or torso.tracks[limit.part].is_moving(now):
            return f"{joint} cannot be displaced: the {limit.part.replace('_', ' ')} moves; it can be while it rests"
    if new and kinematics.touches_table({**pose_at(torso.tracks, now), **new}):
        return "joints cannot be displaced so: an arm would touch the table"
    return ""


def displace(torso: Torso, on: Angles, angles: Angles) -> None:
    """Displace exactly these joints. Of one that is displaced no more the torso knows again where it is."""
    now, new = torso.clock.time(), _new(on, angles)
    for part in dict.fromkeys(kinematics.LIMIT[joint].part for joint in new):
        track = torso.tracks[part]
        here = dict(zip(track.joints, track.angles(now), strict=True))
        moved = {joint: angle for joint, angle in new.items() if joint in here}
        torso.misbelieved |= {joint: torso.misbelieved.get(joint, here[joint]) for joint in moved}
        goal = tuple((here | moved).values())
        leg = Leg(goal=goal, seconds=return_time(list(here.values()), goal))
        track.play(Motion(Path(resting(list(here.values())), (leg,), LIMITS[part]), now))
    known = [joint for joint in on if joint not in angles and torso.misbelieved.pop(joint, None) is not None]
    torso.relax(tuple(dict.fromkeys(kinematics.LIMIT[joint].part for joint in known)))


def _new(on: Angles, angles: Angles) -> dict[str, float]:
    return {joint: angle for joint, angle in angles.items() if on.get(joint) != angle}

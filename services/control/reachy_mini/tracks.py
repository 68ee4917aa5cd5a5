"""A track of Reachy Mini: joints that move along one path, and how near to it they have to be measured. Pure."""

from collections.abc import Container, Mapping, Sequence
from math import inf, radians

from msgspec import Struct

from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import Path, resting
from engage_hri.services.control.reachy_mini import courses, joints
from engage_hri.services.control.reachy_mini.geometry import Angles

Tracks = dict[str, tuple[float, ...]]
NEAR = {
    "head_pitch": radians(0.8), "head_yaw": radians(0.8), "body_follow": radians(2.0), "nod_yaw": radians(1.0),
    "nod_pitch": radians(1.0), "nod_roll": radians(1.0), "body_turn": radians(1.0), "body_lean": radians(0.5),
    "right_antenna": radians(1.0), "left_antenna": radians(1.0),
}  # fmt: skip
"""How far a joint of a track may be from a sync point."""
STANDING = {"right_antenna": radians(4.0), "left_antenna": radians(4.0)}
"""How far it may be once it has come to stand: an antenna is a long lever on a small motor."""


class Off(Struct, frozen=True):
    """The joint that is farthest off, by the share of what is allowed. here, there: where it is and should be."""

    joint: str
    share: float
    here: Radians
    there: Radians

    @property
    def is_near_for_standing(self) -> bool:
        """True if it is near enough, should it have come to stand there."""
        return abs(self.there - self.here) <= STANDING.get(self.joint, 0.0)


class Aim(Struct, frozen=True):
    """A look of the head: on what, and the turn and lean of the body for which its path was laid."""

    look: courses.Looks
    body: tuple[float, ...]


class Track:
    """The motion of a few joints. base: angles to which they go home. aim: what the head is on, or on its way to."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.base = joints.HOME[name]
        self.aim: Aim | None = None
        self.motion = Motion(Path(resting(self.base), (), joints.TRACKS[name]), 0.0)

    @property
    def going(self) -> tuple[float, ...]:
        """Angles at which it comes to rest."""
        return tuple(self.motion.at(inf).q.tolist())


def busy(tracks: Mapping[str, Track], runs: Container[str], now: Seconds) -> set[str]:
    """Names of the tracks that move, or that a behavior has."""
    return {name for name, track in tracks.items() if name in runs or now < track.motion.end}


def farthest(name: str, here: Sequence[float], there: Sequence[float], near: Angles) -> Off:
    """The joint of a track that is off by the greatest share of what is allowed."""
    names = [limit.joint for limit in joints.TRACKS[name]]
    offs = [Off(joint, abs(b - a) / near[joint], a, b) for joint, a, b in zip(names, here, there, strict=True)]
    return max(offs, key=lambda off: off.share)

"""Messages of the daemon of a Reachy Mini, version 1.12. Pure.

`/api/state/ws/full` sends the head's pose, which the daemon computes from the measured motors, the turn of the body,
both antennas, and whether the motors are on. `/api/move/ws/set_target` takes a target, and answers nothing.
"""

import math

import msgspec
from msgspec import Struct

from engage_hri.schemas.faults import Fault
from engage_hri.services.control.bases.linked import Lost
from engage_hri.services.control.reachy_mini.joints import Angles, head_place, lean

VERSION = "this driver knows the daemon's versions 1.12; see docs/reachy-mini.md"
ENABLED = "enabled"
FARTHEST_ASIDE = math.radians(100.0)
FARTHEST_OVER = math.radians(70.0)


class _Pose(Struct):
    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    roll: float = 0.0
    pitch: float = 0.0
    yaw: float = 0.0


class _State(Struct):
    head_pose: _Pose
    body_yaw: float
    antennas_position: tuple[float, float]
    control_mode: str


class _Target(Struct):
    target_head_pose: _Pose
    target_antennas: tuple[float, float]
    target_body_yaw: float


class Measured(Struct, frozen=True):
    """The joints at one instant, radians. mode: of the motors, `enabled` if they hold and move the joints."""

    pose: dict[str, float]
    mode: str

    @property
    def is_possible(self) -> bool:
        """False if no neck can be so: the daemon's forward kinematics has come to a solution upside down."""
        aside = self.pose["head_yaw"] - self.pose["body_yaw"]
        aside = abs(math.remainder(aside, math.tau))
        return (
            aside < FARTHEST_ASIDE
            and max(map(abs, (self.pose["head_pitch"], self.pose["head_roll"]))) < FARTHEST_OVER
        )


_decoder = msgspec.json.Decoder(_State)


def read(text: str | bytes) -> Measured:
    """Read a measurement. Raises Lost: it is none."""
    try:
        state = _decoder.decode(text)
    except msgspec.MsgspecError as error:
        reason = f"the daemon sends what is no measurement: {error}: {text[:80]!r}"
        raise Lost(Fault(reason=reason, advice=VERSION)) from error
    head = state.head_pose
    right, left = state.antennas_position
    pose = {
        "head_yaw": head.yaw, "head_pitch": -head.pitch, "head_roll": -head.roll, "body_yaw": state.body_yaw,
        "body_lean": lean(head.x, head.y, state.body_yaw), "right_antenna": right, "left_antenna": left,
    }  # fmt: skip
    return Measured(pose, state.control_mode)


def target(pose: Angles) -> str:
    """Write a target for all joints, radians."""
    x, y, z = head_place(pose)
    head = _Pose(x=x, y=y, z=z, roll=-pose["head_roll"], pitch=-pose["head_pitch"], yaw=pose["head_yaw"])
    antennas = (pose["right_antenna"], pose["left_antenna"])
    return msgspec.json.encode(
        _Target(target_head_pose=head, target_antennas=antennas, target_body_yaw=pose["body_yaw"])
    ).decode()


def trouble_of(measured: Measured) -> Fault | None:
    """Trouble that a measurement tells of; None: the robot can be moved."""
    if measured.mode != ENABLED:
        advice = (
            "switch them on, in the vendor's app or by POST /api/motors/set_mode/enabled; the robot then goes home"
        )
        return Fault(reason=f"the motors are {measured.mode.replace('_', ' ')}", advice=advice)
    if not measured.is_possible:
        advice = "its forward kinematics has lost itself, as after a jump of the head: restart it"
        return Fault(reason="the daemon measures a pose that no head can have", advice=advice)
    return None

"""Faults of the torso with physics, each a condition of its motors, gears and encoders, or of what it meets. Pure.

What comes of them (late, early, never) follows from torque, friction, contact and heat; no time is scripted.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

from msgspec.structs import replace

from engage_hri.schemas.body import FaultKind
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.units import Vector
from engage_hri.services.control.mujoco.model import AWAY, OBSTACLES
from engage_hri.services.control.mujoco.physics import WARM, Condition, Motor

SHARED = ("displaced", "mute", "voiceless", "lost")
"""Kinds that the simulated torso plays for it."""
OURS: Mapping[str, FaultKind] = {
    "slow": FaultKind(
        does="The gears are stiff with old grease: joints move at a share of their speed. Points come late, and what "
        "is tied to them waits.",
        on="part or joint", amount="factor of time at full speed", usual=2.0, low=1.0, high=20.0,
    ),
    "sticky": FaultKind(
        does="The gears stick until the motor pulls hard enough, and then slip: joints move by jerks.",
        on="part or joint", amount="share of the motor's torque that it takes to come loose", usual=0.25, high=2.0,
    ),
    "stalled": FaultKind(
        does="The motor is dead and its gear holds: the joint stands. A behavior that needs it fails by its name.",
        on="part or joint",
    ),
    "weak": FaultKind(
        does="The motor has a share of its torque: joints sag under what they carry. A behavior that cannot be held "
        "on target fails by the name of the joint.",
        on="part or joint", amount="share of its torque", usual=0.05, high=1.0,
    ),
    "hot": FaultKind(
        does="The motor starts hot and heats by the square of its torque: from 70 degrees Celsius on it gives less, "
        "at 85 nothing. A behavior fails by that.",
        on="part or joint", amount="times as fast as a good one that it heats", usual=300.0, low=1.0, high=10_000.0,
    ),
    "blocked": FaultKind(
        does="Something stands in the way: the part runs into it.", on="part", parts=tuple(OBSTACLES),
    ),
    "table": FaultKind(
        does="The table is higher than the body believes: arms run into it, as the arm of the thesis' robot did.",
        amount="metres", usual=0.06, high=0.15,
    ),
    "noisy": FaultKind(
        does="The encoders are noisy.", on="part or joint", amount="degrees, standard deviation", usual=0.3, high=5.0,
    ),
    "miscalibrated": FaultKind(
        does="The joint is beside the angle that it measures: looks and points are beside their targets, which "
        "people see and the body does not know.",
        on="part or joint", amount="degrees by which its true angle is greater", usual=4.0, low=-45.0, high=45.0,
    ),
}  # fmt: skip
"""What each kind does, and what else a fault of it says."""
KINDS = (*SHARED, *OURS)


def told(kinds: Iterable[str]) -> tuple[FaultKind, ...]:
    """Tell what some of our kinds do, for `Capabilities.fault_kinds`."""
    return tuple(replace(OURS[kind], kind=kind) for kind in kinds)


def conditions(
    faults: Iterable[BodyFault], motors: Mapping[str, Motor], parts: Mapping[str, str]
) -> dict[str, Condition]:
    """The condition of each motor that has a fault. parts: the part of each joint."""
    found: dict[str, Condition] = {}
    for fault in faults:
        for joint in joints(fault, motors, parts):
            found[joint] = _worse(found.get(joint, Condition()), fault, motors[joint])
    return found


def noise(faults: Iterable[BodyFault], motors: Sequence[str], parts: Mapping[str, str]) -> list[float]:
    """Standard deviation of each encoder, radians."""
    told = {
        joint: math.radians(amount(fault))
        for fault in faults
        if fault.kind == "noisy"
        for joint in joints(fault, motors, parts)
    }
    return [told.get(joint, 0.0) for joint in motors]


def obstacles(faults: Iterable[BodyFault]) -> dict[str, Vector]:
    """Place of each box that may stand in the way."""
    found: dict[str, Vector] = {}
    on = [fault for fault in faults if fault.kind == "blocked"]
    for part, boxes in OBSTACLES.items():
        is_there = any(fault.part in ("", part) for fault in on)
        for number, (place, _) in enumerate(boxes):
            found[f"obstacle {part} {number}"] = place if is_there else (3.0 + number, 0.0, AWAY)
    return found


def table_rise(faults: Iterable[BodyFault]) -> float:
    """Metres by which the table is higher than the body believes."""
    return max((amount(fault) for fault in faults if fault.kind == "table"), default=0.0)


def joints(fault: BodyFault, motors: Iterable[str], parts: Mapping[str, str]) -> list[str]:
    """The joints with a motor that a fault concerns."""
    return [each for each in motors if fault.part in ("", each, parts[each])]


def amount(fault: BodyFault) -> float:
    """Amount of a fault: the one that is given, else the usual one of its kind."""
    return fault.amount if fault.amount is not None else OURS[fault.kind].usual or 0.0


def _worse(condition: Condition, fault: BodyFault, motor: Motor) -> Condition:
    """A condition with one more fault."""
    match fault.kind:
        case "slow":
            return replace(condition, drag=motor.limit * amount(fault) / motor.speed)
        case "sticky":
            return replace(condition, stiction=motor.limit * amount(fault))
        case "stalled":
            return replace(condition, strength=0.0, friction=0.3 * motor.limit)
        case "weak":
            return replace(condition, strength=min(condition.strength, amount(fault)))
        case "hot":
            return replace(condition, heating=amount(fault), warm=WARM)
        case "miscalibrated":
            return replace(condition, offset=-math.radians(amount(fault)))
    return condition

"""Motors, gears, and the conditions that they can be in: the physics of faults. Pure."""

import math

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.units import Radians, Seconds

Array = NDArray[np.float64]

COLD = 25.0
"""Degrees Celsius of the room, and of a motor that has rested."""
WARM, HOT = 70.0, 85.0
"""Degrees Celsius: from the first on a motor gives less torque, at the second none."""
HEATING, COOLING = 0.02, 0.008
"""Kelvin per second for the limit of torque squared; share of the excess that goes per second."""


class Motor(Struct, frozen=True, kw_only=True):
    """Motor of a joint with its gear and its position servo.

    stiffness, damping: of the servo, N m/rad and N m s/rad. limit: the torque that it can give, N m.
    friction: of the gear, N m. drag: viscous friction, N m s/rad. armature: inertia of the rotor behind the gear,
    kg m2. speed: at which the joint moves in a lively motion, rad/s.
    """

    stiffness: float
    damping: float
    limit: float
    friction: float
    drag: float
    armature: float
    speed: float


class Condition(Struct, frozen=True, kw_only=True):
    """Faults of a motor, its gear and its encoder; none by default.

    strength: share of the torque that it can give. drag: further viscous friction, N m s/rad. friction, stiction:
    further friction, N m, always, and at rest. heating: how many times as fast it heats. warm: degrees Celsius that
    it has at least now. offset: by which the encoder is wrong.
    """

    strength: float = 1.0
    drag: float = 0.0
    friction: float = 0.0
    stiction: float = 0.0
    heating: float = 1.0
    warm: float = COLD
    offset: Radians = 0.0


def warmed(temperatures: Array, heating: Array, loads: Array, seconds: Seconds) -> Array:
    """Temperatures of motors after some time under a load.

    heating: how many times as fast each heats. loads: square of its torque, as a share of that of its limit.
    """
    ends = COLD + HEATING * 100.0 * heating * loads / COOLING
    return np.asarray(ends + (temperatures - ends) * math.exp(-COOLING * seconds))


def derating(temperatures: Array) -> Array:
    """Shares of the torque that motors of these temperatures can give."""
    return np.clip((HOT - temperatures) / (HOT - WARM), 0.0, 1.0)

"""Commands to position servos: the plan as long as joints follow it, else a way back to it within their limits. Pure.

A servo pulls a joint with all it has towards where it is told to be. If a joint has sagged, stands, or has been held
back, and its motor or its way comes back, that would be a jump. So a command is never farther from its joint than the
motor needs for its whole torque, and goes from there to the plan as slowly as joints may go.
"""

import numpy as np
from numpy.typing import NDArray

from engage_hri.schemas.units import Seconds

Array = NDArray[np.float64]

BRAKING = 0.5
"""Share of the acceleration for the way to the plan; the rest is for plans that accelerate meanwhile."""
THERE = 1e-5
"""Radians from the plan at which a command is on it."""


class Commands:
    """Commands of several servos. at: where each is told to be now, radians. rate: how fast that changes, rad/s."""

    def __init__(self, speeds: Array, accelerations: Array) -> None:
        """speeds, accelerations: at most, of each joint, rad/s and rad/s^2."""
        self.speeds, self.accelerations = speeds, accelerations
        self.at, self.rate = np.zeros(len(speeds)), np.zeros(len(speeds))
        self.plan = self.at.copy()
        """Where each was to be by the plan, last."""
        self._is_off = np.zeros(len(speeds), dtype=bool)
        """True for commands that are not on the plan."""
        self._change = 0.0

    def put(self, number: int, angle: float) -> None:
        """Put a command and its plan somewhere, at rest."""
        self.at[number] = self.plan[number] = angle
        self.rate[number] = 0.0
        self._is_off[number] = False

    def is_at_rest(self, plan: Array) -> bool:
        """True if neither the plan nor a command changes any more. One that waits for its joint does not change."""
        return self._change < 1e-9 and float(np.max(np.abs(plan - self.plan), initial=0.0)) <= 1e-9

    def ease(self, which: Array, angles: Array, speeds: Array) -> None:
        """Begin anew from the joints, as their motors or what holds them back have changed.

        which: true for each joint whose motor has; others that are not on their plan begin anew as well. angles: at
        which a servo carries its joint where it is.
        """
        self._change = 1.0
        self._is_off |= which
        which = self._is_off
        self.at = np.where(which, angles, self.at)
        self.rate = np.where(which, np.clip(speeds, -self.speeds, self.speeds), self.rate)

    def advance(
        self, plan: Array, seconds: Seconds, angles: Array, speeds: Array, reach: Array
    ) -> tuple[Array, Array]:
        """Go on for some seconds, at the end of which `plan` is to be reached. Returns commands now, and their rates.

        angles, speeds: of the joints now. reach: from a joint to a command at which its motor gives all it can.
        """
        before = self.at
        self._is_off |= np.abs(self.at - angles) > reach
        self._is_off |= np.abs(plan - self.at) > self.speeds * seconds * 1.001 + 1e-9
        if not self._is_off.any():
            now, self.rate, self.at = before, (plan - before) / seconds, plan.copy()
        else:
            now = np.where(self._is_off, np.clip(before, angles - reach, angles + reach), before)
            yields = np.clip(speeds, -self.speeds, self.speeds)
            back = self._rates(plan, seconds, now, np.where(now == before, self.rate, yields))
            on_plan = (plan - now) / seconds
            self.rate = np.where(self._is_off, back, on_plan)
            self.at = np.where(self._is_off, now + self.rate * seconds, plan)
            near = np.abs(plan - self.at) <= THERE
            self._is_off &= ~(
                near & (np.abs(self.rate * seconds - (plan - self.plan)) <= self.accelerations * seconds**2)
            )
        self.plan = plan.copy()
        self._change = float(np.max(np.abs(self.at - before), initial=0.0))
        return now, self.rate

    def _rates(self, plan: Array, seconds: Seconds, now: Array, rates: Array) -> Array:
        """The rates at which commands come to the plan, and can still brake there."""
        gap, brake = self.plan - now, BRAKING * self.accelerations
        steps = np.sqrt(0.25 + 2.0 * np.abs(gap) / (brake * seconds**2)) - 0.5
        closing = np.sign(gap) * np.minimum(steps * brake * seconds, np.abs(gap) / seconds)
        wanted = np.clip((plan - self.plan) / seconds + closing, -self.speeds, self.speeds)
        change = self.accelerations * seconds
        return np.asarray(np.clip(wanted, rates - change, rates + change))

"""Physics of a robot with position servos: its motors and their faults, the model, and what the encoders tell.

Time is an argument. The servos get a position for each instant, and with it its rate of change; between two it is a
straight line. That is the plan, or a way back to it (`commands`). What joints make of it is up to torque, inertia,
gravity, friction and contact.
"""

import math
from collections.abc import Mapping, Sequence

import mujoco
import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.units import Radians, Seconds, Vector
from engage_hri.services.control.mujoco.commands import Commands

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


ROUNDING: Seconds = 1e-6
STILL = math.radians(0.02)
"""rad/s: a joint that is slower stands."""
MOVING = math.radians(1.0)
"""rad/s from which on a joint is said to move."""
BEND: Radians = math.radians(0.15)
"""By which a sticky gear gives before it slips."""
SLIPPING, SLIP_SPEED = 0.3, math.radians(3.0)
"""Share of the friction that is left while a sticky gear slips; rad/s from which on it does."""
REACH, SPARE = 1.05, 0.002
"""Distance from a joint to its command at most, as a share of what makes its motor give all it can; radians more."""
STEPS_AT_ONCE = 50
"""Most steps in one call. A loop that was late catches up in several."""


class Contact(Struct, frozen=True):
    """A contact of the robot with a thing: the names of both geoms."""

    robot: str
    thing: str


class Physics:
    """A model in motion. joints: those with a motor, in the order of all arrays here.

    time: up to when it has been computed.
    """

    def __init__(
        self, model: mujoco.MjModel, motors: Mapping[str, Motor], limits: Mapping[str, JointLimit], *, at: Seconds,
        prefix: str = "", seed: int = 0,
    ) -> None:  # fmt: skip
        """model: with a position servo for each joint in `motors`, named like it, both with the prefix.

        limits: of speed and acceleration of each of these joints, as commands keep them.
        """
        self.model = model
        self.data = mujoco.MjData(model)
        self.joints = tuple(motors)
        self.motors = dict(motors)
        self.time = at
        self._noise = np.zeros(len(motors))
        self.conditions = {joint: Condition() for joint in motors}
        self.temperatures = np.full(len(motors), COLD)
        self._chance = np.random.default_rng(seed)
        self._error = np.zeros(len(motors))
        self._offset, self._corrected = np.zeros(len(motors)), np.zeros(len(motors))
        ids = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, prefix + joint) for joint in motors]
        self._q = np.array([model.jnt_qposadr[each] for each in ids], dtype=int)
        self._v = np.array([model.jnt_dofadr[each] for each in ids], dtype=int)
        servos = [mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, prefix + joint) for joint in motors]
        self._u = np.array(servos, dtype=int)
        self._lead = np.array([motor.damping / motor.stiffness for motor in motors.values()])
        self._drag = np.array([motor.drag for motor in motors.values()])
        self._most = np.array([motor.limit for motor in motors.values()], dtype=float)
        self._whole = self._most.copy()
        """Torques that the motors can give as long as they are not hot."""
        self._limit = self._whole
        self._strength, self._heating = np.ones(len(motors)), np.ones(len(motors))
        self._stick, self._bent = np.zeros(len(motors)), np.zeros(len(motors))
        self._friction = np.array([motor.friction for motor in motors.values()])
        self._stiffness = np.array([motor.stiffness for motor in motors.values()])
        own = [limits[joint] for joint in motors]
        self._commanded = self.data.ctrl
        self.commands = Commands(
            np.array([each.speed for each in own]), np.array([each.acceleration for each in own])
        )

    # -- state --------------------------------------------------------------------------------------------------

    def place(self, angles: Mapping[str, Radians]) -> None:
        """Put joints where their encoders tell these angles, at once and at rest."""
        for joint, angle in angles.items():
            number = self.joints.index(joint)
            self.commands.put(number, angle)
            self.data.qpos[self._q[number]] = angle - self._offset[number]
            self.data.qvel[self._v[number]] = 0.0
        mujoco.mj_forward(self.model, self.data)

    @property
    def angles(self) -> Array:
        """True joint angles."""
        return np.asarray(self.data.qpos[self._q])

    @property
    def measured(self) -> Array:
        """Joint angles as the encoders tell them."""
        return self.angles + self._error + self._offset

    @property
    def beside(self) -> dict[str, Radians]:
        """Radians by which true angles are more than measured ones, of joints of which they are not the same."""
        by = zip(self.joints, (self.angles - self.measured).tolist(), strict=True)
        return {joint: angle for joint, angle in by if abs(angle) > 1e-9}

    def told(self) -> Array:
        """Positions of the whole model, with joints where their encoders tell them."""
        qpos = np.array(self.data.qpos)
        qpos[self._q] = self.measured
        return qpos

    @property
    def speeds(self) -> Array:
        return np.asarray(self.data.qvel[self._v])

    @property
    def torques(self) -> Array:
        """Torques of the motors, N m."""
        return np.asarray(self.data.actuator_force[self._u])

    @property
    def quick(self) -> set[str]:
        """The joints that move."""
        return {joint for joint, speed in zip(self.joints, self.speeds.tolist(), strict=True) if abs(speed) > MOVING}

    def is_at_rest(self, reference: Array) -> bool:
        """True if nothing moves, and the plan does not, either."""
        if not self.commands.is_at_rest(reference) or np.max(np.abs(self.speeds), initial=0.0) > STILL:
            return False
        hot = bool((self.temperatures > WARM).any()) or any(each.heating > 1.0 for each in self.conditions.values())
        return not hot and float(np.max(np.abs(self.data.qvel), initial=0.0)) < 0.02

    def contacts(self) -> list[Contact]:
        """Contacts of the robot now."""
        found = []
        for each in self.data.contact[: self.data.ncon]:
            one, other = (int(geom) for geom in each.geom)
            if self.model.geom_contype[one] != 1:
                one, other = other, one
            if self.model.geom_contype[one] == 1:
                found.append(Contact(self.model.geom(one).name, self.model.geom(other).name))
        return found

    def complaints(self, joint: str) -> list[str]:
        """Complaints of the motor of a joint."""
        number = self.joints.index(joint)
        temperature, limit = self.temperatures[number], self._limit[number]
        if temperature > WARM + 1.0:
            return [f"its motor is overheated, {temperature:.0f} degrees Celsius"]
        if limit <= 0.0:
            return ["its motor gives no torque"]
        if abs(self.torques[number]) > 0.98 * limit:
            return [f"its motor gives all it can, {limit:.1f} N m"]
        return []

    # -- time ---------------------------------------------------------------------------------------------------

    def skip(self, to: Seconds) -> None:
        """Let time pass in which nothing moves: the motors cool."""
        self._heat(np.zeros(len(self.joints)), to - self.time)
        self.time = to

    def advance(self, to: Seconds, reference: Array) -> bool:
        """Compute up to `to`, at which the servos are to be at `reference`. False if that is not all done yet."""
        step = float(self.model.opt.timestep)
        count = math.floor((to - self.time + ROUNDING) / step)
        if count <= 0:
            return True
        steps = min(count, STEPS_AT_ONCE)
        reach = REACH * self._limit / self._stiffness + SPARE
        angles = self.angles + self._offset  # a servo believes its encoder
        if steps < count:  # the rest in further calls
            reference = self.commands.plan + (reference - self.commands.plan) * (steps / count)
        start, slope = self.commands.advance(reference, steps * step, angles, self.speeds, reach)
        servo, further = start - self._offset + self._lead * slope, slope * step
        is_sticky = bool(self._stick.any())
        for _ in range(steps):
            servo += further
            self._commanded[self._u] = servo
            if is_sticky:
                self._stick_or_slip(step)
            mujoco.mj_step(self.model, self.data)
        self.time += steps * step
        self._heat((self.torques / self._most) ** 2, steps * step)
        if self._noise.any():
            self._error = self._noise * self._chance.standard_normal(len(self.joints))
        return steps == count

    def _stick_or_slip(self, step: Seconds) -> None:
        """Friction of sticky gears: bristles that bend until they slip, and then hold less (LuGre).

        de Wit et al. 1995. MuJoCo's own friction of joints creeps under any torque, and so never sticks.
        """
        speeds, stiffness = self.speeds, self._stick / BEND
        holds = self._stick * (SLIPPING + (1.0 - SLIPPING) * np.exp(-((speeds / SLIP_SPEED) ** 2)))
        change = speeds - stiffness * np.abs(speeds) / np.maximum(holds, 1e-9) * self._bent
        self._bent = np.clip(self._bent + step * change, -BEND, BEND)
        torque = stiffness * self._bent + 0.003 * stiffness * change
        self.data.qfrc_applied[self._v] = -np.clip(torque, -self._stick, self._stick)

    def _heat(self, loads: Array, seconds: Seconds) -> None:
        """Warm the motors by the squares of the shares of their torques, and let a hot one give less."""
        self.temperatures = warmed(self.temperatures, self._heating, loads, seconds)
        is_hot = bool((self.temperatures > WARM).any())
        limit = self._whole * derating(self.temperatures) if is_hot else self._whole
        if limit is not self._limit and (np.abs(limit - self._limit) > 1e-9).any():
            self._limit = limit
            self.model.actuator_forcerange[self._u] = np.stack((-limit, limit), axis=1)

    # -- faults -------------------------------------------------------------------------------------------------

    def suffer(self, conditions: Mapping[str, Condition], noise: Sequence[Radians]) -> None:
        """Put motors and gears into these conditions; those of the others are as new.

        noise: of each encoder from the next step on, standard deviation.
        """
        self._noise, self._error = np.array(noise), np.zeros(len(self.joints))
        changed = [self.conditions[joint] != conditions.get(joint, Condition()) for joint in self.joints]
        for number, (joint, motor) in enumerate(self.motors.items()):
            condition = self.conditions[joint] = conditions.get(joint, Condition())
            self._drag[number] = motor.drag + condition.drag
            self._friction[number] = motor.friction + condition.friction
            self._stick[number] = condition.stiction
            self._strength[number], self._heating[number] = condition.strength, condition.heating
            if not condition.stiction:
                self._bent[number] = self.data.qfrc_applied[self._v[number]] = 0.0
            self._offset[number] = condition.offset + self._corrected[number]
            if condition.warm > self.temperatures[number]:
                self.temperatures[number] = condition.warm
            elif condition.heating <= 1.0:
                self.temperatures[number] = min(self.temperatures[number], COLD)
        self._whole = self._most * self._strength
        self.model.dof_damping[self._v] = self._drag
        self.model.dof_frictionloss[self._v] = self._friction
        self._heat(np.zeros(len(self.joints)), 0.0)
        self._ease(changed)

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        """Correct what encoders tell, and servos believe, of some joints; that of others stays as it is.

        offsets: by which a true angle is more than the encoder's.
        """
        before = self._corrected.copy()
        for joint, offset in offsets.items():
            number = self.joints.index(joint)
            self._offset[number] += offset - self._corrected[number]
            self._corrected[number] = offset
        self._ease((np.abs(self._corrected - before) > 1e-12).tolist())

    def _ease(self, changed: Sequence[bool]) -> None:
        """Begin the commands of these joints anew from where their encoders tell them, with the weight they carry."""
        weight = (self.data.qfrc_bias - self.data.qfrc_gravcomp)[self._v]
        carried = np.clip(weight, -self._limit, self._limit) / self._stiffness
        self.commands.ease(np.array(changed, dtype=bool), self.angles + self._offset + carried, self.speeds)

    def put(self, body: str, place: Vector) -> None:
        """Put a body that nothing moves (`mocap`) somewhere else."""
        self.data.mocap_pos[self.model.body(body).mocapid[0]] = place

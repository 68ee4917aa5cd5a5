"""A described robot in its room, in motion: the plan of each part, the physics, and the state that pictures show."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import Leg, Path, resting
from engage_hri.services.control.mujoco import faults
from engage_hri.services.control.mujoco.description import Description, PartDescription
from engage_hri.services.control.mujoco.physics import Array, Physics
from engage_hri.services.control.mujoco.pulse import Pulse
from engage_hri.services.control.mujoco.room import Room

Angles = Mapping[str, Radians]


class Stage:
    """Physics on loop time, and a planned motion for each part. measured: joint angles as the encoders tell them."""

    def __init__(
        self, described: Description, physics: Physics, limits: Mapping[str, tuple[JointLimit, ...]]
    ) -> None:
        """physics: of the described robot. limits: of the joints of each part."""
        self.physics = physics
        self.room = Room(physics)
        self.limits = limits
        self.parts = {joint: part for part, joints in limits.items() for joint in (limit.joint for limit in joints)}
        self.home = {joint: math.radians(described.home.get(joint, 0.0)) for joint in physics.joints}
        physics.place(self.home)
        self.safe_qpos = physics.data.qpos.copy()
        """The model in the safe pose."""
        self.measured: dict[str, Radians] = dict(self.home)
        self.pulse = Pulse(step=self._step, rise=physics.skip, after=self._is_at_rest)
        self._motions = {
            part: Motion(Path(resting([self.home[limit.joint] for limit in own]), (), own), 0.0)
            for part, own in limits.items()
        }

    def go(self, part: str, goal: Angles, seconds: Seconds) -> None:
        """Plan a motion of a part to a goal, from where its plan is now and as fast as that moves."""
        own, now = self.limits[part], self.pulse.now()
        leg = Leg(goal=tuple(goal[limit.joint] for limit in own), seconds=seconds)
        self._motions[part] = Motion(Path(self._motions[part].at(now), (leg,), own), now)
        self.pulse.wake()

    def planned(self, part: str, now: Seconds) -> dict[str, Radians]:
        """The planned angles of a part."""
        angles = self._motions[part].position(now).tolist()
        return {limit.joint: angle for limit, angle in zip(self.limits[part], angles, strict=True)}

    def is_moving(self, part: str) -> bool:
        """True if a part moves, by its plan or by what is measured."""
        joints = {limit.joint for limit in self.limits[part]}
        return self.pulse.now() < self._motions[part].end or not joints.isdisjoint(self.physics.quick)

    def angles(self, part: str) -> dict[str, Radians]:
        """The measured angles of a part, now."""
        self.pulse.step()
        return {limit.joint: self.measured[limit.joint] for limit in self.limits[part]}

    @property
    def qpos(self) -> Array:
        """The model as the encoders tell it."""
        return self.physics.told()

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        """Correct what these encoders tell by what a true angle is more."""
        self.pulse.step()
        self.physics.calibrate(offsets)
        self._measure()
        self.pulse.wake()

    def suffer(self, on: Sequence[BodyFault]) -> None:
        """Take exactly these faults from now on."""
        self.pulse.step()
        noise = faults.noise(on, self.physics.joints, self.parts)
        self.physics.suffer(faults.conditions(on, self.physics.motors, self.parts), noise)
        self._measure()
        self.pulse.wake()

    def suspicion(self, joint: str) -> str:
        """Tell what a joint that does not come has against it, as far as motor and contacts say."""
        touched = [each.thing for each in self.physics.contacts() if self.parts.get(joint, "").endswith("_arm")]
        return "; ".join(
            (*self.physics.complaints(joint), *(f"it is in contact with {thing}" for thing in touched[:1]))
        )

    def _reference(self, now: Seconds) -> Array:
        plan: dict[str, Radians] = {}
        for part in self._motions:
            plan.update(self.planned(part, now))
        return np.array([plan[joint] for joint in self.physics.joints])

    def _step(self, now: Seconds) -> bool:
        is_done = self.physics.advance(now, self._reference(now))
        self._measure()
        return is_done

    def _measure(self) -> None:
        self.measured = dict(zip(self.physics.joints, self.physics.measured.tolist(), strict=True))

    def _is_at_rest(self, now: Seconds) -> bool:
        is_planned = any(now < motion.end for motion in self._motions.values())
        return not is_planned and self.physics.is_at_rest(self._reference(now))


def limits_of(
    part: str, described: PartDescription, ranges: Mapping[str, tuple[Radians, Radians]]
) -> tuple[JointLimit, ...]:
    """Limits within which the motions of a part are planned."""
    return tuple(
        JointLimit(
            joint=joint, part=part, low=ranges[joint][0], high=ranges[joint][1], speed=math.radians(described.speed),
            acceleration=math.radians(described.acceleration),
        )
        for joint in described.joints
    )  # fmt: skip

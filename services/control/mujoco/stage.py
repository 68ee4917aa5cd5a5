"""Robots in their room, in motion: the plan, the physics that follows it, what is wrong, and what is measured."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from math import cos, sin

import mujoco
import numpy as np
from msgspec.structs import replace

from engage_hri.schemas.body import JointLimit
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.control.figure.kinematics import LIMIT
from engage_hri.services.control.motion.motion import Motion, Place, Track
from engage_hri.services.control.motion.path import Leg, Path
from engage_hri.services.control.mujoco import faults, model
from engage_hri.services.control.mujoco.model import THICKNESS
from engage_hri.services.control.mujoco.physics import Array, Contact, Physics
from engage_hri.services.control.mujoco.pulse import Pulse
from engage_hri.services.control.mujoco.robot import Description, PartDescription
from engage_hri.services.tangram.table import tangram_table

MOVED: Meters = 0.01
"""A piece that the world has this much elsewhere than before was moved by somebody."""


class Room:
    """The pieces on the table. rise: metres by which the table is higher than it seems."""

    def __init__(self, physics: Physics) -> None:
        self._physics = physics
        self._pieces = [piece.id for piece in tangram_table().pieces]
        self._seen: dict[str, Vector] = {}
        self.rise: Meters = 0.0

    def lay(self, world: World) -> None:
        """Lay the pieces where the world has them, as far as that has moved them since."""
        for entity in world.entities:
            before = self._seen.get(entity.id)
            if entity.id in self._pieces and (before is None or math.dist(before, entity.position) > MOVED):
                self._seen[entity.id] = entity.position
                self._put(entity)
        mujoco.mj_forward(self._physics.model, self._physics.data)

    def lift(self, rise: Meters) -> None:
        """Lift the pieces with the table."""
        for piece in self._pieces:
            self._physics.data.joint(piece).qpos[2] += rise - self.rise
        self.rise = rise
        mujoco.mj_forward(self._physics.model, self._physics.data)

    def _put(self, entity: Entity) -> None:
        joint = self._physics.data.joint(entity.id)
        x, y, z = entity.position
        half = entity.yaw / 2
        joint.qpos[:] = (x, y, z + self.rise + THICKNESS / 2, cos(half), 0.0, 0.0, sin(half))
        joint.qvel[:] = 0.0


Angles = Mapping[str, Radians]


class Stage(ABC):
    """A robot in its room, on loop time. measured: joint angles as the encoders tell them.

    parts: that of each joint.
    """

    def __init__(self, physics: Physics, parts: Mapping[str, str], home: Angles) -> None:
        """home: where the joints are placed."""
        self.physics, self.parts = physics, parts
        self.room = Room(physics)
        physics.place({joint: home[joint] for joint in physics.joints})
        self.pulse = Pulse(step=self._step, rise=physics.skip, after=self.is_at_rest)
        physics.time = self.pulse.now()
        self._measure()

    @abstractmethod
    def plan(self, now: Seconds) -> Angles:
        """Tell where the servos are to be."""

    @abstractmethod
    def touched(self, joint: str) -> Sequence[Contact]:
        """List what that moves with a joint is in contact with."""

    def is_at_rest(self, now: Seconds) -> bool:
        """True if nothing moves, and the plan does not, either."""
        return self.physics.is_at_rest(self._reference(now))

    def calibrate(self, offsets: Angles) -> None:
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
        touched = [f"it is in contact with {each.thing}" for each in self.touched(joint)]
        return "; ".join((*self.physics.complaints(joint), *touched[:1]))

    def _reference(self, now: Seconds) -> Array:
        plan = self.plan(now)
        return np.array([plan[joint] for joint in self.physics.joints])

    def _step(self, now: Seconds) -> bool:
        is_done = self.physics.advance(now, self._reference(now))
        self._measure()
        return is_done

    def _measure(self) -> None:
        self.measured = dict(zip(self.physics.joints, self.physics.measured.tolist(), strict=True))


class Workbench(Stage):
    """The torso at its table."""

    def __init__(self, plan: Callable[[Seconds], Angles], after: Callable[[Seconds], bool], seed: int = 0) -> None:
        """plan: where each joint is to be at an instant. after: as of `Pulse`."""
        self.model = mujoco.MjModel.from_xml_string(model.scene(tangram_table()))
        self._plan = plan
        physics = Physics(self.model, model.MOTORS, LIMIT, at=0.0, seed=seed)
        super().__init__(physics, {joint: LIMIT[joint].part for joint in model.MOTORS}, plan(0.0))
        self.pulse.after = after

    def plan(self, now: Seconds) -> Angles:
        return self._plan(now)

    def touched(self, joint: str) -> Sequence[Contact]:
        parts = {"left": "left_forearm", "right": "right_forearm", "neck": "nose", "torso": "belly"}
        own = parts.get(joint.partition("_")[0])
        return [each for each in self.physics.contacts() if each.robot == own]

    def calibrate(self, offsets: Angles) -> None:
        super().calibrate({joint: offsets.get(joint, 0.0) for joint in self.physics.joints})

    def suffer(self, on: Sequence[BodyFault]) -> None:
        super().suffer(on)
        for box, place in faults.obstacles(on).items():
            self.physics.put(box, place)
        by = faults.table_rise(on)
        if abs(by - self.room.rise) > 1e-9:  # the table is higher, with what lies on it, than the body believes
            x, y, top = tangram_table().surface.center
            self.physics.put("high table", (x, y, top + by - model.BOARD if by else model.AWAY))
            self.room.lift(by)


class DescribedStage(Stage):
    """A described robot, with a planned motion for each part."""

    def __init__(
        self, described: Description, physics: Physics, limits: Mapping[str, tuple[JointLimit, ...]]
    ) -> None:
        """physics: of the described robot. limits: of the joints of each part."""
        self.limits = limits
        self.home = {joint: math.radians(described.home.get(joint, 0.0)) for joint in physics.joints}
        self._tracks = {
            part: Track[Place](part, own, tuple(self.home[limit.joint] for limit in own))
            for part, own in limits.items()
        }
        super().__init__(physics, {each.joint: part for part, own in limits.items() for each in own}, self.home)
        self.safe_qpos = physics.data.qpos.copy()
        """The model in the safe pose."""

    def go(self, part: str, goal: Angles, seconds: Seconds) -> None:
        """Plan a motion of a part to a goal, from where its plan is now and as fast as that moves."""
        track, now = self._tracks[part], self.pulse.now()
        leg = Leg(goal=tuple(goal[joint] for joint in track.joints), seconds=seconds)
        track.play(Motion(Path(track.at(now), (leg,), track.own_limits), now))
        self.pulse.wake()

    def plan(self, now: Seconds) -> Angles:
        tracks = self._tracks.values()
        return {joint: at for each in tracks for joint, at in zip(each.joints, each.angles(now), strict=True)}

    def is_moving(self, part: str) -> bool:
        """True if a part moves, by its plan or by what is measured."""
        track = self._tracks[part]
        return track.is_moving(self.pulse.now()) or not self.physics.quick.isdisjoint(track.joints)

    def angles(self, part: str) -> dict[str, Radians]:
        """The measured angles of a part, now."""
        self.pulse.step()
        return {joint: self.measured[joint] for joint in self._tracks[part].joints}

    def touched(self, joint: str) -> Sequence[Contact]:
        return self.physics.contacts() if self.parts.get(joint, "").endswith("_arm") else ()

    def is_at_rest(self, now: Seconds) -> bool:
        return not any(track.is_moving(now) for track in self._tracks.values()) and super().is_at_rest(now)


def as_measured(limit: JointLimit, speed: float, acceleration: float) -> JointLimit:
    """Limits of what is measured of a joint that follows a plan: it swings a little beyond.

    speed, acceleration: as multiples of what is planned. The face is a screen, and is there.
    """
    if limit.part == "face":
        return limit
    low, high = limit.low - model.SLACK, limit.high + model.SLACK
    return replace(
        limit, low=low, high=high, speed=speed * limit.speed, acceleration=acceleration * limit.acceleration
    )  # fmt: skip


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

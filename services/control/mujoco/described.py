"""A robot that a description names, in MuJoCo: head and arms are ordinary bodies that share one physics."""

import math
from collections.abc import AsyncGenerator, AsyncIterator, Sequence
from contextlib import aclosing, asynccontextmanager
from copy import copy
from functools import lru_cache
from pathlib import Path

import msgspec
import mujoco
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Pointing, Wait
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, EstimateItem
from engage_hri.schemas.body_faults import BodyFault, refuse
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.composed import ComposedBody, Member
from engage_hri.services.control.bases.walk import wait
from engage_hri.services.control.contract.body import Body, MovementAuthority, Progress
from engage_hri.services.control.figure.estimates import wait_estimate
from engage_hri.services.control.mujoco.faults import OURS, told
from engage_hri.services.control.mujoco.film import Frame, filming, framed
from engage_hri.services.control.mujoco.ik import Chain
from engage_hri.services.control.mujoco.limbs import ArmLimb, HeadLimb, Limb
from engage_hri.services.control.mujoco.physics import Motor, Physics
from engage_hri.services.control.mujoco.robot import PREFIX, ArmDescription, Description, assembled, read
from engage_hri.services.control.mujoco.settings import MujocoSettings
from engage_hri.services.control.mujoco.stage import DescribedStage, as_measured, limits_of
from engage_hri.services.runtime.steps import Steps
from engage_hri.services.tangram.table import tangram_table

HEAD_TYPES = ("gaze", "gazeShift", "headDirectionShift", "head")
FAULTS = tuple(kind for kind in OURS if kind not in ("blocked", "table"))
"""Kinds of faults that a described robot plays."""


class DescribedBody(ComposedBody):
    """A robot by a description, with the parts that it has. Estimates are of the healthy robot."""

    def __init__(self, file: Path, settings: MujocoSettings | None = None) -> None:
        """file: its description. Raises InputRefused: that, its model, or a setting is wrong."""
        self._settings = settings or MujocoSettings()
        described, path = read(file)
        model, motors = _model(msgspec.json.encode(described), path, file)
        ranges = {joint: tuple(model.joint(PREFIX + joint).range.tolist()) for joint in motors}
        limits = {name: limits_of(name, part, ranges) for name, part in described.parts.items()}
        own = {limit.joint: limit for each in limits.values() for limit in each}
        physics = Physics(copy(model), motors, own, at=0.0, prefix=PREFIX, seed=self._settings.seed)
        self.stage = DescribedStage(described, physics, limits)
        self._limbs = _limbs(described, self.stage)
        super().__init__([Member(limb.part, limb, (limb.part,)) for limb in self._limbs])
        self.capabilities = _capabilities(described, self.stage, self.capabilities)
        self._faults: tuple[BodyFault, ...] = ()
        self.switch_faults(self._settings.faults)

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        film = filming(self.stage.physics.model, self._settings, self.frame, self.stage.pulse)
        async with super().connected(), film:
            yield

    def frame(self) -> Frame:
        """The robot as a film shows it now."""
        pointing = {limb.part: limb.points_at for limb in self._limbs if isinstance(limb, ArmLimb) and limb.points_at}
        return framed(
            self.stage.pulse.now(), self.stage.physics.data, self.state(), self.others_say(), self._world, pointing
        )

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        if isinstance(behavior, Wait):
            return wait_estimate(behavior, behavior.duration or 0.0, pose or self.state().pose)
        return super().estimate(behavior, pose, world)

    def rehearse_in_steps(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Steps[Sequence[Estimate]]:
        moving = [item for item in items if not isinstance(item.behavior, Wait)]
        told = iter((yield from super().rehearse_in_steps(moving, world, others)))
        return [
            self.estimate(item.behavior, item.pose, world) if isinstance(item.behavior, Wait) else next(told)
            for item in items
        ]

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        if (preparing := self.prepare([behavior])) is not None:
            await preparing
        performed = wait(behavior, authority) if isinstance(behavior, Wait) else super().perform(behavior, authority)
        async with aclosing(performed) as stream:
            async for progress in stream:
                yield progress

    def see(self, world: World) -> None:
        self.stage.pulse.step()
        super().see(world)
        self.stage.room.lay(world)
        self.stage.pulse.wake()

    @property
    def faults(self) -> tuple[BodyFault, ...]:
        return self._faults

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        refuse(faults, self.capabilities)
        self._faults = tuple(faults)
        self.stage.suffer(faults)

    def _able(self, behavior: BlockBehavior) -> list[Member]:
        """Members that can do a behavior by its type; of two arms the nearer to what it points at is first."""
        able = super()._able(behavior)
        target = self._world.entity(behavior.target) if isinstance(behavior, Pointing) else None
        if target is not None:
            able.sort(key=lambda member: _shoulder(member.body, target.position))
        return able


@lru_cache(8)
def _model(described: bytes, path: Path, file: Path) -> tuple[mujoco.MjModel, dict[str, Motor]]:
    """The model of a described robot at the table. To compile one of forty meshes takes half a second."""
    return assembled(msgspec.json.decode(described, type=Description), path, tangram_table(), file)


def _shoulder(body: Body, target: tuple[float, float, float]) -> Seconds:
    assert isinstance(body, Limb)
    return math.dist(body.axis(body.rest).origin, target)


def _limbs(described: Description, stage: DescribedStage) -> list[Limb]:
    """The parts that move on their own. Joints of a torso only hold."""
    model, found = stage.physics.model, list[Limb]()
    if (head := described.head) is not None:
        chain = Chain(model, head.joints, head.eyes, prefix=PREFIX)
        found.append(HeadLimb(stage, "head", stage.limits["head"], chain, HEAD_TYPES, described.name))
    for part, arm in described.parts.items():
        if isinstance(arm, ArmDescription):
            chain = Chain(model, arm.joints, arm.elbow, arm.hand, prefix=PREFIX)
            limb = ArmLimb(stage, part, stage.limits[part], chain, ("pointing",), described.name)
            limb.reach = described.reach  # type: ignore[misc]
            found.append(limb)
    return found


def _capabilities(described: Description, stage: DescribedStage, of_parts: Capabilities) -> Capabilities:
    joints = tuple(as_measured(limit, 1.4, 6.0) for own in stage.limits.values() for limit in own)
    return replace(
        of_parts,
        body=described.name,
        types=(*of_parts.types, "wait"),
        joints=joints,
        reach=described.reach if "pointing" in of_parts.types else 0.0,
        faults=FAULTS,
        fault_kinds=told(FAULTS),
    )

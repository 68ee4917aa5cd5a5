"""Bodies that move, measure or predict as they should not: for laws of the contract. See `test_liars.py`."""

import asyncio
import math
import time
from collections.abc import AsyncGenerator, Iterable, Iterator
from contextlib import aclosing
from random import Random
from select import select

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, Head, Pose
from engage_hri.schemas.body import BodyPose, Estimate, JointAngle
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import (
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    Reached,
)
from engage_hri.services.control.figure import kinematics
from engage_hri.services.control.torso.body import SimulatedBody
from tests.control.liars import Teller


def shown(state: BodyState, angles: Iterable[JointAngle]) -> BodyState:
    """The state of a torso whose joints are there."""
    pose = {each.joint: each.angle for each in angles}
    return replace(
        state, pose=kinematics.pose_message(pose), gaze=kinematics.gaze(pose),
        left_arm=kinematics.arm(pose, "left"), right_arm=kinematics.arm(pose, "right"),
    )  # fmt: skip


# -- what is measured ---------------------------------------------------------------------------------------------


class Noisy(SimulatedBody):
    """Measures its joints by encoders that scatter by 0.3 degrees; elsewhere this is an honest body."""

    deviation = math.radians(0.3)

    def __init__(self, **settings: object) -> None:
        super().__init__(**settings)  # type: ignore[arg-type]
        self._chance = Random(5)

    def state(self) -> BodyState:
        state = super().state()
        angles = [
            JointAngle(each.joint, each.angle + self._chance.gauss(0.0, self.deviation)) for each in state.pose.joints
        ]
        return shown(state, angles)


class Trembling(SimulatedBody):
    """Swings by a degree wherever it stands."""

    def state(self) -> BodyState:
        state = super().state()
        swing = math.radians(1.0) * math.sin(self._loop.time())
        return shown(state, [JointAngle(each.joint, each.angle + swing) for each in state.pose.joints])


class Abrupt(SimulatedBody):
    """Stops dead when it is held, and is elsewhere at once when it goes on."""

    authority: MovementAuthority | None = None
    stopped: BodyState | None = None

    def perform(self, behavior, authority):
        self.authority = authority
        return super().perform(behavior, authority)

    def state(self) -> BodyState:
        if self.authority is None or not self.authority.held:
            self.stopped = None
            return super().state()
        self.stopped = self.stopped or super().state()
        return self.stopped


class Understating(SimulatedBody):
    """Moves faster than it says that it can."""

    def __init__(self) -> None:
        super().__init__()
        slower = tuple(replace(each, speed=each.speed / 3) for each in self.capabilities.joints)
        self.capabilities = replace(self.capabilities, joints=slower)


class Unmoved(SimulatedBody):
    """Says that it stands, whatever it does."""

    def state(self) -> BodyState:
        return replace(super().state(), moving=False)


class Expressionless(SimulatedBody):
    """Has a face that never moves."""

    def state(self) -> BodyState:
        state = super().state()
        face = {limit.joint for limit in self.capabilities.joints if limit.part == "face"}
        return shown(
            state, [each if each.joint not in face else JointAngle(each.joint, 0.0) for each in state.pose.joints]
        )


class Stiff(SimulatedBody):
    """Has a neck that never moves."""

    def state(self) -> BodyState:
        state = super().state()
        angles = (replace_angle(each, 0.0) if each.joint.startswith("neck") else each for each in state.pose.joints)
        return shown(state, angles)


def replace_angle(angle: JointAngle, by: float) -> JointAngle:
    return JointAngle(angle.joint, by)


class Jointless(SimulatedBody):
    """Does not measure a joint that it has."""

    def state(self) -> BodyState:
        state = super().state()
        return replace(state, pose=BodyPose(joints=state.pose.joints[1:]))


# -- where it ends ------------------------------------------------------------------------------------------------


class Clinging(SimulatedBody):
    """Takes nobody home from a behavior whose task was cancelled."""

    is_dropped = False

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        async with aclosing(super().perform(behavior, MovementAuthority(behavior, "end"))) as stream:
            try:
                async for progress in stream:
                    yield progress
            except (GeneratorExit, asyncio.CancelledError):
                self.is_dropped = True
                raise

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if not self.is_dropped:
            await super().home(parts)


class Homeless(SimulatedBody):
    """Says that it is at home as it sets out."""

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        self.going = asyncio.create_task(super().home(parts), name="way home")
        await asyncio.sleep(0)


class Wandering(SimulatedBody):
    """Leaves the safe pose again, two seconds after it was called there from something."""

    calls = 0

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        await super().home(parts)
        self.calls += 1
        if self.calls > 1:
            self.tour = asyncio.create_task(self.look_around(), name="tour")

    async def look_around(self) -> None:
        await asyncio.sleep(2.0)
        shift = GazeShift(id="tour", target="far-left")
        async for _ in self.perform(shift, MovementAuthority(shift, "end")):
            pass


class Ticking(SimulatedBody):
    """Looks at its joints for ever, once it has moved."""

    def perform(self, behavior, authority):
        self.tick()
        return super().perform(behavior, authority)

    def tick(self) -> None:
        self._loop.call_later(0.05, self.tick)


class Obliging(SimulatedBody):
    """Does something else where it does not know the target."""

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        return super().estimate(self._known(behavior), pose, world)

    def perform(self, behavior, authority):
        return super().perform(self._known(behavior), authority)

    def _known(self, behavior: BlockBehavior) -> BlockBehavior:
        return replace(behavior, target="human") if getattr(behavior, "target", "") == "nothing" else behavior


class Greedy(SimulatedBody):
    """Moves the head for a shift though a look has it."""

    def set_out(self, behavior, authority):
        if isinstance(behavior, GazeShift):
            self.moves.is_overlaid = lambda: False
        try:
            return super().set_out(behavior, authority)
        finally:
            self.moves.__dict__.pop("is_overlaid", None)


# -- what is predicted --------------------------------------------------------------------------------------------


class Optimistic(SimulatedBody):
    """Takes twice as long as it says."""

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        told = super().estimate(behavior, pose, world)
        phases = (replace(each, natural=each.natural / 2, shortest=each.shortest / 2) for each in told.phases)
        return replace(told, phases=tuple(phases))


class Eager(SimulatedBody):
    """Moves when it is asked what it would do."""

    asked = 0

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        self.asked += 1
        return super().estimate(behavior, pose, world)

    def state(self) -> BodyState:
        state, turned = super().state(), math.radians(0.5) * self.asked
        return shown(state, (JointAngle(each.joint, each.angle + turned) for each in state.pose.joints))


class Staying(SimulatedBody):
    """Says that it is on target where it is now."""

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        return replace(super().estimate(behavior, pose, world), pose_after=pose or self.state().pose)


class Remaining(SimulatedBody):
    """Says that it stays on target at the end."""

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        told = super().estimate(behavior, pose, world)
        return replace(told, pose_end=told.pose_after)


class Present(SimulatedBody):
    """Estimates from where it is, wherever it is asked about."""

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        return super().estimate(behavior, None, world)


class Posing(SimulatedBody):
    """Has a type in its capabilities that it cannot do."""

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        told = super().estimate(behavior, pose, world)
        return replace(told, feasible=False, fault=Fault(reason="no poses")) if isinstance(behavior, Pose) else told


# -- with a fault -------------------------------------------------------------------------------------------------


class Stalled(SimulatedBody):
    """Has a neck that stops after 150 ms, and tells its points by the clock."""

    frozen: BodyState | None = None

    def state(self) -> BodyState:
        state = super().state()
        if self._loop.time() < 0.15:
            return state
        self.frozen = self.frozen or state
        return replace(self.frozen, moving=state.moving)


class Unnamed(Teller):
    """Fails without a reason."""

    def finish(self, behavior: BlockBehavior, authority: MovementAuthority) -> Iterator[Progress]:
        if isinstance(behavior, Head):
            raise BodyFailed(Fault(reason=""))
        return iter(())


class Raw(Teller):
    """Lets an error of its SDK out."""

    def tell(self, behavior, authority, progress):
        if isinstance(behavior, Head):
            raise ConnectionResetError("peer is gone")
        return (progress,)


class Unending(Teller):
    """Cannot be aborted once its motor stands."""

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        points = sync_points(behavior)
        if not isinstance(behavior, Gaze):
            async with aclosing(super().perform(behavior, authority)) as stream:
                async for progress in stream:
                    yield progress
            return
        now = self._loop.time()
        yield Reached(points[0], now, now)
        await asyncio.Event().wait()


class Blocking(Teller):
    """Waits for its motors in a call that blocks, as of a serial port."""

    def tell(self, behavior, authority, progress):
        if isinstance(behavior, Head):
            select([], [], [], 0.03)  # seconds in which nothing comes, as on a port
        return (progress,)


class Pondering(Teller):
    """Computes for long at a stretch."""

    def tell(self, behavior, authority, progress):
        if isinstance(behavior, Head):
            until = time.thread_time() + 0.03
            while time.thread_time() < until:
                pass
        return (progress,)

"""Bodies that lie, or do not do what they should: for each law of the contract at least one. See `test_liars.py`."""

import asyncio
import math
from collections.abc import AsyncGenerator, Iterable, Iterator
from contextlib import aclosing
from random import Random

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior, FaceLexeme, Gaze, GazeShift, Head, Pose, Speech
from engage_hri.schemas.body import BodyPose, Estimate, JointAngle
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.world import World
from engage_hri.services.control.body import (
    Arrived,
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    Reached,
    Spoke,
)
from engage_hri.services.control.torso import kinematics
from engage_hri.services.control.torso.body import SimulatedBody


def shown(state: BodyState, angles: Iterable[JointAngle]) -> BodyState:
    """The state of a torso whose joints are there."""
    pose = {each.joint: each.angle for each in angles}
    return replace(
        state, pose=kinematics.pose_message(pose), gaze=kinematics.gaze(pose),
        left_arm=kinematics.arm(pose, "left"), right_arm=kinematics.arm(pose, "right"),
    )  # fmt: skip


class Teller(SimulatedBody):
    """Moves as it should, and tells what `tell` makes of it."""

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        async with aclosing(super().perform(behavior, self.heard(behavior, authority))) as stream:
            async for progress in stream:
                for told in self.tell(behavior, authority, progress):
                    yield told
        for told in self.finish(behavior, authority):
            yield told

    def heard(self, behavior: BlockBehavior, authority: MovementAuthority) -> MovementAuthority:
        return authority

    def tell(self, behavior: BlockBehavior, authority: MovementAuthority, progress: Progress) -> Iterable[Progress]:
        return (progress,)

    def finish(self, behavior: BlockBehavior, authority: MovementAuthority) -> Iterable[Progress]:
        return ()


# -- what is told -------------------------------------------------------------------------------------------------


class Omitting(Teller):
    """Leaves a point out."""

    def tell(self, behavior, authority, progress):
        return () if isinstance(progress, Reached) and progress.sync == "relax" else (progress,)


class Repeating(Teller):
    """Tells a point twice."""

    def tell(self, behavior, authority, progress):
        return (progress, progress) if isinstance(progress, Reached) and progress.sync == "ready" else (progress,)


class Backdating(Teller):
    """Tells times that are 200 ms before the report."""

    def tell(self, behavior, authority, progress):
        return (replace(progress, at=progress.at - 0.2),)


class Hesitating(Teller):
    """Says that it waits where it may pass."""

    def tell(self, behavior, authority, progress):
        is_hold = isinstance(progress, Reached) and progress.sync in ("stroke", "stroke_start")
        return (Arrived(progress.sync, progress.at), progress) if is_hold else (progress,)


class Splitting(Teller):
    """Makes two of an instant."""

    def tell(self, behavior, authority, progress):
        is_split = isinstance(progress, Reached) and progress.sync == "stroke_end"
        return (replace(progress, at=progress.at - 0.01),) if is_split else (progress,)


class Boaster(Teller):
    """Says of what is taken over that it was made."""

    def tell(self, behavior, authority, progress):
        self.told = {} if isinstance(progress, Reached) and progress.sync == "start" else getattr(self, "told", {})
        if isinstance(progress, Reached):
            self.told.setdefault(behavior.id, set()).add(progress.sync)
        return (progress,)

    def finish(self, behavior, authority):
        now = self._loop.time()
        left = [each for each in authority.points if each not in self.told.get(behavior.id, ())]
        return [Reached(sync, now, now) for sync in left if authority.revoked == "taken_over"]


class Early(Teller):
    """Says that it looks as soon as it begins to turn."""

    def tell(self, behavior, authority, progress):
        if isinstance(behavior, Gaze) and isinstance(progress, Reached):
            if progress.sync == "stroke_start":
                return progress, Reached("stroke", progress.at, progress.at)
            if progress.sync == "stroke":
                return ()
        return (progress,)


class Prompter(Teller):
    """Tells all words as it begins."""

    def tell(self, behavior, authority, progress):
        if not isinstance(behavior, Speech) or not isinstance(progress, Reached) or progress.sync != "start":
            return () if isinstance(progress, Spoke) else (progress,)
        ends, position = [], 0
        for word in behavior.text.split():
            position = behavior.text.index(word, position) + len(word)
            ends.append(Spoke(word, position, progress.at))
        return progress, *ends


class Counting(Teller):
    """Counts words where characters are asked for."""

    def tell(self, behavior, authority, progress):
        if isinstance(progress, Spoke):
            count = len(behavior.text[: progress.position].split())
            return (replace(progress, position=count),)
        return (progress,)


class Stammering(Teller):
    """Says a word again after a pause."""

    last: Spoke | None = None

    def tell(self, behavior, authority, progress):
        if not isinstance(progress, Spoke):
            return (progress,)
        again = [self.last] if self.last and progress.at - self.last.at > 3.0 else []
        self.last = progress
        return (*again, progress)


class Forgetful(Teller):
    """Forgets the end of a shift over which a look has come."""

    has_looked = False

    def tell(self, behavior, authority, progress):
        is_end = isinstance(behavior, GazeShift) and isinstance(progress, Reached) and progress.sync == "end"
        self.has_looked = self.has_looked or isinstance(behavior, Gaze)
        return () if is_end and self.has_looked else (progress,)


# -- what is heard ------------------------------------------------------------------------------------------------


class Relay(MovementAuthority):
    """The authority that a body acts on instead of the one that it is given."""

    def __init__(self, behavior: BlockBehavior, given: MovementAuthority) -> None:
        super().__init__(behavior, given.through, given.pace)
        self.given = given
        self.began = asyncio.get_running_loop().time()
        self.is_waiting = False
        given.watch(self.hear)
        self.watch(lambda: self.revoked == "taken_over" and given.revoke("taken_over"))
        self.hear()

    def hear(self) -> None:
        given = self.given
        self.set_pace(given.pace)
        self.hear_through()
        self.hear_hold()
        if given.revoked is not None:
            self.hear_end()

    def hear_through(self) -> None:
        self.extend(self.given.through)

    def hear_hold(self) -> None:
        self.hold() if self.given.held else self.go_on()

    def hear_end(self) -> None:
        self.revoke(self.given.revoked)


class Hearing(Teller):
    """Hears what `Relay` lets through."""

    relay: type[Relay] = Relay

    def heard(self, behavior, authority):
        self.last = self.relay(behavior, authority)
        return self.last

    def tell(self, behavior, authority, progress):
        self.last.is_waiting = isinstance(progress, Arrived)
        return (progress,)


class Deaf(Hearing):
    """Goes on to its end when it is aborted."""

    class relay(Relay):
        def hear_end(self):
            pass


class Stubborn(Hearing):
    """Does not hear an abort while it waits."""

    class relay(Relay):
        def hear_end(self):
            if not self.is_waiting:
                super().hear_end()


class Hasty(Hearing):
    """Asks for no authority."""

    class relay(Relay):
        def hear_through(self):
            self.extend(self.points[-1])


class Restless(Hearing):
    """Cannot be held."""

    class relay(Relay):
        def hear_hold(self):
            pass


class Released(Hearing):
    """Takes a permission for the end of a hold."""

    class relay(Relay):
        def hear_hold(self):
            self.hold() if self.given.held and self.given.through != "end" else self.go_on()


class Presuming(Hearing):
    """Takes the end of a hold for a permission."""

    class relay(Relay):
        was_held = False

        def hear_through(self):
            super().hear_through()
            if self.was_held and not self.given.held:
                self.extend(self.points[-1])
            self.was_held = self.given.held


class Pacing(Hearing):
    """Takes a pace for the end of a hold."""

    class relay(Relay):
        def hear_hold(self):
            self.hold() if self.given.held and not self.given.pace else self.go_on()


class Inattentive(Hearing):
    """Cannot be held once it has moved for a while."""

    class relay(Relay):
        def hear_hold(self):
            if asyncio.get_running_loop().time() < self.began + 0.1:
                super().hear_hold()


class Possessed(Hearing):
    """Does not hear how it ends while it is held."""

    class relay(Relay):
        def hear_end(self):
            if not self.given.held:
                super().hear_end()


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

    def perform(self, behavior, authority):
        return (
            self._move(behavior, authority)
            if isinstance(behavior, GazeShift)
            else super().perform(behavior, authority)
        )


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
        if isinstance(behavior, FaceLexeme):
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

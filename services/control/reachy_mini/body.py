"""Reachy Mini as a body: a head that looks and nods, a base that turns, and antennas in place of a face.

Its plan is laid here and sent through the daemon, a target for each measurement. A sync point is reported when the
plan has come there *and* the daemon measures the joints there: never because a planned time is over.
"""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Iterator, Mapping, Sequence
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager
from math import degrees, inf
from typing import ClassVar, Self

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Wait
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate
from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.walk import WalkingBody
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.bell import Bell
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    TakenOver,
)
from engage_hri.services.control.contract.extras import Idle
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import choreography
from engage_hri.services.control.figure.estimates import wait_estimate
from engage_hri.services.control.motion.points import WalkPoint
from engage_hri.services.control.reachy_mini import courses, geometry, joints, messages
from engage_hri.services.control.reachy_mini.estimates import motion_estimate
from engage_hri.services.control.reachy_mini.idling import Idling, together
from engage_hri.services.control.reachy_mini.link import Daemon, Link
from engage_hri.services.control.reachy_mini.messages import Measured
from engage_hri.services.control.reachy_mini.moving import GAP, Moves
from engage_hri.services.control.reachy_mini.runs import Run
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings
from engage_hri.services.control.reachy_mini.tracks import Off, busy
from engage_hri.services.control.reachy_mini.watching import Rate, Watch, slow
from engage_hri.services.control.voice import speaking

RESTS_ON = 2.0
"""The eyes rest on what they look at within this many times the angle that counts as on target."""

Connect = Callable[[ReachyMiniSettings], AbstractAsyncContextManager[Daemon]]


class ReachyMini(WalkingBody[Run]):
    """Reachy Mini through its daemon. Without `connected()` it answers for a robot at rest: `engage plan` asks so."""

    Settings: ClassVar[type[Struct]] = ReachyMiniSettings
    carries: ClassVar[Mapping[str, tuple[str, ...]]] = {"torso": ("head",)}

    def __init__(
        self, settings: ReachyMiniSettings | None = None, connect: Connect | None = None, *, alive: bool = False
    ) -> None:
        """Make the body; `connected()` then finds the robot.

        settings: of `control.drivers.reachy_mini`. connect: opens a connection; by default to `settings.url`.
        alive: it breathes, and its antennas sway.
        """
        super().__init__()
        self._settings = settings or ReachyMiniSettings()
        self._connect = connect
        types = (*courses.TYPES_OF_BEHAVIORS, Wait)
        self.capabilities = Capabilities(
            body="reachy_mini", types=tuple(map(type_name, types)), parts=("head", "torso", "face"),
            joints=joints.LIMITS,
        )  # fmt: skip
        self._moves = Moves(self._settings)
        self._idling = Idling(self._settings.lag, is_alive=alive)
        self._idle: dict[str, Radians] = {}
        """What is added to the joints by themselves, as it was sent last."""
        self._link: Link | None = None
        self._bells: set[Bell] = set()
        """Of those who wait for tracks to come home."""
        self._sent = ""
        self._last_frame: Seconds = -inf
        self._rate = Rate(GAP)
        self._rests_since: Seconds = -inf
        """End of the plan whose last command has been sent; -inf: it is under way."""

    @classmethod
    def configured(cls, config: ControlConfig, settings: ReachyMiniSettings | None) -> Self:
        return cls(settings, alive=config.alive)

    # -- connection ---------------------------------------------------------------------------------------------

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        connect = self._connect or _over_the_network
        link = Link(
            lambda: connect(self._settings), self._settings.silence, on_measured=self._answer,
            on_trouble=self._be_lost, on_back=self._be_back,
        )  # fmt: skip
        keeping = asyncio.create_task(link.keep(), name="link to reachy mini")
        keeping.add_done_callback(lambda task: link.has_news.set())
        try:
            await link.has_news.wait()
            if keeping.done():
                keeping.result()
            if link.trouble is not None:
                raise RunFailed(link.trouble)
            self._link = link
            try:
                await self.home()
            except BodyFailed as failed:
                raise RunFailed(failed.fault) from failed
            yield
        finally:
            self._link = None
            keeping.cancel()
            await asyncio.gather(keeping, return_exceptions=True)

    def _answer(self, measured: Measured) -> str | None:
        """Take a measurement, and answer it with where the joints are to be now; None: where they were sent."""
        now = self._loop.time()
        self._moves.measured = self._idling.off(measured.pose, now)
        if now - self._last_frame > GAP:
            self._moves.stand(self._last_frame, now)
        self._last_frame = now
        was_slow = self._rate.is_slow
        if (rate := self._rate.fallen(now)) is not None:
            self.on_fault(slow(rate, GAP))
        elif was_slow and not self._rate.is_slow:
            self.on_recovery("reachy_mini: the daemon sends enough measurements again")
        self._ring()
        is_corrected, commanded = self._moves.correct(now), self._moves.commanded(now)
        idle, self._idle = (
            self._idle,
            self._idling.added(now, commanded, busy(self._moves.tracks, self._moves.runs, now)),
        )
        if not is_corrected and self._rests_since == self._moves.end and idle == self._idle:
            return None
        end = self._moves.end
        self._rests_since = end if now >= end else -inf
        text = messages.target(together(commanded, self._idle))
        self._sent, before = text, self._sent
        return text if text != before else None

    def _ring(self) -> None:
        """Wake all that wait for measurements."""
        for bell in [*self._bells, *(run.bell for run in self._moves.runs.values())]:
            bell.ring()

    def _be_lost(self, fault: Fault) -> None:
        if self._link is not None:
            self.on_fault(fault)
        self._ring()

    def _be_back(self, measured: Measured) -> None:
        """Begin anew from where the joints are, and go home from there."""
        if self._link is not None:
            self.on_recovery("reachy_mini: it can be moved again, and goes home")
        now = self._loop.time()
        self._idling.stop()
        self._moves.measured, self._idle = measured.pose, {}
        self._last_frame, self._sent, self._rests_since = now, "", -inf
        self._rate = Rate(GAP)
        for run in list(self._moves.runs.values()):  # it has failed, and is just about to say so
            self._moves.release(run)
        self._moves.rebase(joints.TRACKS)
        self._moves.settle(now)
        self._moves.relax(joints.TRACKS, now)

    @property
    def _trouble(self) -> Fault | None:
        return self._link.trouble if self._link is not None else None

    # -- the contract -------------------------------------------------------------------------------------------

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        now = self._loop.time()
        given = {each.joint: each.angle for each in pose.joints} if pose is not None else None
        around = self._moves.circumstances(now, world, given)
        if isinstance(behavior, Wait):
            here = joints.message(joints.summed(around.tracks))
            return wait_estimate(behavior, behavior.duration or 0.0, here)
        try:
            if (trouble := self._trouble) is not None:
                raise Impossible("CANNOT_CREATE_BEHAVIOR", trouble.reason, trouble.advice)
            course = courses.course(behavior, around)
            start = None if given is None else around.tracks[course.parts[0]]
            path = self._moves.path(course, now, start)
            return motion_estimate(behavior, course, path, around, self._moves, self._settings.lag)
        except Impossible as impossible:
            return impossible.estimate(behavior)

    def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        return speaking.wait(behavior, authority) if isinstance(behavior, Wait) else self.walk(behavior, authority)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        names = [name for name, part in joints.PARTS.items() if not parts or part in parts]
        for run in [self._moves.runs[name] for name in names if name in self._moves.runs]:
            self._moves.release(run)
            run.authority.revoke()
        self._moves.rebase(names)
        self._moves.relax(names, self._loop.time())
        watches = {name: Watch(self._settings.patience) for name in names}
        with self._bell() as bell:
            while names := [name for name in names if not self._is_home(name, watches[name])]:
                if taken := sorted({joints.PARTS[name] for name in names if name in self._moves.runs}):
                    raise TakenOver(taken)
                await bell.wait(inf if self._link is not None else self._loop.time())
                if self._link is None:
                    return
                if self._trouble is not None:  # it goes home by itself once it is back
                    watches = {name: Watch(self._settings.patience) for name in names}

    def state(self) -> BodyState:
        pose = self._moves.measured
        return BodyState(
            pose=joints.message(pose), gaze=geometry.gaze(pose, self._moves.mounting), moving=self._is_moving(),
            looking_at=self._looking_at(),
        )  # fmt: skip

    def idle(self) -> Idle:
        return Idle(added=self._idling.shown)

    def see(self, world: World) -> None:
        self._moves.see(world, self._loop.time())

    # -- behaviors ----------------------------------------------------------------------------------------------

    def set_out(self, behavior: BlockBehavior, authority: MovementAuthority) -> Run:
        if (trouble := self._trouble) is not None:
            raise BehaviorRefused(replace(trouble, where=behavior.id))
        now, moves = self._loop.time(), self._moves
        course = courses.course(behavior, moves.circumstances(now, moves.world))
        run = Run(behavior, course, authority, self._settings.patience)
        if choreography.is_shift(behavior) and moves.is_overlaid():
            run.is_beneath = True
            moves.set_base(run)
            moves.follow(now)
        else:
            moves.take_over(run, now)
        return run

    def leave(self, run: Run, point: WalkPoint, *, has_waited: bool) -> Sequence[str]:
        run.look_anew()
        return self._moves.leave(run, self._loop.time(), has_waited=has_waited)

    def owns(self, run: Run) -> bool:
        return self._moves.owns(run)

    def release(self, run: Run) -> None:
        self._moves.release(run)

    def abandon(self, run: Run) -> None:
        self._moves.abandon(run, self._loop.time())

    def check(self, run: Run) -> None:
        if (trouble := self._trouble) is not None and (run.authority.revoked is None or not self.owns(run)):
            raise BodyFailed(replace(trouble, where=run.behavior.id))

    def due(self, run: Run, point: WalkPoint) -> Seconds | None:
        due, now = run.due(point), self._loop.time()
        if point.sync != run.course.arrival or not self._moves.follows(run, now):
            return due
        # The plan after a target that moves is laid anew again and again, and never over: what counts is the gaze.
        return self._last_frame if self.has_come(run, point) else due

    def has_come(self, run: Run, point: WalkPoint) -> bool:
        return run.is_start(point.sync) or self._moves.off_run(run, point.sync, self._loop.time()).share <= 1.0

    async def come(self, run: Run, point: WalkPoint, due: Seconds) -> Seconds | None:
        if run.is_start(point.sync):
            return due
        off = self._moves.off_run(run, point.sync, self._loop.time())
        if self._has_come(run.watch, off, run.behavior.id, point.held_with or point.sync):
            run.look_anew()
            return max(due, self._last_frame)  # when that was measured
        await run.bell.wait(inf)
        return None

    # -- measured joints ----------------------------------------------------------------------------------------

    def _has_come(self, watch: Watch, off: Off, where: str, sync: str) -> bool:
        """Tell if joints are where they should be. Raises BodyFailed if they are not, and make no way any more."""
        if off.share <= 1.0:
            return True
        if (waited := watch.stuck(abs(off.there - off.here), self._last_frame)) is not None:
            here, there = round(degrees(off.here), 1) + 0.0, degrees(off.there)
            reason = (
                f"{off.joint} stands at {here:.1f} degrees, {abs(there - here):.1f} from where it should be for its "
                f"{sync}, and has made no way for {waited:.1f} s"
            )
            advice = "is it free, are its motors on, and does no other app move the robot?"
            raise BodyFailed(Fault(reason=reason, where=where, advice=advice, service="control"))
        return off.is_near_for_standing and watch.stands

    def _off_home(self, name: str) -> Off:
        track, now = self._moves.tracks[name], self._loop.time()
        return self._moves.off(name, now, track.going)

    def _is_home(self, name: str, watch: Watch) -> bool:
        """True once a track has come home. Raises BodyFailed if it does not."""
        comes = self._moves.tracks[name].motion.end + self._settings.lag
        return self._loop.time() >= comes and self._has_come(watch, self._off_home(name), "home", name)

    def _is_moving(self) -> bool:
        """True while a plan moves, or joints have not come along yet."""
        now = self._loop.time()
        for name, track in self._moves.tracks.items():
            if now < track.motion.end + self._settings.lag:
                return True
            if now < track.motion.end + self._settings.patience and self._off_home(name).share > 1.0:
                return True
        return False

    def _looking_at(self) -> str:
        """The entity on the measured gaze axis that the head has come to look at."""
        moves, now = self._moves, self._loop.time()
        run = moves.runs.get("head")
        look: BlockBehavior | None = moves.look
        if run is not None and not run.is_homeward:
            look = run.behavior
        entity = choreography.eye_target(look)
        if now < moves.tracks["head"].motion.end and not (run is not None and (run.holding or run.has_arrived)):
            return ""
        if not entity or not isinstance(look, courses.Looks) or moves.world.entity(entity) is None:
            return ""
        return entity if moves.off_target(look, now).share <= RESTS_ON else ""

    @contextmanager
    def _bell(self) -> Iterator[Bell]:
        """A bell that measurements ring, for the body of `with`."""
        bell = Bell()
        self._bells.add(bell)
        try:
            yield bell
        finally:
            self._bells.discard(bell)


def _over_the_network(settings: ReachyMiniSettings) -> AbstractAsyncContextManager[Daemon]:
    from engage_hri.services.control.reachy_mini.connection import connected

    return connected(settings)

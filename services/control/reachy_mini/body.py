"""Reachy Mini as a body: a head that looks and nods, a base that turns, and antennas in place of a face.

Its plan is laid here and sent through the daemon, a target for each measurement. A sync point is reported when the
plan has come there *and* the daemon measures the joints there: never because a planned time is over.
"""

from collections import defaultdict
from collections.abc import Callable, Collection, Mapping
from contextlib import AbstractAsyncContextManager
from functools import partial
from math import inf, radians, sin, tau
from typing import ClassVar, Self

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Wait
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.bases.linked import GAP, Link, LinkedBody
from engage_hri.services.control.bases.walk import Off, WalkingBody, Watch
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    BodyState,
    Idle,
    MovementAuthority,
)
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.figure import choreography
from engage_hri.services.control.figure.alive import BREATH, SOON, Gate, Overlay
from engage_hri.services.control.figure.estimates import wait_estimate
from engage_hri.services.control.motion.motion import WalkPoint
from engage_hri.services.control.reachy_mini import courses, joints, messages
from engage_hri.services.control.reachy_mini.joints import Angles
from engage_hri.services.control.reachy_mini.messages import Measured
from engage_hri.services.control.reachy_mini.moves import Moves, Run
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings

# -- idle motion -----------------------------------------------------------------------------------------------------
# It is added to what the plan has the daemon told, and taken off again from what the daemon measures (`Overlay`). The
# breath gives way to anything that head or body do or wait in, the antennas to any behavior of the face. Its own time
# goes on with the measurements: after a gap nothing jumps.

LEAN: Radians = radians(0.5)
"""Amplitude of the breath: 1.5 mm of the head, which looks on where it looks."""
SWAY: Radians = radians(2.5)
"""Greatest angle of an antenna."""
PERIODS: dict[str, tuple[Seconds, Seconds]] = {"right_antenna": (7.3, 4.1), "left_antenna": (8.7, 4.7)}
_RANGES = {limit.joint: limit for limit in joints.LIMITS}


class Idling:
    """Idle motion of one robot. lag: seconds by which what is measured follows what was sent."""

    def __init__(self, lag: Seconds, *, is_alive: bool) -> None:
        """is_alive: False: it never moves."""
        self._is_alive, self._lag = is_alive, lag
        self._time: Seconds = 0.0
        self._seen: Seconds | None = None
        self.stop()

    def stop(self) -> None:
        """Begin anew: nobody knows where the joints are."""
        self._face, self._body = Gate(is_open=False), Gate(is_open=False)
        self.overlay = Overlay(self._lag)

    def added(self, now: Seconds, planned: Angles, busy: set[str]) -> dict[str, Radians]:
        """Tell what to add to the joints now, and take it as sent.

        planned: angles that they are sent to without it. busy: tracks that move, or that a behavior has.
        """
        if not self._is_alive:
            return {}
        # However late a measurement comes, breath is a motion of 0.04 degrees then.
        self._time += min(SOON, now - self._seen) if self._seen is not None else 0.0
        self._seen = now
        of_face = self._face.share(self._time, is_open="face" not in busy)
        of_body = self._body.share(self._time, is_open=not busy - {"face"})
        angle = tau * self._time / BREATH
        found = {"body_lean": of_body * LEAN * sin(angle + 0.4 * sin(angle))}  # in is quicker than out
        for joint, (one, other) in PERIODS.items():
            found[joint] = of_face * SWAY * (sin(tau * self._time / one) + sin(tau * self._time / other)) / 2
        kept = {joint: _within(joint, planned[joint], by) for joint, by in found.items()}
        kept = {joint: by for joint, by in kept.items() if by}
        self.overlay.add(now, kept)
        return kept


def _within(joint: str, planned: Radians, by: Radians) -> Radians:
    """Cut what is added to what the range of a joint leaves; nothing is left for one that is out of it."""
    low, high = _RANGES[joint].low, _RANGES[joint].high
    return max(min(0.0, low - planned), min(max(0.0, high - planned), by))


STANDING = {"right_antenna": radians(4.0), "left_antenna": radians(4.0)}
"""How far a joint may be off once it has come to stand: an antenna is a long lever on a small motor."""
RESTS_ON = 2.0
"""The eyes rest on what they look at within this many times the angle that counts as on target."""
Connect = Callable[[ReachyMiniSettings], AbstractAsyncContextManager[Link]]


class ReachyMini(LinkedBody[Measured], WalkingBody[Run]):
    """Reachy Mini through its daemon. Without `connected()` it answers for a robot at rest: `engage plan` asks so."""

    name, peer = "reachy_mini", "the daemon"
    moves: Moves
    Settings: ClassVar[type[Struct]] = ReachyMiniSettings
    carries: ClassVar[Mapping[str, tuple[str, ...]]] = {"torso": ("head",)}

    def __init__(
        self, settings: ReachyMiniSettings | None = None, connect: Connect | None = None, *, alive: bool = False
    ) -> None:
        """Make the body; `connected()` then finds the robot.

        settings: of `control.drivers.reachy_mini`. connect: opens a connection; by default to `settings.url`.
        alive: it breathes, and its antennas sway.
        """
        self.settings = settings or ReachyMiniSettings()
        LinkedBody.__init__(self, partial(connect or _over_the_network, self.settings), self.settings.silence)
        WalkingBody.__init__(self)
        self.capabilities = Capabilities(
            body="reachy_mini", types=tuple(map(type_name, courses.TYPES)), parts=("head", "torso", "face"),
            joints=joints.LIMITS,
        )  # fmt: skip
        self.stuck_after = self.settings.patience
        self.moves = Moves(self._loop, self.settings)
        self._idling = Idling(self.settings.lag, is_alive=alive)
        self._sent = ""

    @classmethod
    def configured(cls, config: ControlConfig, settings: ReachyMiniSettings | None) -> Self:
        return cls(settings, alive=config.alive)

    # -- measurements -------------------------------------------------------------------------------------------

    def answer(self, measured: Measured) -> str | None:
        now, moves = self._loop.time(), self.moves
        moves.measured = self._idling.overlay.off(measured.pose, now)
        if now - self.last_frame > GAP:
            moves.stand(self.last_frame)
        moves.correct(now)
        commanded = moves.commanded(now)
        busy = {name for name, track in moves.tracks.items() if name in moves.runs or track.is_moving(now)}
        added = self._idling.added(now, commanded, busy)
        text = messages.target({joint: angle + added.get(joint, 0.0) for joint, angle in commanded.items()})
        before, self._sent = self._sent, text
        return text if text != before else None

    def read(self, text: str | bytes) -> Measured:
        return messages.read(text)

    def trouble_of(self, measured: Measured) -> Fault | None:
        return messages.trouble_of(measured)

    def be_back(self, measured: Measured) -> None:
        self._idling.stop()
        self._sent, self.moves.measured = "", measured.pose
        self.moves.runs.clear()  # they have failed, and are just about to say so
        self.moves.settle()
        self.moves.go_home()

    def ring(self) -> None:
        for bell in [*self.moves.homeward, *(run.bell for run in self.moves.runs.values())]:
            bell.ring()

    # -- the contract -------------------------------------------------------------------------------------------

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        around = self.moves.circumstances(world, pose)
        if isinstance(behavior, Wait):
            return wait_estimate(behavior, behavior.duration or 0.0, joints.message(around.tracks))
        try:
            if self.trouble is not None:
                raise Impossible("CANNOT_CREATE_BEHAVIOR", self.trouble.reason, self.trouble.advice)
            return self.moves.estimate(behavior, around, is_resting=pose is not None)
        except Impossible as impossible:
            return impossible.estimate(behavior)

    def state(self) -> BodyState:
        pose = self.moves.measured
        return BodyState(
            pose=joints.pose_message(pose), gaze=joints.gaze(pose, self.moves.mounting), moving=self._is_moving(),
            looking_at=self._looking_at(),
        )  # fmt: skip

    def idle(self) -> Idle:
        return Idle(added=self._idling.overlay.shown)

    def see(self, world: World) -> None:
        self.moves.see(world)

    # -- behaviors ----------------------------------------------------------------------------------------------

    def set_out(self, behavior: BlockBehavior, authority: MovementAuthority) -> Run:
        if self.trouble is not None:
            raise BehaviorRefused(replace(self.trouble, where=behavior.id))
        course = courses.course(behavior, self.moves.circumstances(self.moves.world))
        return self.moves.set_out(Run(behavior, course, authority, self.stuck_after))

    def check(self, run: Run) -> None:
        if self.trouble is not None and (run.authority.revoked is None or not self.moves.owns(run)):
            raise BodyFailed(replace(self.trouble, where=run.behavior.id))

    def due(self, run: Run, point: WalkPoint) -> Seconds | None:
        # The plan after a target that moves is laid anew again and again, and never over: what counts is the gaze.
        target = getattr(run.behavior, "target", "") if point.sync == run.course.arrival else ""
        speed = self.moves.speed(target)
        return self.last_frame if speed and self.has_come(run, point) else run.due(point)

    def has_come(self, run: Run, point: WalkPoint) -> bool:
        return run.is_start(point.sync) or self.moves.off_run(run, point.sync).share <= 1.0

    async def come(self, run: Run, point: WalkPoint, due: Seconds) -> Seconds | None:
        if run.is_start(point.sync):
            return due
        off = self.moves.off_run(run, point.sync)
        if self._has_come(run.watch, off, run.behavior.id, point.held_with or point.sync):
            run.look_anew()
            return max(due, self.last_frame)  # when that was measured
        await run.bell.wait(inf)
        return None

    # -- measured joints ----------------------------------------------------------------------------------------

    def _has_come(self, watch: Watch, off: Off, where: str, sync: str) -> bool:
        """Tell if joints are where they should be. Raises BodyFailed if they are not, and make no way any more."""
        if off.share <= 1.0:
            return True
        watch.see(off, self.last_frame)
        if watch.is_stuck:
            advice = "is it free, are its motors on, and does no other app move the robot?"
            raise BodyFailed(watch.fault(where, sync, advice))
        return watch.stands and abs(off.there - off.here) <= STANDING.get(off.joint, 0.0)

    def coming_home(self, going: Collection[str], watches: defaultdict[str, Watch]) -> Seconds | None:
        if not self.is_linked:
            return None
        if self.trouble is not None:  # it goes home by itself once it is back
            watches.clear()
        is_home = [self._is_home(name, watches[name]) for name in going]
        return None if all(is_home) else inf

    def _is_home(self, name: str, watch: Watch) -> bool:
        """True once a track has come home. Raises BodyFailed if it does not."""
        comes = self.moves.tracks[name].motion.end + self.settings.lag
        return self._loop.time() >= comes and self._has_come(watch, self._off_home(name), "home", name)

    def _off_home(self, name: str) -> Off:
        return self.moves.off(name, self.moves.tracks[name].going())

    def _is_moving(self) -> bool:
        """True while a plan moves, or joints have not come along yet."""
        now = self._loop.time()
        ends = {name: track.motion.end for name, track in self.moves.tracks.items()}
        return any(
            now < end + self.settings.lag or (now < end + self.stuck_after and self._off_home(name).share > 1.0)
            for name, end in ends.items()
        )

    def _looking_at(self) -> str:
        """The entity on the measured gaze axis that the head has come to look at."""
        moves, run = self.moves, self.moves.runs.get("head")
        look = moves.look if run is None or run.is_homeward else run.behavior
        has_arrived = run is not None and (run.holding or not run.awaits(run.course.arrival))
        is_there = has_arrived or not moves.tracks["head"].is_moving(self._loop.time())
        entity = choreography.eye_target(look)
        is_seen = is_there and entity and moves.world.entity(entity) is not None
        return entity if is_seen and moves.off_target(look).share <= RESTS_ON else ""


def _over_the_network(settings: ReachyMiniSettings) -> AbstractAsyncContextManager[Link]:
    from engage_hri.services.control.reachy_mini.connection import connected

    return connected(settings)

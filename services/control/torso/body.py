"""The simulated body: the torso of `kinematics` on loop time, with the deviations of `Variability`.

The position of each part at an instant is a formula (`tracks`, `motion`); a behavior's task only sleeps until its
next sync point, or until its authority changes. So a part needs no task to go home: it is given its path once.
"""

import asyncio
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from math import inf, radians

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, GazeShift, HeadDirectionShift, Speech, Wait
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, EstimateItem, NoPointZone
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control import variability
from engage_hri.services.control.body import (
    Arrived,
    BehaviorRefused,
    Body,
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    Reached,
)
from engage_hri.services.control.config import Variability
from engage_hri.services.control.torso import choreography, head, kinematics, tracks
from engage_hri.services.control.torso.course import Course, CoursePoint, Impossible, Situation
from engage_hri.services.control.torso.estimates import infeasible, motion_estimate, speech_estimate, wait_estimate
from engage_hri.services.control.torso.head import Fixation
from engage_hri.services.control.torso.motion import Motion, Path, resting
from engage_hri.services.control.torso.rehearsal import Clock, beside, rehearsed
from engage_hri.services.control.torso.runs import OVERHEAT, STALL, Run
from engage_hri.services.control.torso.tracks import Track
from engage_hri.services.control.voice import speaking
from engage_hri.services.control.voice.timeline import utter
from engage_hri.services.control.waiting import Bell

FREEZE: Seconds = 0.5
"""Seconds that a part stands still when it is told to freeze, before it relaxes."""


class SimulatedBody(Body):
    """A simulated torso with a voice. Behaviors take as long as `estimate` says, but for `deviations`."""

    def __init__(self, zones: tuple[NoPointZone, ...] = (), deviations: Variability | None = None) -> None:
        self.capabilities = Capabilities(
            body="simulated", types=tuple(map(type_name, choreography.TYPES)), parts=(*kinematics.PARTS, "voice"),
            joints=kinematics.JOINTS, reach=kinematics.REACH, no_point_zones=zones,
        )  # fmt: skip
        self._deviations = deviations or Variability()
        self._loop = asyncio.get_running_loop()
        displaced = {joint.joint: radians(joint.angle) for joint in self._deviations.displaced}
        self._misbelieved = {joint: kinematics.HOME[joint] for joint in displaced}
        self._tracks = {part: Track(part, tracks.home_of(part, displaced)) for part in tracks.LIMITS}
        self._runs: dict[str, Run] = {}
        self._world = World(entities=())
        self._attention = Fixation()
        self._utterance: MovementAuthority | None = None
        self._saying = ""
        self._voice_free = asyncio.Event()
        self._occasions = 0

    # -- the contract -------------------------------------------------------------------------------------------

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        try:
            return self._estimate(behavior, self._situation(world, pose), moving=pose is None)
        except Impossible as impossible:
            return infeasible(behavior, impossible.kind, _fault(behavior, impossible.reason))

    def rehearse(self, items: Sequence[EstimateItem], world: World) -> Sequence[Estimate]:
        if self._misbelieved or not any(item.times for item in items):
            return super().rehearse(items, world)
        clock = Clock(self._loop.time())
        return rehearsed(beside(self, clock, world), clock, items)

    def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        match behavior:
            case Speech():
                return self._speak(behavior, authority)
            case Wait():
                return speaking.wait(behavior, authority)
            case GazeShift() | HeadDirectionShift() if self._is_overlaid():
                return self._shift_beneath(behavior, authority)
            case _:
                return self._move(behavior, authority)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        going = {part for part in self._tracks if not parts or part.replace("nod", "head") in parts}
        if self._utterance is not None and (not parts or "voice" in parts):
            self._utterance.revoke()
        for run in dict.fromkeys(run for part, run in self._runs.items() if part in going):
            going.update(run.course.parts)
            self._release(run)
            run.authority.revoke()
        if "head" in going:
            self._attention.stay(tracks.HOME["head"])
        self._relax(tuple(sorted(going)))
        bell = Bell()
        while not bell.is_past(until := max((self._tracks[part].motion.end for part in going), default=0.0)):
            await bell.wait(until)

    def state(self) -> BodyState:
        now = self._loop.time()
        pose = tracks.pose_at(self._tracks, now)
        return BodyState(
            pose=kinematics.pose_message(pose), gaze=kinematics.gaze(pose), left_arm=kinematics.arm(pose, "left"),
            right_arm=kinematics.arm(pose, "right"),
            moving=self._utterance is not None or any(track.is_moving(now) for track in self._tracks.values()),
            looking_at=self._attention.fixated(now), speaking=self._saying,
        )  # fmt: skip

    def see(self, world: World) -> None:
        self._world = world
        self._follow()

    # -- planning -----------------------------------------------------------------------------------------------

    def _situation(self, world: World, pose: BodyPose | None = None, *, real: bool = False) -> Situation:
        """Describe what a course starts from. real: with the true joint angles, not those that the body believes."""
        now = self._loop.time()
        here: dict[str, float] = {}
        for part, track in self._tracks.items():
            if part != "nod":
                here.update(zip(track.joints, track.angles(now), strict=True))
        # Head and arms aim for where the torso is going to be.
        torso, leaning = self._tracks["torso"], self._runs.get("torso")
        here.update(zip(torso.joints, torso.angles(max(now, torso.motion.end)), strict=True))
        if leaning is not None and leaning.is_setting_out and torso.is_moving(now):
            here.update(leaning.course.on_target)
        if not real:
            here.update(self._misbelieved)
        rest = {**kinematics.HOME, **dict(zip(tracks.NECK, self._attention.angles, strict=True))}
        zones = self.capabilities.no_point_zones
        return Situation(tracks.updated(here, pose), rest, world, zones, tuple(self._runs))

    def _path(self, course: Course, situation: Situation | None = None) -> Path:
        """Lay a path along `course`. Raises Impossible.

        situation: start at rest in its pose; None: start from where the parts are, as they move.
        """
        if situation is not None and course.parts != ("nod",):
            start = resting([situation.pose[joint] for joint in course.joints])
        else:
            now = self._loop.time()
            start = tracks.joined([self._tracks[part].at(now) for part in course.parts])
        path = Path(start, course.legs, tracks.limits_of(course.parts))
        if tracks.meets_table(path, course.joints):
            raise Impossible("CANNOT_CREATE_BEHAVIOR", "the table is in the way of the arm")
        return path

    def _estimate(self, behavior: BlockBehavior, situation: Situation, *, moving: bool) -> Estimate:
        match behavior:
            case Speech(text=text):
                if self._deviations.mute == "refuse":
                    raise Impossible("CANNOT_CREATE_BEHAVIOR", "the voice is mute")
                return speech_estimate(behavior, utter(text), kinematics.pose_message(situation.pose))
            case Wait(duration=duration):
                return wait_estimate(behavior, duration or 0.0, kinematics.pose_message(situation.pose))
        course = choreography.plan(behavior, situation)
        path = self._path(course, None if moving and not self._misbelieved else situation)
        # A nod is on top of the gaze, and leaves the neck where that has it.
        moved = () if course.parts == ("nod",) else zip(course.joints, course.legs[-1].goal, strict=True)
        on_target, end = {**situation.pose, **course.on_target}, {**situation.pose, **dict(moved)}
        return motion_estimate(
            behavior, course, path, kinematics.pose_message(on_target), kinematics.pose_message(end)
        )

    # -- motion -------------------------------------------------------------------------------------------------

    async def _move(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        try:
            course = choreography.plan(behavior, self._situation(self._world, real=True))
            self._occasions += 1
            run = Run(behavior, course, authority, self._deviations, self._occasions)
            path = self._path(run.course)
        except Impossible as impossible:
            raise BehaviorRefused(_fault(behavior, impossible.reason)) from impossible
        unwatch = authority.watch(run.bell.ring)
        self._take_over(run, path)
        try:
            async with aclosing(self._pass_points(run)) as points:
                async for progress in points:
                    yield progress
            if authority.revoked == "freeze" and self._owns(run):
                await self._freeze(run)
        finally:
            unwatch()
            # After an abort, a failure or a cancelled task the parts go home by themselves.
            if self._owns(run):
                self._release(run)
                if run.pending:
                    self._abandon(run)

    def _take_over(self, run: Run, path: Path) -> None:
        """Make `run` the owner of its parts, cut the runs that had them, and start its motion."""
        now = self._loop.time()
        for joint in run.course.joints:
            self._misbelieved.pop(joint, None)
        for earlier in dict.fromkeys(self._runs[part] for part in run.course.parts if part in self._runs):
            self._release(earlier)
            earlier.cut(now)
            self._relax(tuple(part for part in earlier.course.parts if part not in run.course.parts))
        for part in run.course.parts:
            self._runs[part] = run
        if head.is_shift(run.behavior):
            self._attention.shift(run.behavior, run.course)
        self._play(run, path)
        if run.course.parts == ("torso",):
            self._follow()

    def _play(self, run: Run, path: Path) -> None:
        now = self._loop.time()
        run.play(Motion(path, now, cruise=run.cruise, limit=run.limit(path)))
        column = 0
        for part in run.course.parts:
            self._tracks[part].play(run.motion, column)
            column += len(self._tracks[part].joints)
        self._attention.follow_run(run, now)

    async def _pass_points(self, run: Run) -> AsyncGenerator[Progress, None]:
        """Report the sync points of `run` as it crosses them, until it is done, cut or revoked. Raises BodyFailed."""
        since = -inf
        while run.pending and not run.is_over:
            if not run.holding:
                self._extend(run)
            point = run.pending[0]
            due = run.due(point)
            if due is None or not run.bell.is_past(due):
                await run.bell.wait(inf if due is None else due)
            elif point.sync in (STALL, OVERHEAT):
                await self._fail_or_stall(run, point)
            elif point.held_with and (run.holding or not run.authority.covers(point.held_with)):
                arrived = max(due, since)
                if not run.authority.covers(point.held_with):
                    run.holding = True
                    yield Arrived(point.held_with, arrived)
                while not run.authority.covers(point.held_with) and not run.is_over:
                    await run.bell.wait(inf)
                if not run.is_over:
                    since = self._loop.time()
                    for sync in self._leave_hold(run, point.held_with):
                        yield Reached(sync, since, arrived)
            else:
                run.pending.pop(0)
                self._attention.follow_run(run, self._loop.time())
                yield Reached(point.sync, due, due)
        if run.cut_at is not None:
            for sync in run.unreported:
                yield Reached(sync, run.cut_at, run.cut_at)
            run.pending.clear()

    def _leave_hold(self, run: Run, hold: str) -> list[str]:
        """Let `run` go on from a hold point, on a new path if it stands still. Returns the sync points it passes."""
        now = self._loop.time()
        stood, passed = run.stands, run.leave(hold, now)
        if stood and not run.holding:
            legs = run.motion.path.after(run.motion.s(now), [point.sync for point in run.pending])
            if run.course.parts == ("head",):
                legs = (head.way_back(self._tracks["head"].angles(now), self._attention.angles),)
            start = tracks.joined([self._tracks[part].at(now) for part in run.course.parts])
            self._play(run, Path(start, run.with_faults(legs), tracks.limits_of(run.course.parts)))
        return passed

    def _extend(self, run: Run) -> None:
        now = self._loop.time()
        if (path := run.hurry(now)) is not None:
            self._play(run, path)
        limit = run.limit(run.motion.path)
        is_extended = limit > run.motion.limit
        run.motion.extend(limit, now)
        if run.keep_pace(now) or is_extended:
            self._attention.follow_run(run, now)

    async def _fail_or_stall(self, run: Run, point: CoursePoint) -> None:
        if point.sync == OVERHEAT:
            raise BodyFailed(_fault(run.behavior, f"the motor of the {run.course.parts[0]} is overheated"))
        assert run.stall is not None
        until = inf if run.stall.seconds is None else self._loop.time() + run.stall.seconds
        while not run.is_over and not run.bell.is_past(until):
            await run.bell.wait(until)
        run.pending.remove(point)

    async def _freeze(self, run: Run) -> None:
        run.motion.brake(self._loop.time())
        self._attention.expect("", 0.0, self._loop.time())
        until = run.motion.end + FREEZE
        while run.cut_at is None and self._owns(run) and not run.bell.is_past(until):
            await run.bell.wait(until)

    def _owns(self, run: Run) -> bool:
        return any(owner is run for owner in self._runs.values())

    def _release(self, run: Run) -> None:
        for part in [part for part, owner in self._runs.items() if owner is run]:
            del self._runs[part]

    def _abandon(self, run: Run) -> None:
        """Send the parts of `run` to rest. A shift of the head that is broken off stays where it can stop."""
        if head.is_shift(run.behavior):
            self._attention.stay(head.brake(run.motion, self._loop.time()))
            self._attention.expect("", 0.0, self._loop.time())
        else:
            self._relax(run.course.parts)

    def _relax(self, parts: tuple[str, ...]) -> None:
        now = self._loop.time()
        for part in parts:
            track = self._tracks[part]
            track.return_to(self._attention.angles if part == "head" else tracks.HOME[part], now)
            if part == "head":
                self._attention.expect(self._attention.entity, track.motion.end, now)
        if "torso" in parts:
            self._follow()

    # -- gaze ---------------------------------------------------------------------------------------------------

    def _is_overlaid(self) -> bool:
        return "head" in self._runs and isinstance(self._runs["head"].behavior, Gaze)

    async def _shift_beneath(
        self, behavior: BlockBehavior, authority: MovementAuthority
    ) -> AsyncGenerator[Progress, None]:
        """Change the base gaze while a `Gaze` lies over it: nothing moves until that ends. `end` comes as asked."""
        try:
            self._attention.shift(behavior, choreography.plan(behavior, self._situation(self._world)))
        except Impossible as impossible:
            raise BehaviorRefused(_fault(behavior, impossible.reason)) from impossible
        now = self._loop.time()
        yield Reached("start", now, now)
        bell = Bell()
        unwatch = authority.watch(bell.ring)
        try:
            while authority.revoked is None and not bell.is_past(due := authority.pace.get("end", now)):
                await bell.wait(due)
        finally:
            unwatch()
        if authority.revoked is None:
            now = self._loop.time()
            yield Reached("end", now, now)

    def _follow(self) -> None:
        """Turn the head to follow the entity that it looks at, or is about to look at."""
        now, situation, track = self._loop.time(), self._situation(self._world, real=True), self._tracks["head"]
        self._attention.update(situation)
        if (run := self._runs.get("head")) is None:
            head.turn(track, self._attention.angles, now)
            return
        try:
            course = choreography.plan(run.behavior, situation)
        except Impossible:
            return
        if run.stands:
            head.turn(track, tuple(course.on_target.values()), now)
        elif (path := head.retargeted(run, course, track, now)) is not None:
            run.course = course
            self._play(run, path)
            run.bell.ring()

    # -- voice --------------------------------------------------------------------------------------------------

    async def _speak(self, behavior: Speech, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        if self._deviations.mute == "refuse":
            raise BehaviorRefused(_fault(behavior, "the voice is mute"))
        await self._wait_for_silence(authority)
        if authority.revoked is not None:
            return
        if self._utterance is not None:
            raise BehaviorRefused(_fault(behavior, f"the voice is busy with {self._saying!r}"))
        self._occasions += 1
        pace = 1.0 / variability.rate(self._deviations, ("voice",), behavior.id, self._occasions)
        self._utterance, self._saying = authority, "" if self._deviations.mute else behavior.text
        try:
            async with aclosing(speaking.speak(behavior, authority, pace)) as utterance:
                async for progress in utterance:
                    if isinstance(progress, Reached) and progress.sync == "end":
                        self._utterance, self._saying = None, ""
                    yield progress
        finally:
            if self._utterance is authority:
                self._utterance, self._saying = None, ""
            self._voice_free.set()

    async def _wait_for_silence(self, authority: MovementAuthority) -> None:
        """Wait until an aborted speech has finished its current word; return at once if `authority` is revoked."""
        unwatch = authority.watch(self._voice_free.set)
        try:
            while self._utterance is not None and self._utterance.revoked is not None and authority.revoked is None:
                self._voice_free.clear()
                await self._voice_free.wait()
        finally:
            unwatch()


def _fault(behavior: BlockBehavior, reason: str) -> Fault:
    return Fault(reason=reason, where=behavior.id, service="control")

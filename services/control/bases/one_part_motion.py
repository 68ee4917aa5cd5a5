"""The ordinary robot: one part, one motion at a time. A driver on it only says where, and passes goals to its SDK.

    class PanTilt(OrdinaryBody):
        part = "head"
        joints = (JointLimit(...), JointLimit(...))

        def aim(self, behavior, world): ...     # joint angles on target
        def angles(self): ...                   # measured
        def go(self, goal, seconds): ...        # a command to the motors; returns at once

A sync point is where the *measured* angles are: an SDK's "finished" often means that the planned time is over.
"""

import asyncio
import math
from abc import abstractmethod
from collections import defaultdict
from collections.abc import AsyncIterator, Awaitable, Collection, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from math import inf
from typing import ClassVar

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import BlockBehavior, Pointing
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, JointAngle, JointLimit, Phase, Ray
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.control.bases.moving_parts import MovingParts, Run
from engage_hri.services.control.bases.walk import WalkingBody, Watch
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    BodyFailed,
    BodyState,
    MovementAuthority,
)
from engage_hri.services.control.contract.refusals import infeasible
from engage_hri.services.control.motion.motion import MotionPlan, Track, WalkPoint

Angles = Mapping[str, Radians]
Way = Sequence[tuple[str, Angles]]
"""Joint angles at which sync points are passed, in order."""
Goals = Mapping[str, Angles]


class OnePartRun(Run):
    """A behavior that has the one part. goals: where the joints have to be, by the sync point that needs it.

    sync: the point whose goal it is at, or on its way to; empty: none yet. at: when it was last measured at one.
    """

    def __init__(self, behavior: BlockBehavior, plan: MotionPlan, authority: MovementAuthority, goals: Goals) -> None:
        super().__init__(behavior, plan, authority)
        self.goals = goals
        self.sync = ""
        self.at: Seconds = _now()

    def leave(self, hold: str, now: Seconds) -> list[str]:
        passed = [point.sync for point in self.pending if point.held_with == hold]
        self.pending = [point for point in self.pending if point.held_with != hold]
        self.holding = False
        return passed

    def passed_by(self, at: Seconds) -> list[tuple[str, Seconds]]:
        return []  # a point that the joints were measured at has been reported at once


class OnePart(MovingParts[OnePartRun]):
    """The one part of a body, and who has it. There is no plan in time: a goal is commanded, and then measured.

    goal: where the part rests: at home, or where a shift has taken it. shift: the one that has; None: none.
    """

    def __init__(self, body: "OrdinaryBody", home: Angles) -> None:
        super().__init__(asyncio.get_running_loop(), {body.part: Track(body.part, body.joints, tuple(home.values()))})
        self._body, self.home = body, home
        self.goal = home
        self.shift: BlockBehavior | None = None

    def goal_of(self, run: OnePartRun) -> Angles:
        """Goal of a behavior now: at the end where the part rests, unless it goes elsewhere itself."""
        return run.goals.get(run.sync, self.goal)

    def take_over(self, run: OnePartRun) -> None:
        self.take(run)

    def extend(self, run: OnePartRun) -> None:
        if (sync := run.pending[0].sync) != run.sync and (sync in run.goals or sync == "end"):
            run.sync = sync
            self._body.set_off(self.goal_of(run))

    def leave(self, run: OnePartRun, point: WalkPoint, *, has_waited: bool) -> Sequence[str]:
        if has_waited:
            return run.leave(point.held_with, self.clock.time())
        return [run.pending.pop(0).sync]

    def abandon(self, run: OnePartRun) -> None:
        self.relax((self._body.part,))

    def relax(self, names: Collection[str]) -> None:
        if names:
            with suppress(BodyFailed):
                self._body.set_off(self.goal)

    def rest_on(self, run: OnePartRun | None) -> None:
        self.goal = self.home if run is None else run.goals["end"]
        self.shift = None if run is None else run.behavior

    def stop(self, run: OnePartRun) -> Seconds:
        return self.clock.time()  # motors with a goal promise no stop on the way: the part goes home at once

    def follow(self) -> None:
        """Aim anew where a target has moved. What is out of reach now is looked at where it was last."""
        run = self.runs.get(self._body.part)
        if self.shift is not None:
            with suppress(BehaviorRefused):
                self.goal = self._body.goals(self.shift, self.world)["end"]
        if run is not None and hasattr(run.behavior, "target"):
            with suppress(BehaviorRefused):
                run.goals = self._body.goals(run.behavior, self.world)
        if run is None or run.sync:
            self._body.keep_at(self.goal if run is None else self.goal_of(run))


class OrdinaryBody(WalkingBody[OnePartRun]):
    """A robot with one part, which makes one motion at a time: derive a driver from it.

    name: of the robot. part: its one part: `head`, `right_arm`, ... types: the behaviors that `aim` and `way` know.
    joints: with their limits. rest: angles of the safe pose; by default 0. eyes: where it looks from, metres.
    speed, acceleration: the share of the joints' limits that motions take.
    near: a joint this near to its goal is there, radians; at least three times the noise of the encoders.
    settling: time from the end of the planned motion until the joints are measured there, at the stated rate.
    patience: a motion that takes this many times as long as planned, and a second, has failed.
    rate: looks at the measured angles per second, while it moves.
    """

    name: ClassVar[str] = "ordinary"
    part: ClassVar[str] = "head"
    types: ClassVar[tuple[str, ...]] = ("gaze", "gazeShift")
    joints: ClassVar[tuple[JointLimit, ...]] = ()
    rest: ClassVar[Angles] = {}
    eyes: ClassVar[Vector] = (0.0, 0.0, 1.1)
    reach: ClassVar[Meters] = 0.0
    speed: ClassVar[float] = 0.5
    acceleration: ClassVar[float] = 0.5
    near: ClassVar[Radians] = math.radians(0.5)
    settling: ClassVar[Seconds] = 0.0
    patience: ClassVar[float] = 3.0
    rate: ClassVar[float] = 50.0

    moves: OnePart

    def __init__(self) -> None:
        super().__init__()
        self.capabilities = Capabilities(
            body=self.name, types=self.types, parts=(self.part,), joints=self.joints, reach=self.reach
        )
        self.moves = OnePart(self, {limit.joint: self.rest.get(limit.joint, 0.0) for limit in self.joints})
        self._goal: Angles | None = None
        """Where the motors were told to go; None: they stand there."""
        self._has_come = True
        """False while what moves it has not come to its goal once: a target that moves on changes nothing in that."""
        self._came: Seconds = -inf
        """When the joints were measured at their goal; -inf: they have not moved for it."""
        self._overdue = Silences[str](Sight("control"))
        self._told: tuple[Angles, Seconds, Seconds] = ({}, 0.0, 0.0)
        """Where the joints were as the last command was sent, when that was, and the seconds that it takes."""
        self._is_open = False
        self._sending: asyncio.Future[None] | None = None
        """Of a command that takes time."""
        self._next: tuple[Angles, Seconds] | None = None
        """The command that comes after that one."""
        self._failure: Exception | None = None
        """What the motors have answered to a command since it was sent; the motion that waits raises it."""

    # -- what a driver says -------------------------------------------------------------------------------------

    @abstractmethod
    def aim(self, behavior: BlockBehavior, world: World) -> Angles:
        """Say at which joint angles, in radians, a behavior has its stroke.

        behavior: what is to be done, of one of the `types`.
        world: the entities that targets name, in metres.

        Raises:
            BehaviorRefused: it can't be done.
        """

    @abstractmethod
    def angles(self) -> Angles:
        """Measure the joint angles, radians."""

    @abstractmethod
    def go(self, goal: Angles, seconds: Seconds) -> Awaitable[None] | None:
        """Command the motors to a goal, and return at once.

        It may be a coroutine, for an SDK that blocks: `await asyncio.to_thread(...)` in it. While one is under way no
        other begins; then the last goal is sent.

        goal: the angle of each joint, radians.
        seconds: time in which they are to be there, from wherever they are, seconds.

        Raises:
            BodyFailed: they take no command.
        """

    async def open(self) -> None:
        """Connect to the motors. By default nothing.

        Raises:
            RunFailed: they cannot be had now.
        """

    async def close(self) -> None:
        """Leave the motors. By default nothing."""

    def gaze(self, angles: Angles) -> Ray | None:
        """Tell the axis of the eyes. By default it has none.

        angles: of each joint, radians.
        """
        return None

    def forearm(self, angles: Angles) -> Ray | None:
        """Tell the ray from the elbow through the hand. By default it has no arm.

        angles: of each joint, radians.
        """
        return None

    def way(self, behavior: BlockBehavior, world: World) -> Way:
        """List the angles at which a behavior passes its sync points. By default `aim` is where it has its stroke.

        Override it for a movement with several poses, such as a nod: `[("stroke", down), ("stroke_end", up)]`.
        The way back to rest is added.

        behavior: what is to be done, of one of the `types`.
        world: the entities that targets name, in metres.

        Raises:
            BehaviorRefused: it can't be done.
        """
        points, aim = TYPES[type_name(behavior)].points, self.aim(behavior, world)
        if isinstance(behavior, Pointing):  # people follow an arm as soon as it points
            return [("stroke_start", aim), ("stroke", aim), ("stroke_end", aim)]
        return [("stroke" if "stroke" in points else "end", aim)]

    def position(self, behavior: BlockBehavior, world: World) -> Vector:
        """Look up the position of a behavior's target, metres.

        behavior: one with a target.
        world: the entities that targets name, in metres.

        Raises:
            BehaviorRefused: the world has no such entity.
        """
        target = getattr(behavior, "target", "")
        if (entity := world.entity(target)) is None:
            raise refused(behavior, f"the world has no {target!r}")
        return entity.position

    # -- what follows from it -----------------------------------------------------------------------------------

    def _way(self, behavior: BlockBehavior, world: World) -> Way:
        """The way of a behavior, without that back to rest. Raises BehaviorRefused."""
        if type_name(behavior) not in self.types:
            raise refused(behavior, f"this body has no {type_name(behavior)}")
        way = self.way(behavior, world)
        for sync, goal in way:
            self._check(behavior, sync, goal)
        return way

    def _check(self, behavior: BlockBehavior, sync: str, goal: Angles) -> None:
        for limit in self.joints:
            if limit.joint not in goal:
                raise refused(behavior, f"the driver names no angle of {limit.joint} for {sync}")
            angle = goal[limit.joint]
            if not limit.low - 1e-9 <= angle <= limit.high + 1e-9:
                low, high = math.degrees(limit.low), math.degrees(limit.high)
                wanted = f"{limit.joint} would be at {math.degrees(angle):.0f} degrees"
                reason = f"{wanted}; it goes from {low:.0f} to {high:.0f}"
                raise refused(behavior, reason)

    def goals(self, behavior: BlockBehavior, world: World) -> Goals:
        """Goals by the first point of each instant. Raises BehaviorRefused.

        behavior: what to do. world: where its targets are.
        """
        return by_instant(behavior, self._way(behavior, world))

    def _seconds(self, here: Angles, goal: Angles) -> Seconds:
        """Time of a motion: that of the joint that takes longest, speeding up, cruising and braking."""
        longest = 0.0
        for limit in self.joints:
            way = abs(goal[limit.joint] - here[limit.joint])
            if way > self.near:
                top, change = limit.speed * self.speed, limit.acceleration * self.acceleration
                ramp = top * top / change
                longest = max(longest, way / top + top / change if way > ramp else 2 * math.sqrt(way / change))
        return longest + self.settling if longest else 0.0

    # -- the contract -------------------------------------------------------------------------------------------

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        await self.open()
        self._is_open = True
        try:
            yield
        finally:
            self._is_open = False
            if self._sending is not None:
                self._sending.cancel()
                await asyncio.gather(self._sending, return_exceptions=True)
            await self.close()

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        try:
            way = list(self._way(behavior, world))
        except BehaviorRefused as refused:
            target = getattr(behavior, "target", "")
            warning = "NO_SUCH_TARGET" if target and world.entity(target) is None else "CANNOT_CREATE_BEHAVIOR"
            if type_name(behavior) not in self.types:
                warning = "BEHAVIOR_TYPE_NOT_SUPPORTED"
            return infeasible(behavior.id, warning, refused.fault)
        if way[-1][0] != "end":
            way.append(("end", self.moves.goal))
        here = dict(self._measured())
        here |= {angle.joint: angle.angle for angle in pose.joints if angle.joint in here} if pose else {}
        row, phases, since = TYPES[type_name(behavior)], [], "start"
        at: Angles = here
        goals = by_instant(behavior, way)
        target = way[-2 if len(way) > 1 else -1][1]
        for sync in row.points[1:]:
            goal = goals.get(sync, at)
            seconds, hold = self._seconds(at, goal), sync in row.holds
            longest = None if hold or not seconds else seconds  # it has one pace
            phases.append(Phase(since=since, to=sync, shortest=seconds, natural=seconds, longest=longest, hold=hold))
            since, at = sync, goal
        is_head = self.gaze(here) is not None
        turned = math.degrees(sum(abs(target[joint] - here[joint]) for joint in here))
        return Estimate(
            behavior=behavior.id, feasible=True, parts=(self.part,), phases=tuple(phases),
            ray=self.gaze(target) if is_head else self.forearm(target),
            head_degrees=turned if is_head else 0.0, arm_degrees=0.0 if is_head else turned,
            pose_after=_pose(target), pose_end=_pose(at),
        )  # fmt: skip

    def set_out(self, behavior: BlockBehavior, authority: MovementAuthority) -> OnePartRun:
        row, goals = TYPES[type_name(behavior)], self.goals(behavior, self.moves.world)
        together = {sync: group[-1] for group in row.one_instant for sync in group}
        points = tuple(
            WalkPoint(sync, hold if (hold := together.get(sync, sync)) in row.holds else "") for sync in row.points
        )
        names = tuple(limit.joint for limit in self.joints)
        plan = MotionPlan(parts=(self.part,), joints=names, legs=(), points=points)
        return self.moves.set_out(OnePartRun(behavior, plan, authority, goals))

    def due(self, run: OnePartRun, point: WalkPoint) -> Seconds:
        return run.at

    async def come(self, run: OnePartRun, point: WalkPoint, due: Seconds) -> Seconds | None:
        if run.sync != point.sync and not (run.holding and run.sync):
            return due  # it has nowhere to go for this point
        if not self._is_there(self.moves.goal_of(run), run.sync):
            await run.bell.wait(self._loop.time() + 1.0 / self.rate)
            return None
        run.at = max(run.at, self._came)
        return run.at

    def has_come(self, run: OnePartRun, point: WalkPoint) -> bool:
        return not run.sync or self._off(self.moves.goal_of(run)) is None

    def coming_home(self, going: Collection[str], watches: defaultdict[str, Watch]) -> Seconds | None:
        if not going or self._is_there(self.moves.goal, "home"):
            return None
        return self._loop.time() + 1.0 / self.rate

    def state(self) -> BodyState:
        angles = self._measured()
        self._note_arrival(angles)
        arm = self.forearm(angles)
        return BodyState(
            pose=_pose(angles), moving=self._goal is not None, gaze=self.gaze(angles),
            left_arm=arm if self.part == "left_arm" else None,
            right_arm=arm if self.part != "left_arm" else None, looking_at=self._looking_at(angles),
        )  # fmt: skip

    def _looking_at(self, angles: Angles) -> str:
        """Id of the entity that the part was turned to, if the joints are there; empty: none."""
        run, moves = self.moves.runs.get(self.part), self.moves
        look, goal = moves.shift, moves.goal
        if run is not None and run.sync in run.goals:
            look = run.behavior if TYPES[type_name(run.behavior)].family == "gaze" else None
            goal = moves.goal_of(run)
        off = self._off(goal, angles)
        rests = self._has_come and (off is None or abs(off[1]) <= self.capabilities.gaze_half_angle)
        return getattr(look, "target", "") if rests else ""

    def see(self, world: World) -> None:
        self.moves.world = world
        if self._is_open:
            self.moves.follow()

    def _measured(self) -> Angles:
        """Measure the joints. Without a connection, as for `engage plan`, they are at rest."""
        return self.angles() if self._is_open else self.moves.home

    # -- motion -------------------------------------------------------------------------------------------------

    def set_off(self, goal: Angles) -> None:
        """Begin a motion, unless the joints stand there. Raises BodyFailed: the motors take no command.

        goal: angles of all joints.
        """
        self._came, self._has_come = -inf, False
        if self._goal is not None or self._off(goal) is not None:
            self._command(goal)

    def keep_at(self, goal: Angles) -> None:
        """Go after a goal that has moved; who is on the way there sees it by himself.

        goal: angles of all joints.
        """
        if self._goal is None and self._off(goal) is not None:
            with suppress(BodyFailed):
                self._command(goal)

    def _is_there(self, goal: Angles, sync: str) -> bool:
        """Tell if the measured joints are at a goal, which may have moved. Raises BodyFailed: they do not come."""
        self._note_arrival(angles := self._measured())
        if self._goal is None and self._off(goal, angles) is None:
            self._has_come = True
            return True
        if self._goal is None or _apart(self._goal, goal) > self.near:
            self._command(goal)
        elif self._failure is not None:
            raise self._failure
        elif self._overdue.due(self._loop.time()) is not None:
            raise BodyFailed(self._short(goal, sync))
        return False

    def _note_arrival(self, angles: Angles) -> None:
        """Note that a motion has come to its end, whether somebody waits for that or not."""
        if self._goal is not None and self._off(self._goal, angles) is None:
            self._goal, self._came, self._has_come = None, self._loop.time(), True

    def _short(self, goal: Angles, sync: str) -> Fault:
        joint, angle = self._off(goal) or ("", 0.0)
        since, began, planned = self._told
        turned = self._measured().get(joint, 0.0) - since.get(joint, 0.0)
        is_other_way = turned * angle < 0.0 and abs(turned) > self.near
        where = f"{math.degrees(abs(angle)):.1f} degrees short of its goal"
        other_way = ", and has turned the other way" if is_other_way else ""
        return Fault(
            reason=f"{joint} stands {where} {self._loop.time() - began:.1f} s after the command to go to its {sync}; "
                   f"planned were {planned:.1f} s{other_way}",
            advice=self.suspicion(joint, is_other_way=is_other_way), service="control",
        )  # fmt: skip

    def suspicion(self, joint: str, *, is_other_way: bool) -> str:
        """Tell why a joint may not have come.

        joint: its name. is_other_way: it has moved, the other way.
        """
        return "is a sign turned around?" if is_other_way else "is the motor on, free and not too hot?"

    def _command(self, goal: Angles) -> None:
        """Command the motors, and expect the joints to be measured there in time."""
        here, now = self._measured(), self._loop.time()
        seconds = self._seconds(here, goal)
        self._told, self._goal, self._failure = (here, now, seconds), goal, None
        self._overdue.set("goal", now + self.patience * seconds + 1.0)
        self._next = (goal, max(0.0, seconds - self.settling))
        self._send_next()

    def _send_next(self) -> None:
        """Send the command that is due, or, while one that takes time is under way, the last one after it.

        Two at once would reach the motors in any order.
        """
        while self._next is not None and self._sending is None:
            command, self._next = self._next, None
            if (sent := self.go(*command)) is not None:
                self._sending = asyncio.ensure_future(sent)
                self._sending.add_done_callback(self._was_sent)

    def _was_sent(self, sent: "asyncio.Future[None]") -> None:
        self._sending = None
        if sent.cancelled():
            return
        try:
            sent.result()
            self._send_next()
        except Exception as error:
            self._failure = error

    def _off(self, goal: Angles, here: Angles | None = None) -> tuple[str, Radians] | None:
        """The joint that is farthest from the goal, and by how much; None: all are near. here: None: measured now."""
        here = self._measured() if here is None else here
        off = {joint: goal[joint] - here[joint] for joint in goal}
        joint = max(off, key=lambda name: abs(off[name]), default="")
        return (joint, off[joint]) if off and abs(off[joint]) > self.near else None


def _apart(one: Angles, other: Angles) -> Radians:
    return max((abs(one[joint] - other[joint]) for joint in one), default=0.0)


def _pose(angles: Angles) -> BodyPose:
    return BodyPose(joints=tuple(JointAngle(joint, angle) for joint, angle in angles.items()))


def _now() -> Seconds:
    return asyncio.get_running_loop().time()


def by_instant(behavior: BlockBehavior, way: Way) -> Mapping[str, Angles]:
    """The goals of a way by the first point of each instant, when the joints have to be there."""
    first = {sync: group[0] for group in TYPES[type_name(behavior)].one_instant for sync in group}
    return {first.get(sync, sync): goal for sync, goal in way}


def refused(behavior: BlockBehavior, reason: str) -> BehaviorRefused:
    """The refusal of a behavior, with the reason."""
    return BehaviorRefused(Fault(reason=reason, where=behavior.id, service="control"))

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
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from typing import ClassVar, NamedTuple

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import BlockBehavior, Pointing
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, JointAngle, JointLimit, Phase, Ray
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.bus.deadlines import Sight, Silences
from engage_hri.services.control.contract.body import (
    Arrived,
    BehaviorRefused,
    Body,
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    Reached,
    Revoked,
    TakenOver,
)
from engage_hri.services.control.contract.refusals import infeasible

Angles = Mapping[str, Radians]
Way = Sequence[tuple[str, Angles]]
"""Joint angles at which sync points are passed, in order."""


class _Doing:
    """A behavior that has the part. sync: the point whose goal it is at, or on its way to; empty: none yet."""

    def __init__(self, behavior: BlockBehavior, authority: MovementAuthority, goals: Mapping[str, Angles]) -> None:
        self.behavior, self.authority, self.goals = behavior, authority, goals
        self.sync = ""


class _Look(NamedTuple):
    """An entity that the eyes were turned to. goal: where the joints are for it."""

    target: str
    goal: Callable[[], Angles]


class OrdinaryBody(Body):
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

    def __init__(self) -> None:
        self.capabilities = Capabilities(
            body=self.name, types=self.types, parts=(self.part,), joints=self.joints, reach=self.reach
        )
        self.world = World(entities=())
        self._home: Angles = {limit.joint: self.rest.get(limit.joint, 0.0) for limit in self.joints}
        self._base: Angles = self._home
        """Where it rests: at home, or where a shift has taken it."""
        self._sight = Sight("control")
        self._settled: BlockBehavior | None = None
        """The shift that has set where it rests; None: it rests at home."""
        self._shifts = 0
        """Number of times that a behavior or `home` has set where it rests."""
        self._doing: _Doing | None = None
        self._look: _Look | None = None
        self._goal: Angles | None = None
        """Where the joints are on their way to; None: they stand."""
        self._from: Angles = {}
        """Where the joints were as the last command was sent."""
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
        """The whole way of a behavior, with the way back to rest. Raises BehaviorRefused."""
        if type_name(behavior) not in self.types:
            raise refused(behavior, f"this body has no {type_name(behavior)}")
        way = list(self.way(behavior, world))
        for sync, goal in way:
            self._check(behavior, sync, goal)
        if way[-1][0] != "end":
            way.append(("end", self._base))
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

    def _goals(self, behavior: BlockBehavior, world: World) -> Mapping[str, Angles]:
        """The goals of a behavior, as `by_instant`. Raises BehaviorRefused."""
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
            way = self._way(behavior, world)
        except BehaviorRefused as refused:
            target = getattr(behavior, "target", "")
            warning = "NO_SUCH_TARGET" if target and world.entity(target) is None else "CANNOT_CREATE_BEHAVIOR"
            if type_name(behavior) not in self.types:
                warning = "BEHAVIOR_TYPE_NOT_SUPPORTED"
            return infeasible(behavior.id, warning, refused.fault)
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

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        row = TYPES[type_name(behavior)]
        doing = _Doing(behavior, authority, self._goals(behavior, self.world))
        at = came = _now()
        is_beneath = row.turns_base and self._doing is not None and self._doing.authority.points != row.points
        if row.turns_base:
            self._rest_at(doing.goals["end"], behavior)
        shifts = self._shifts
        if is_beneath:  # beneath a look nothing moves
            for sync in authority.points:
                yield Reached(sync, at, at)
            return
        if self._doing is not None:
            self._doing.authority.revoke("taken_over")  # it wakes, and ends without its next points
        self._doing = doing
        passed = 0
        try:
            for sync in authority.points:
                if sync in doing.goals:
                    arrived = await self._reach(sync, doing)
                    at = came = at if arrived is None else arrived
                hold = _last_of_instant(row.one_instant, sync)
                if hold in row.holds and not authority.covers(hold):
                    yield Arrived(hold, came := at)
                    await authority.granted(hold)
                    at = max(_now(), await self._stay(doing) or 0.0)
                yield Reached(sync, at, came)
                passed += 1
                if hold == sync:  # the next point is another instant
                    came = at
        except Revoked:
            if row.turns_base and authority.revoked == "taken_over" and self._shifts == shifts:
                yield Reached("end", _now(), _now())  # a look lies over it, and goes home to there
        finally:
            if self._doing is doing:
                self._doing = None
                if passed < len(authority.points):
                    with suppress(BodyFailed):
                        self._command(self._base)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if parts and self.part not in parts:
            return
        if self._doing is not None:
            self._doing.authority.revoke()
            self._doing = None
        self._rest_at(self._home, None)
        await self._move(lambda: self._home, None, "home")

    def state(self) -> BodyState:
        angles = self._measured()
        arm = self.forearm(angles)
        self._note_arrival(angles)
        return BodyState(
            pose=_pose(angles), moving=self._goal is not None, gaze=self.gaze(angles),
            left_arm=arm if self.part == "left_arm" else None,
            right_arm=arm if self.part != "left_arm" else None,
            looking_at=self._look.target if self._look is not None and self._rests_on(self._look, angles) else "",
        )  # fmt: skip

    def see(self, world: World) -> None:
        before, self.world = self.world, world
        if self._is_open:
            self._follow(before)

    def _measured(self) -> Angles:
        """Measure the joints. Without a connection, as for `engage plan`, they are at rest."""
        return self.angles() if self._is_open else self._home

    # -- what moves in the world --------------------------------------------------------------------------------

    def _rest_at(self, base: Angles, shift: BlockBehavior | None) -> None:
        self._base, self._settled = base, shift
        self._shifts += 1

    def _follow(self, before: World) -> None:
        """Aim anew where a target has moved. What is out of reach now is looked at where it was last."""
        doing, has_moved = self._doing, False
        if self._settled is not None and self._moved(self._settled, before):
            with suppress(BehaviorRefused):
                self._base = self._goals(self._settled, self.world)["end"]
                has_moved = doing is None
        if doing is not None and self._moved(doing.behavior, before):
            with suppress(BehaviorRefused):
                doing.goals = self._goals(doing.behavior, self.world)
                has_moved = True
        goal = self._base if doing is None else doing.goals.get(doing.sync)
        if has_moved and goal is not None and self._goal is None:  # else who moves it sees the new goal
            with suppress(BodyFailed):
                if self._off(goal) is not None:
                    self._command(goal)

    def _moved(self, behavior: BlockBehavior, before: World) -> bool:
        target = getattr(behavior, "target", "")
        was, now = before.entity(target), self.world.entity(target)
        return was is not None and now is not None and was.position != now.position

    def _rests_on(self, look: _Look, angles: Angles) -> bool:
        off = self._off(look.goal(), angles)
        return off is None or abs(off[1]) <= self.capabilities.gaze_half_angle

    # -- motion -------------------------------------------------------------------------------------------------

    async def _reach(self, sync: str, doing: _Doing) -> Seconds | None:
        """Move to where a sync point is. Returns when the joints were measured there; None: they were already."""
        doing.sync = sync
        if sync == "end":
            arrived = await self._move(lambda: self._base, doing.authority, sync)
            self._look_at(self._settled, lambda: self._base)
            return arrived
        arrived = await self._move(lambda: doing.goals[sync], doing.authority, sync)
        is_look = TYPES[type_name(doing.behavior)].family == "gaze"
        self._look_at(doing.behavior if is_look else None, lambda: doing.goals[sync])
        return arrived

    async def _stay(self, doing: _Doing) -> Seconds | None:
        """Go back to where it waits if it is elsewhere: a motor gives way, a target moves on. Returns as `_reach`."""
        return await self._reach(doing.sync, doing) if doing.sync else None

    def _look_at(self, behavior: BlockBehavior | None, goal: Callable[[], Angles]) -> None:
        target = getattr(behavior, "target", "")
        self._look = _Look(target, goal) if target else None

    async def _move(
        self, goal: Callable[[], Angles], authority: MovementAuthority | None, sync: str
    ) -> Seconds | None:
        """Move until the measured angles are at the goal, which may move. Raises Revoked, TakenOver or BodyFailed."""
        if authority is not None and authority.revoked:
            raise Revoked
        if self._off(goal()) is None and self._goal is None:
            return None
        self._look, to, time = None, None, Silences[str](self._sight)
        seconds = began = 0.0
        while to is None or _apart(to, goal()) > self.near or self._off(goal()) is not None:
            if authority is not None and authority.revoked:
                raise Revoked
            if authority is None and self._doing is not None:
                raise TakenOver((self.part,))
            if to is None or _apart(to, goal()) > self.near:
                to, began = goal(), _now()
                seconds = self._command(to)
                time.set(sync, began + self.patience * seconds + 1.0)
            elif self._failure is not None:
                raise self._failure
            elif time.due(_now()) is not None:
                raise BodyFailed(self._short(goal(), sync, _now() - began, seconds))
            await asyncio.sleep(1.0 / self.rate)
        self._goal = None
        return _now()

    def _short(self, goal: Angles, sync: str, waited: Seconds, planned: Seconds) -> Fault:
        joint, angle = self._off(goal) or ("", 0.0)
        turned = self._measured().get(joint, 0.0) - self._from.get(joint, 0.0)
        is_other_way = turned * angle < 0.0 and abs(turned) > self.near
        where = f"{math.degrees(abs(angle)):.1f} degrees short of its goal"
        other_way = ", and has turned the other way" if is_other_way else ""
        return Fault(
            reason=f"{joint} stands {where} {waited:.1f} s after the command to go to its {sync}; planned were "
                   f"{planned:.1f} s{other_way}",
            advice="is a sign turned around?" if is_other_way else "is the motor on, free and not too hot?",
            service="control",
        )  # fmt: skip

    def _command(self, goal: Angles) -> Seconds:
        """Command the motors. Returns the time that is planned until the joints are measured there."""
        self._from = self._measured()
        seconds = self._seconds(self._from, goal)
        self._goal, self._failure = goal, None
        self._next = (goal, max(0.0, seconds - self.settling))
        self._send_next()
        return seconds

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
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        """Let the motion fail that is under way, since the motors did not take a command."""
        self._failure = error

    def _note_arrival(self, angles: Angles) -> None:
        """Note that a motion that nobody waits for has come to its end."""
        if self._goal is not None and self._off(self._goal, angles) is None:
            self._goal = None
            if self._doing is None:
                self._look_at(self._settled, lambda: self._base)

    def _off(self, goal: Angles, here: Angles | None = None) -> tuple[str, Radians] | None:
        """The joint that is farthest from the goal, and by how much; None: all are near. here: None: measured now."""
        here = self._measured() if here is None else here
        off = {joint: goal[joint] - here[joint] for joint in goal}
        joint = max(off, key=lambda name: abs(off[name]), default="")
        return (joint, off[joint]) if off and abs(off[joint]) > self.near else None


def _apart(one: Angles, other: Angles) -> Radians:
    return max((abs(one[joint] - other[joint]) for joint in one), default=0.0)


def _last_of_instant(groups: Sequence[Sequence[str]], sync: str) -> str:
    """The point at which the points of one instant wait together: the last one of them."""
    return next((group[-1] for group in groups if sync in group), sync)


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

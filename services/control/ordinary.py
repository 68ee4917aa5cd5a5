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
from collections.abc import AsyncGenerator, AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from typing import ClassVar

from engage_hri.schemas.behavior_types import TYPES, BehaviorType
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, JointAngle, JointLimit, Phase, Ray
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.control.body import (
    Arrived,
    BehaviorRefused,
    Body,
    BodyFailed,
    BodyState,
    MovementAuthority,
    Progress,
    Reached,
    Revoked,
)
from engage_hri.services.control.refusals import infeasible

Angles = Mapping[str, Radians]
Way = Sequence[tuple[str, Angles]]
"""Joint angles at which sync points are passed, in order."""


class OrdinaryBody(Body):
    """A robot with one part, which makes one motion at a time.

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
        self._base_target = ""
        self._shifts = 0
        """Number of times that the base was set: a driver may give the same angles twice."""
        self._owner: MovementAuthority | None = None
        """The authority of the behavior that has the part."""
        self._looking_at = ""
        self._goal: Angles | None = None
        """Where the joints are on their way to; None: they stand."""
        self._is_open = False

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
    def go(self, goal: Angles, seconds: Seconds) -> None:
        """Command the motors to a goal, and return at once.

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
        points = TYPES[type_name(behavior)].points
        return [("stroke" if "stroke" in points else "end", self.aim(behavior, world))]

    def position(self, behavior: BlockBehavior, world: World) -> Vector:
        """Look up the position of a behavior's target, metres.

        behavior: one with a target.
        world: the entities that targets name, in metres.

        Raises:
            BehaviorRefused: the world has no such entity.
        """
        target = getattr(behavior, "target", "")
        if (entity := world.entity(target)) is None:
            raise _refused(behavior, f"the world has no {target!r}")
        return entity.position

    # -- the contract -------------------------------------------------------------------------------------------

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        await self.open()
        self._is_open = True
        try:
            yield
        finally:
            self._is_open = False
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
        goals, target = _by_instant(row, way), way[-2 if len(way) > 1 else -1][1]
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
        goals = _by_instant(row, self._way(behavior, self.world))
        at = came = _now()
        is_beneath = row.turns_base and self._owner is not None and self._owner.points != row.points
        if row.turns_base:
            self._base, self._base_target = goals["end"], getattr(behavior, "target", "")
            self._shifts += 1
        shifts = self._shifts
        if is_beneath:  # beneath a look nothing moves
            for sync in authority.points:
                yield Reached(sync, at, at)
            return
        if self._owner is not None:
            self._owner.revoke("taken_over")  # it wakes, and ends without its next points
        self._owner = authority
        passed = 0
        try:
            for sync in authority.points:
                if sync in goals:
                    arrived = await self._reach(sync, goals[sync], behavior, authority)
                    at = came = at if arrived is None else arrived
                hold = _last_of_instant(row.one_instant, sync)
                if hold in row.holds and not authority.covers(hold):
                    yield Arrived(hold, came := at)
                    await authority.granted(hold)
                    at = _now()
                yield Reached(sync, at, came)
                passed += 1
                if hold == sync:  # the next point is another instant
                    came = at
        except Revoked:
            if row.turns_base and authority.revoked == "taken_over" and self._shifts == shifts:
                yield Reached("end", _now(), _now())  # a look lies over it, and goes home to there
        finally:
            if self._owner is authority:
                self._owner = None
                if passed < len(authority.points):
                    with suppress(BodyFailed):
                        self._command(self._base)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        if parts and self.part not in parts:
            return
        if self._owner is not None:
            self._owner.revoke()
            self._owner = None
        self._base, self._base_target = self._home, ""
        self._shifts += 1
        with suppress(BodyFailed):
            await self._move(self._home, None, "home")

    def state(self) -> BodyState:
        angles = self._measured()
        arm = self.forearm(angles)
        self._note_arrival(angles)
        return BodyState(
            pose=_pose(angles), moving=self._goal is not None, gaze=self.gaze(angles),
            left_arm=arm if self.part == "left_arm" else None,
            right_arm=arm if self.part != "left_arm" else None,
            looking_at=self._looking_at,
        )  # fmt: skip

    def see(self, world: World) -> None:
        self.world = world

    def _measured(self) -> Angles:
        """Measure the joints. Without a connection, as for `engage plan`, they are at rest."""
        return self.angles() if self._is_open else self._home

    # -- motion -------------------------------------------------------------------------------------------------

    def _way(self, behavior: BlockBehavior, world: World) -> Way:
        """The whole way of a behavior, with the way back to rest. Raises BehaviorRefused."""
        if type_name(behavior) not in self.types:
            raise _refused(behavior, f"this body has no {type_name(behavior)}")
        way = list(self.way(behavior, world))
        for sync, goal in way:
            self._check(behavior, sync, goal)
        if way[-1][0] != "end":
            way.append(("end", self._base))
        return way

    def _check(self, behavior: BlockBehavior, sync: str, goal: Angles) -> None:
        for limit in self.joints:
            if limit.joint not in goal:
                raise _refused(behavior, f"the driver names no angle of {limit.joint} for {sync}")
            angle = goal[limit.joint]
            if not limit.low - 1e-9 <= angle <= limit.high + 1e-9:
                low, high = math.degrees(limit.low), math.degrees(limit.high)
                wanted = f"{limit.joint} would be at {math.degrees(angle):.0f} degrees"
                reason = f"{wanted}; it goes from {low:.0f} to {high:.0f}"
                raise _refused(behavior, reason)

    async def _reach(
        self, sync: str, goal: Angles, behavior: BlockBehavior, authority: MovementAuthority
    ) -> Seconds | None:
        """Move to where a sync point is. Returns when the joints were measured there; None: they were already."""
        if sync != "end":
            arrived = await self._move(goal, authority, sync)
            self._looking_at = getattr(behavior, "target", "") if TYPES[type_name(behavior)].family == "gaze" else ""
            return arrived
        arrived, shifts = None, -1
        while shifts != self._shifts:  # again, if a shift has set another base meanwhile
            shifts, goal = self._shifts, self._base
            came = await self._move(goal, authority, sync)
            arrived = arrived if came is None else came
        self._looking_at = self._base_target
        return arrived

    async def _move(self, goal: Angles, authority: MovementAuthority | None, sync: str) -> Seconds | None:
        """Move until the measured angles are at the goal. Raises Revoked or BodyFailed."""
        if authority is not None and authority.revoked:
            raise Revoked
        if self._off(goal) is None and self._goal is None:
            return None
        self._looking_at = ""
        seconds = self._command(goal)
        deadline = _now() + self.patience * seconds + 1.0
        while (off := self._off(goal)) is not None:
            if authority is not None and authority.revoked:
                raise Revoked
            if _now() > deadline:
                joint, angle = off
                where = f"{math.degrees(abs(angle)):.1f} degrees short of its goal"
                raise BodyFailed(
                    Fault(reason=f"{joint} stands {where} {_now() - deadline + self.patience * seconds + 1.0:.1f} s "
                                 f"after the command to go to its {sync}; planned were {seconds:.1f} s",
                          advice="is the motor on, free and not too hot?", service="control")
                )  # fmt: skip
            await asyncio.sleep(1.0 / self.rate)
        self._goal = None
        return _now()

    def _command(self, goal: Angles) -> Seconds:
        """Command the motors. Returns the time that is planned until the joints are measured there."""
        seconds = self._seconds(self._measured(), goal)
        self._goal = goal
        self.go(goal, max(0.0, seconds - self.settling))
        return seconds

    def _note_arrival(self, angles: Angles) -> None:
        """Note that a motion that nobody waits for has come to its end."""
        if self._goal is not None and self._owner is None and self._off(self._goal) is None:
            self._goal = None
            self._looking_at = self._base_target

    def _off(self, goal: Angles) -> tuple[str, Radians] | None:
        """The joint that is farthest from the goal, and by how much; None: all are near."""
        here = self._measured()
        off = {joint: goal[joint] - here[joint] for joint in goal}
        joint = max(off, key=lambda name: abs(off[name]), default="")
        return (joint, off[joint]) if off and abs(off[joint]) > self.near else None

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


def _by_instant(row: BehaviorType, way: Way) -> dict[str, Angles]:
    """The goals of a way by the first point of each instant: that is when the joints have to be there."""
    first = {sync: group[0] for group in row.one_instant for sync in group}
    return {first.get(sync, sync): goal for sync, goal in way}


def _last_of_instant(groups: Sequence[Sequence[str]], sync: str) -> str:
    """The point at which the points of one instant wait together: the last one of them."""
    return next((group[-1] for group in groups if sync in group), sync)


def _pose(angles: Angles) -> BodyPose:
    return BodyPose(joints=tuple(JointAngle(joint, angle) for joint, angle in angles.items()))


def _refused(behavior: BlockBehavior, reason: str) -> BehaviorRefused:
    return BehaviorRefused(Fault(reason=reason, where=behavior.id, service="control"))


def _now() -> Seconds:
    return asyncio.get_running_loop().time()

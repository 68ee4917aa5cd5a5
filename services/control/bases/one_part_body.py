"""A robot with one part as its driver knows it: where its joints have to be for a behavior. No motion, no time."""

import math
from abc import abstractmethod
from collections.abc import Awaitable, Mapping, Sequence
from typing import ClassVar

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import BlockBehavior, Pointing
from engage_hri.schemas.body import Capabilities, JointLimit, Ray
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Meters, Radians, Seconds, Vector
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import BehaviorRefused, Body

Angles = Mapping[str, Radians]
Way = Sequence[tuple[str, Angles]]
"""Joint angles at which sync points are passed, in order."""


class DrivenBody(Body):
    """A robot with one part, as its driver says. `OrdinaryBody` moves it.

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


def by_instant(behavior: BlockBehavior, way: Way) -> Mapping[str, Angles]:
    """The goals of a way by the first point of each instant, when the joints have to be there."""
    first = {sync: group[0] for group in TYPES[type_name(behavior)].one_instant for sync in group}
    return {first.get(sync, sync): goal for sync, goal in way}


def refused(behavior: BlockBehavior, reason: str) -> BehaviorRefused:
    """The refusal of a behavior, with the reason."""
    return BehaviorRefused(Fault(reason=reason, where=behavior.id, service="control"))

"""A body of several drivers, each with parts of its own: a head from one, the voice from another.

A behavior goes to the first driver that performs its type and can do it with the parts that it has here. Each driver
knows only its own joints; what one says of poses is completed with where the others are.
"""

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Iterable, Mapping, Sequence
from contextlib import AsyncExitStack, aclosing, asynccontextmanager
from dataclasses import dataclass
from functools import cached_property
from math import inf

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, EstimateItem, JointAngle, JointLimit, Ray
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Radians
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import (
    BehaviorRefused,
    Body,
    BodyState,
    Idle,
    MouthShape,
    MovementAuthority,
    Progress,
    Seen,
)
from engage_hri.services.control.contract.refusals import infeasible, unsupported
from engage_hri.services.runtime.steps import Steps, finished

GAZE_PART, LIPS_PART, VOICE_PART = "head", "face", "voice"
"""Parts whose owner tells the gaze axis, has the lips, and says what is being said."""
ARMS = ("left_arm", "right_arm")
PARTS_OF_TYPES = {
    **dict.fromkeys(("gaze", "gazeShift", "headDirectionShift", "head"), (GAZE_PART,)),
    **dict.fromkeys(("face", "faceLexeme", "faceFacs", "faceShift"), (LIPS_PART,)),
    **dict.fromkeys(("pointing", "gesture"), ARMS),
    **dict.fromkeys(("posture", "postureShift", "pose"), ("torso", *ARMS)),
    "speech": (VOICE_PART,),
}
"""Parts of which a type of behavior needs one, where a driver has such parts."""


@dataclass(frozen=True, eq=False)
class Member:
    """A driver in a composed body. name: as it was asked for. parts: those of its parts that it has here."""

    name: str
    body: Body
    parts: tuple[str, ...]

    @cached_property  # these are asked for each behavior, and many times a second
    def is_whole(self) -> bool:
        return set(self.parts) == set(self.body.capabilities.parts)

    @cached_property
    def types(self) -> tuple[str, ...]:
        """Types of behaviors that it can perform with the parts that it has here."""
        return tuple(name for name in self.body.capabilities.types if self._can(name))

    @cached_property
    def limits(self) -> tuple[JointLimit, ...]:
        """Limits of the joints that it has here."""
        every = self.body.capabilities.joints
        return every if self.is_whole else tuple(limit for limit in every if limit.part in self.parts)

    @cached_property
    def joints(self) -> frozenset[str]:
        """Names of the joints in `limits`."""
        return frozenset(limit.joint for limit in self.limits)

    def tells_of(self, joint: str) -> bool:
        """True if what it says of this joint counts; of a driver with all its parts that is everything."""
        return self.is_whole or joint in self.joints

    def _can(self, name: str) -> bool:
        needed = [part for part in PARTS_OF_TYPES.get(name, ()) if part in self.body.capabilities.parts]
        return not needed or any(part in self.parts for part in needed)

    def plays(self, fault: BodyFault) -> bool:
        """True if it can play this fault, at a part or a joint that it has here."""
        is_here = not fault.part or fault.part in self.parts or fault.part in self.joints
        return is_here and fault.kind in self.body.capabilities.faults

    def has(self, part: str) -> bool:
        """True if it has this part here. A driver with all its parts may have given the part another name."""
        return part in self.parts or (self.is_whole and part not in self.body.capabilities.parts)


def refuse_conflicts(members: Sequence[Member]) -> None:
    """Raise InputRefused if a part or a joint is of two of them."""
    owner: dict[tuple[str, str], Member] = {}
    for member in members:
        for kind, names in (("part", member.parts), ("joint", sorted(member.joints))):
            for name in names:
                other = owner.setdefault((kind, name), member)
                if other is not member:
                    reason = f"{other.name} and {member.name} both have the {kind} {name!r}"
                    rest = ",".join(part for part in member.parts if part not in other.parts)
                    spec = member.name.rpartition("=")[2]
                    advice = "say whose it is, by the parts that the other is to have"
                    advice += f": {rest}={spec}" if rest else ""
                    raise InputRefused(Fault(reason=reason, where="control.body", advice=advice, service="control"))


def refuse_carried(members: Sequence[Member]) -> None:
    """Raise InputRefused if a part that stands on another one, as a driver says, is not of the driver of that."""
    owner = {part: member for member in members for part in member.parts}
    stands = {
        (part, carrier): None for member in members for carrier, own in member.body.carries.items() for part in own
    }
    for part, carrier in stands:
        if part in owner and carrier in owner and owner[part] is not owner[carrier]:
            on, away = owner[carrier].name, owner[part].name
            reason = f"{part} of {away} stands on {carrier} of {on}, and {away} would not know where that is"
            advice = f"take {part} and {carrier} from one driver, or leave {carrier} out: then it stands still"
            raise InputRefused(Fault(reason=reason, where="control.body", advice=advice, service="control"))


def composed(members: Sequence[Member]) -> Body:
    """Make one body of several; a single one with all its parts stays as it is. Raises InputRefused: a conflict."""
    if len(members) == 1 and members[0].is_whole:
        return members[0].body
    if not members:
        raise InputRefused(Fault(reason="no body is named", where="control.body", advice="such as `simulated`"))
    return ComposedBody(members)


class ComposedBody(Body):
    """Several bodies as one. Capabilities add up."""

    def __init__(self, members: Sequence[Member]) -> None:
        """Join `members`. Raises InputRefused: one part or joint is of two, or one carries the other's."""
        self._members = tuple(members)
        refuse_conflicts(self._members)
        refuse_carried(self._members)
        self.capabilities = _joined(self._members)
        self._world = World(entities=())
        for member in self._members:
            member.body.on_fault = self._tell_fault
            member.body.on_recovery = lambda text: self.on_recovery(text)
            member.body.on_lips = self.move_lips
            member.body.on_sound = lambda sound: self.on_sound(sound)
            member.body.wants_sound = lambda: self.wants_sound()
            member.body.others_say = self._saying

    def _tell_fault(self, fault: Fault) -> None:
        self.on_fault(fault)

    def _saying(self) -> str:
        """Words that are said now, by a voice of this body or by one beside it."""
        said = (member.body.state().speaking for member in self._members if member.has(VOICE_PART))
        return next(filter(None, said), "") or self.others_say()

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        async with AsyncExitStack() as stack:
            for member in self._members:
                await stack.enter_async_context(member.body.connected())
            yield

    # -- planning -----------------------------------------------------------------------------------------------

    def prepare(self, behaviors: Sequence[BlockBehavior]) -> Awaitable[None] | None:
        begun = [
            member.body.prepare([each for each in behaviors if type_name(each) in member.types])
            for member in self._members
        ]
        waited = [each for each in begun if each is not None]
        return _all(waited) if waited else None

    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        _, estimate = self._best(behavior, pose, world)
        return self._completed(estimate, pose)

    def rehearse(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Sequence[Estimate]:
        return finished(self.rehearse_in_steps(items, world, others))

    def rehearse_in_steps(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Steps[Sequence[Estimate]]:
        told: dict[int, Estimate] = {}
        owners = [self._owner(item.behavior, item.pose, world) for item in items]
        whose = [self._owner(item.behavior, item.pose, world) for item in others]
        for member in self._members:
            mine = [number for number, owner in enumerate(owners) if owner is member]
            beside = [item for item, owner in zip(others, whose, strict=True) if owner is member]
            if mine:
                estimates = yield from member.body.rehearse_in_steps(
                    [items[number] for number in mine], world, beside
                )
                told |= dict(zip(mine, (_within(member, each) for each in estimates), strict=True))
        for number, owner in enumerate(owners):
            if owner is None:
                told[number] = unsupported(items[number].behavior)
        return [self._completed(told[number], item.pose) for number, item in enumerate(items)]

    def _owner(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Member | None:
        """The driver that is to perform a behavior; None: nobody performs its type."""
        able = self._able(behavior)
        return able[0] if len(able) == 1 else self._best(behavior, pose, world)[0]

    def _able(self, behavior: BlockBehavior) -> list[Member]:
        name = type_name(behavior)
        return [member for member in self._members if name in member.types]

    def _best(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> tuple[Member | None, Estimate]:
        """The first driver that can perform a behavior, and its estimate; else the first one's reason."""
        refused: tuple[Member | None, Estimate] | None = None
        for member in self._able(behavior):
            estimate = _within(member, member.body.estimate(behavior, pose, world))
            if estimate.feasible:
                return member, estimate
            refused = refused or (member, estimate)
        return refused or (None, unsupported(behavior))

    def _completed(self, estimate: Estimate, pose: BodyPose | None) -> Estimate:
        """Complete the poses of an estimate with the joints of the other drivers."""
        if estimate.pose_after is None and estimate.pose_end is None:
            return estimate
        here = _joints(self._pose())
        if pose is not None:
            here |= _joints(pose)
        after, end = (
            None if told is None else BodyPose(joints=tuple((here | _joints(told)).values()))
            for told in (estimate.pose_after, estimate.pose_end)
        )
        return replace(estimate, pose_after=after, pose_end=end)

    # -- motion -------------------------------------------------------------------------------------------------

    async def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        member = self._performer(behavior)
        async with aclosing(member.body.perform(behavior, authority)) as stream:
            async for progress in stream:
                yield progress

    def _performer(self, behavior: BlockBehavior) -> Member:
        """The driver that is to perform a behavior now. Raises BehaviorRefused."""
        able = self._able(behavior)
        if len(able) == 1 and able[0].is_whole:
            return able[0]  # it refuses by itself what it cannot do
        member, estimate = self._best(behavior, None, self._world)
        if member is None or not estimate.feasible:
            raise BehaviorRefused(estimate.fault or Fault(reason="it cannot be done", where=behavior.id))
        return member

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        ways = []
        for member in self._members:
            mine = tuple(part for part in parts or member.parts if part in member.parts)
            if not parts and member.is_whole:
                mine = ()  # all: so it takes home also what is in no list of parts
            if mine or not parts:
                ways.append(member.body.home(mine))
        # Who fails keeps nobody else from going home.
        failed = [each for each in await asyncio.gather(*ways, return_exceptions=True) if each is not None]
        if failed:
            raise failed[0]

    def move_lips(self, shapes: Sequence[MouthShape]) -> None:
        for member in self._members:
            if member.has(LIPS_PART):
                member.body.move_lips(shapes)

    # -- faults -------------------------------------------------------------------------------------------------

    @property
    def faults(self) -> tuple[BodyFault, ...]:
        return tuple(dict.fromkeys(fault for member in self._members for fault in member.body.faults))

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        whose: dict[Member, list[BodyFault]] = {member: [] for member in self._members}
        for fault in faults:
            players = [member for member in self._members if member.plays(fault)]
            if not players:
                reason, where = (
                    f"no driver of this body can play {fault.kind!r}",
                    f"{fault.kind} {fault.part}".strip(),
                )
                raise InputRefused(Fault(reason=reason, where=where, service="control"))
            for member in players if not fault.part else players[:1]:
                whose[member].append(fault)
        before = [(member, member.body.faults) for member in self._members]
        try:
            for member in self._members:
                if member.body.capabilities.faults:
                    member.body.switch_faults(whose[member])
        except InputRefused:
            for member, played in before:
                if member.body.capabilities.faults:
                    member.body.switch_faults(played)
            raise

    def idle(self) -> Idle:
        added: dict[str, Radians] = {}
        quick_at = inf
        for member in self._members:
            idle = member.body.idle()
            added |= {joint: angle for joint, angle in idle.added.items() if member.tells_of(joint)}
            quick_at = min(quick_at, idle.quick_at)
        return Idle(added=added, quick_at=quick_at)

    # -- where it really points -----------------------------------------------------------------------------------

    def seen(self) -> Seen | None:
        told = [(member, member.body.seen()) for member in self._members]
        if all(seen is None for _, seen in told):
            return None
        state = self.state()
        rays = {"gaze": state.gaze, "left_arm": state.left_arm, "right_arm": state.right_arm}
        parts = {"gaze": GAZE_PART, "left_arm": "left_arm", "right_arm": "right_arm"}
        for member, seen in told:
            for name, part in parts.items():
                if seen is not None and member.has(part) and getattr(seen, name) is not None:
                    rays[name] = getattr(seen, name)
        return Seen(**rays)

    def ray_at(self, part: str, pose: BodyPose) -> Ray | None:
        return _first(member.body.ray_at(part, pose) for member in self._members if member.has(part))

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        for member in self._members:
            member.body.calibrate({joint: angle for joint, angle in offsets.items() if joint in member.joints})
        known = {limit.joint for limit in self.capabilities.joints}
        if unknown := [joint for joint in offsets if joint not in known]:
            reason, advice = f"no joint {', '.join(unknown)}", f"it has {', '.join(sorted(known))}"
            raise InputRefused(Fault(reason=reason, where="control.calibration", advice=advice, service="control"))

    # -- measurements -------------------------------------------------------------------------------------------

    def _pose(self) -> BodyPose:
        return _pose((member, member.body.state()) for member in self._members)

    def state(self) -> BodyState:
        states = [(member, member.body.state()) for member in self._members]
        seeing = next((state for member, state in states if member.has(GAZE_PART) and state.gaze is not None), None)
        return BodyState(
            pose=_pose(states),
            moving=any(state.moving for _, state in states),
            gaze=seeing.gaze if seeing else None,
            left_arm=_first(state.left_arm for member, state in states if member.has("left_arm")),
            right_arm=_first(state.right_arm for member, state in states if member.has("right_arm")),
            looking_at=seeing.looking_at if seeing else "",
            speaking=next(filter(None, (state.speaking for member, state in states if member.has(VOICE_PART))), ""),
        )

    def see(self, world: World) -> None:
        self._world = world
        for member in self._members:
            member.body.see(world)


def _first(rays: Iterable[Ray | None]) -> Ray | None:
    return next((ray for ray in rays if ray is not None), None)


def _joints(pose: BodyPose) -> dict[str, JointAngle]:
    return {angle.joint: angle for angle in pose.joints}


def _pose(states: Iterable[tuple[Member, BodyState]]) -> BodyPose:
    angles = []
    for member, state in states:
        angles += [angle for angle in state.pose.joints if member.tells_of(angle.joint)]
    return BodyPose(joints=tuple(angles))


async def _all(awaited: Sequence[Awaitable[None]]) -> None:
    await asyncio.gather(*awaited)


def _within(member: Member, estimate: Estimate) -> Estimate:
    """The estimate of a driver for what it has here: refused if it would use another part."""
    beyond = [part for part in estimate.parts if part not in member.parts]
    if not estimate.feasible or member.is_whole:
        return estimate
    if not beyond:
        after, end = (
            pose and BodyPose(joints=tuple(each for each in pose.joints if each.joint in member.joints))
            for pose in (estimate.pose_after, estimate.pose_end)
        )
        return replace(estimate, pose_after=after, pose_end=end)
    reason = f"{member.name} is to have only {', '.join(member.parts)} here, and this takes {', '.join(beyond)}"
    fault = Fault(reason=reason, where=estimate.behavior, service="control")
    return infeasible(estimate.behavior, "BEHAVIOR_TYPE_NOT_SUPPORTED", fault)


def _joined(members: Sequence[Member]) -> Capabilities:
    each = [member.body.capabilities for member in members]
    none = Capabilities(body="", types=(), parts=())
    return Capabilities(
        body="+".join(one.body for one in each),
        types=tuple(dict.fromkeys(name for member in members for name in member.types)),
        parts=tuple(part for member in members for part in member.parts),
        joints=tuple(limit for member in members for limit in member.limits),
        reach=max((member.body.capabilities.reach for member in members if "pointing" in member.types), default=0.0),
        no_point_zones=tuple(dict.fromkeys(zone for one in each for zone in one.no_point_zones)),
        gaze_half_angle=max((one.gaze_half_angle for one in each), default=none.gaze_half_angle),
        pointing_radius=max((one.pointing_radius for one in each), default=none.pointing_radius),
        faults=tuple(dict.fromkeys(kind for one in each for kind in one.faults)),
        fault_kinds=tuple(kind for one in each for kind in one.fault_kinds),
    )

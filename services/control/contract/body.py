"""The contract of a body: behaviors in, measured sync points out. Everything specific to a robot is behind it.

The realizer knows sync points, not joints. A robot with an SDK joins by one class: `docs/control.md` walks through it
and `services/control/testing` is the suite that it has to pass.
"""

import asyncio
from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable, Iterable, Mapping, Sequence
from contextlib import asynccontextmanager
from math import inf
from typing import Any, ClassVar, Literal, Self, TypeVar

from msgspec import Struct

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, EstimateItem, Ray
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.runtime.steps import Steps

ELEMENTS = 128
"""Elements that an estimate counts for (see `runtime.steps`): some four are made between two pauses."""
AbortMode = Literal["relax", "freeze"]
Revocation = Literal["relax", "freeze", "taken_over"]
"""How a behavior ends early: by an abort, or since the body gives one of its parts to another behavior."""


class Arrived(Struct, frozen=True, tag="arrived"):
    """The body has come to a hold point that it may not pass yet, and waits there.

    sync: its name. at: loop time, seconds.
    """

    sync: str
    at: Seconds


class Reached(Struct, frozen=True, tag="reached"):
    """The body has passed a sync point.

    sync: its name. at: loop time, seconds. arrived: when it had come there; earlier than `at` if it had
    to wait.
    """

    sync: str
    at: Seconds
    arrived: Seconds


class Spoke(Struct, frozen=True, tag="spoke"):
    """The voice has finished a word.

    word: as it stands in the text. position: characters of the text said so far. at: loop time, seconds.
    """

    word: str
    position: int
    at: Seconds


Progress = Arrived | Reached | Spoke


class BehaviorRefused(EngageError):
    """The body cannot do this behavior. Nothing has moved."""


class BodyFailed(EngageError):
    """The behavior could not be finished. What had moved is on its way to the safe pose."""


class DriverBroken(BodyFailed):
    """The driver has broken off, and nobody knows where its parts are."""


class TakenOver(BodyFailed):
    """Another behavior has taken parts that were on their way home."""

    def __init__(self, parts: Iterable[str]) -> None:
        """Name the parts."""
        reason = f"another behavior has taken {', '.join(parts)} on the way home"
        super().__init__(Fault(reason=reason, service="control", cause="replaced"))


class Revoked(Exception):
    """The authority of the behavior is gone: it was aborted or taken over."""


class MovementAuthority:
    """Permission for a behavior to move on up to a sync point. It is extended, never shrunk; revoking it ends that.

    A simple body awaits `granted(sync)` before it leaves a hold point. One that plans ahead asks `covers` and
    is told of changes through `watch`.

    points: the sync points of the behavior, in order.
    held: true while the behavior is to wait at the next place where it can. Nothing is covered meanwhile, so a body
    that asks before it leaves a hold point waits there.
    revoked: how the behavior is to end, once `revoke` was called; None before.
    """

    def __init__(self, behavior: BlockBehavior, through: str, pace: Mapping[str, Seconds] | None = None) -> None:
        """Grant a behavior the way up to and including `through`.

        behavior: the behavior that is permitted.
        through: the last sync point that it may pass.
        pace: loop times in seconds, by sync point.

        Raises:
            ValueError: the behavior has no sync point `through`.
        """
        self.points = sync_points(behavior)
        self.held = False
        self._pace: Mapping[str, Seconds] = dict(pace or {})
        self.revoked: Revocation | None = None
        self._through = self._index(through)
        self._watchers: list[Callable[[], None]] = []

    @property
    def through(self) -> str:
        """The last sync point that may be passed without asking."""
        return self.points[self._through]

    @property
    def pace(self) -> Mapping[str, Seconds]:
        """Loop times in seconds at which the behavior is asked to reach its points, also while it is held.

        They are asked where its natural pace would miss them. A body with one pace only ignores them; the estimates
        of other bodies say how far they can follow.
        """
        return self._pace

    def covers(self, sync: str) -> bool:
        """True if `sync` may be passed now.

        sync: a sync point of the behavior.

        Raises:
            ValueError: the behavior has no such point.
        """
        return not self.held and self.is_granted(sync)

    def is_granted(self, sync: str) -> bool:
        """True if `sync` may be passed as soon as the behavior is not held.

        sync: a sync point of the behavior.

        Raises:
            ValueError: the behavior has no such point.
        """
        return self.points.index(sync) <= self._through

    def extend(self, through: str) -> None:
        """Let the behavior go on up to and including `through`. An earlier point than before changes nothing.

        through: a sync point of the behavior.

        Raises:
            ValueError: the behavior has no such point.
        """
        if (index := self._index(through)) > self._through:
            self._through = index
            self._tell()

    def set_pace(self, pace: Mapping[str, Seconds]) -> None:
        """Ask for these instants from now on, and no others.

        pace: loop times in seconds, by sync point.
        """
        if dict(pace) != self._pace:
            self._pace = dict(pace)
            self._tell()

    def hold(self) -> None:
        """Wait at the next place where the behavior can, until `go_on`. A second call changes nothing."""
        if not self.held:
            self.held = True
            self._tell()

    def go_on(self) -> None:
        """Go on as far as is granted."""
        if self.held:
            self.held = False
            self._tell()

    def revoke(self, how: Revocation = "relax") -> None:
        """End the behavior now. A second call changes nothing.

        how: go to the safe pose at once (`relax`), or stand still for a moment and then go (`freeze`); `taken_over`
        by the body itself, as it gives a part of this behavior to another.
        """
        if self.revoked is None:
            self.revoked = how
            self._tell()

    def watch(self, on_change: Callable[[], None]) -> Callable[[], None]:
        """Call `on_change` after each change, until the returned function is called.

        on_change: called on the event loop, without arguments.
        """
        self._watchers.append(on_change)
        return lambda: self._watchers.remove(on_change)

    async def granted(self, sync: str) -> None:
        """Wait until a sync point may be passed.

        sync: a sync point of the behavior.

        Raises:
            Revoked: the behavior is to end. Taken over just as it might pass, it passes.
            ValueError: the behavior has no such point.
        """
        changed = asyncio.Event()
        unwatch = self.watch(changed.set)
        try:
            while self.revoked is None and not self.covers(sync):
                changed.clear()
                await changed.wait()
        finally:
            unwatch()
        if self.revoked is not None and not (self.revoked == "taken_over" and self.covers(sync)):
            raise Revoked

    def _index(self, sync: str) -> int:
        if sync not in self.points:
            raise ValueError(f"no sync point {sync!r}: expected one of {', '.join(self.points)}")
        return self.points.index(sync)

    def _tell(self) -> None:
        for watcher in list(self._watchers):
            watcher()


class BodyState(Struct, frozen=True, kw_only=True):
    """Measurements of a body at one instant.

    pose: joint angles, radians. gaze: from the eyes. left_arm, right_arm: from the elbow, through the hand. A body
    without eyes or without that arm has None there.
    moving: true while anything moves or speaks. looking_at: id of the entity on the gaze axis; empty: none.
    speaking: the text that is being said; empty: none.
    """

    pose: BodyPose
    moving: bool
    gaze: Ray | None = None
    left_arm: Ray | None = None
    right_arm: Ray | None = None
    looking_at: str = ""
    speaking: str = ""


class MouthShape(Struct, frozen=True):
    """A shape of the lips, from an instant on.

    at: loop time, seconds. opening: 0 closed to 1 wide open. width: -1 rounded to 1 spread; 0 at rest.
    """

    at: Seconds
    opening: float
    width: float = 0.0


class SpokenSound(Struct, frozen=True):
    """A piece of what a voice says: 16 bit, little-endian, one channel.

    at: loop time at which the first sample is heard, seconds. rate: samples per second. samples: empty: nothing of
    what was told before is heard from `at` on.
    """

    at: Seconds
    rate: int
    samples: bytes = b""


class Seen(Struct, frozen=True, kw_only=True):
    """Rays as in `BodyState`, as people and cameras see them."""

    gaze: Ray | None = None
    left_arm: Ray | None = None
    right_arm: Ray | None = None


class Idle(Struct, frozen=True, kw_only=True):
    """Motion that belongs to no behavior: breath, blinks, lips with the voice.

    added: what it adds to the angles of joints that `Body.state` tells. quick_at: loop time from which on it changes
    quickly; earlier than now: it does; inf: not in sight.
    """

    added: Mapping[str, Radians] = {}
    quick_at: Seconds = inf


class Body(ABC):
    """A robot, or a simulation of one. Its methods are called on the event loop and must not block.

    capabilities: what it can do, for planners: types of behaviors, joints and their limits.
    Settings: of a driver with settings, the type of its one argument; a `msgspec.Struct` in which everything has a
    default. `control.drivers.NAME` of the configuration is read into it.
    on_fault: called with what goes wrong outside of any behavior, such as a lost connection. Whoever runs the body
    replaces it.
    on_recovery: called with a sentence when something of which `on_fault` has told is over. Whoever runs the body
    replaces it.
    carries: the parts that stand on another one and move with it, by that part. All of them are of one driver, or the
    carrier is of none: nobody tells a driver how parts of another move.
    others_say: tells what the voices of other drivers say now; empty: nothing. Who composes the body replaces it.
    on_lips: called by a voice with all the mouth shapes of what it begins to say, in time order, and with none when
    it falls silent early. Whoever runs the body replaces it.
    on_sound: called by a voice with what it is about to be heard of, in time order, wherever else its sound goes.
    wants_sound: tells whether anybody plays what `on_sound` is told. Whoever runs the body replaces both.
    """

    Settings: ClassVar[type[Struct] | None] = None
    capabilities: Capabilities
    carries: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    others_say: Callable[[], str] = staticmethod(lambda: "")
    on_fault: Callable[[Fault], None] = staticmethod(lambda fault: None)
    on_recovery: Callable[[str], None] = staticmethod(lambda text: None)
    on_lips: Callable[[Sequence[MouthShape]], None] = staticmethod(lambda shapes: None)
    on_sound: Callable[[SpokenSound], None] = staticmethod(lambda sound: None)
    wants_sound: Callable[[], bool] = staticmethod(lambda: False)

    @classmethod
    def configured(cls, config: ControlConfig, settings: Any) -> Self:
        """Make a body as the configuration says: with its settings as the one argument, if it has any.

        config: the whole section `control`. settings: a value of the type `Settings`; None: it has none.
        """
        return cls() if settings is None else cls(settings)  # type: ignore[call-arg]

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        """Connect to the hardware, for the body of `async with`; tasks of a driver live in here. By default nothing.

        Raises:
            RunFailed: it cannot be had now, with what to do; `engage up` tries again.
            InputRefused: it can never be had with these settings.
        """
        yield

    def move_lips(self, shapes: Sequence[MouthShape]) -> None:  # noqa: B027 - bodies without lips do nothing
        """Move the lips with a voice: replace all shapes that are to come. By default nothing.

        shapes: in time order; the last one closes the mouth. Empty: the voice has fallen silent.
        """

    def prepare(self, behaviors: Sequence[BlockBehavior]) -> Awaitable[None] | None:
        """Begin what estimates of these behaviors need and nobody can know at once, as the sound of new words.

        behaviors: those that are to be estimated.

        Returns what is to be awaited before they are asked for, a moment at most; None, as by default: nothing.
        """
        return None

    @abstractmethod
    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        """Estimate whether a behavior can be done and how long its phases take. Quick, since planning calls it often.

        behavior: what is to be done.
        pose: joint angles from which it would begin, radians; None: from where the body is.
        world: the entities that targets name, in metres.
        """

    def rehearse(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Sequence[Estimate]:
        """Estimate the behaviors of a plan. Not overridden, each is estimated by itself from its pose.

        items: the behaviors, with the times at which they are to begin and to wait. others: behaviors of other plans
        that move the body meanwhile, in the same way.
        world: the entities that targets name, in metres.
        """
        return [self.estimate(item.behavior, item.pose, world) for item in items]

    def rehearse_in_steps(
        self, items: Sequence[EstimateItem], world: World, others: Sequence[EstimateItem] = ()
    ) -> Steps[Sequence[Estimate]]:
        """Estimate as `rehearse` does, as a generator: at each `yield` other work may get its turn.

        Not overridden, behaviors that are each by themselves are estimated one by one. A plan is one step, and so are
        all where `rehearse` is overridden.

        items, world, others: as of `rehearse`. All of them stay as they are; where the body is may change meanwhile.
        """
        if type(self).rehearse is not Body.rehearse or any(item.times for item in items):
            return self.rehearse(items, world, others)
        told: list[Estimate] = []
        for item in items:
            told.append(self.estimate(item.behavior, item.pose, world))
            yield ELEMENTS
        return told

    @abstractmethod
    def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        """Perform a behavior: yield every sync point once, in order, when reached, and never past the authority.

        Ending after `end` means done; ending earlier means that the authority was revoked: by an abort, or by the
        body itself (`taken_over`), as another behavior takes a part. A point that the joints have not passed is never
        reported, however it ends. Parts that no other behavior has go on to their safe pose by themselves.

        behavior: what is to be done.
        authority: how far it may go now; more is granted while it runs.

        Raises:
            BehaviorRefused: it can't be done; before the first progress.
            BodyFailed: it could not be finished.
        """

    @abstractmethod
    async def home(self, parts: tuple[str, ...] = ()) -> None:
        """Move to the safe pose, and return when the body is there. Behaviors that move these parts end as aborted.

        parts: names of parts, as in `capabilities`; empty: all.

        Raises:
            TakenOver: a behavior that came later has a part now.
            BodyFailed: the body does not come there.
        """

    @abstractmethod
    def state(self) -> BodyState:
        """Measure the body now."""

    @abstractmethod
    def see(self, world: World) -> None:
        """Take note of a changed world: gaze follows its entities.

        world: all that is perceived, in metres.
        """

    # -- what no body needs to have -----------------------------------------------------------------------------

    @property
    def faults(self) -> tuple[BodyFault, ...]:
        """Faults that it plays now; a real body plays none."""
        return ()

    def switch_faults(self, faults: Sequence[BodyFault]) -> None:
        """Play exactly these faults from now on, in what is under way, too. By default it can play none.

        faults: each of a kind in `capabilities.faults`, with what `schemas.body_faults.KINDS` lets it have.

        Raises:
            InputRefused: it cannot play one of them, or not now. Nothing has changed.
        """
        if faults:
            reason, advice = f"this body cannot play {faults[0].kind!r}", "only simulated bodies play faults"
            raise InputRefused(Fault(reason=reason, where=faults[0].kind, advice=advice, service="control"))

    def seen(self) -> Seen | None:
        """Tell where a simulated body really looks and points, if that is not where it measures.

        None: it is as it measures; and a real body, which everybody sees.
        """
        return None

    def idle(self) -> Idle:
        """Tell what it adds by itself to the posture of `state` now. None of it is in `state`, or in an estimate."""
        return Idle()

    def ray_at(self, part: str, pose: BodyPose) -> Ray | None:
        """Tell where the gaze (`head`) or a forearm is with the joints so; None: it does not know.

        part: `head`, `left_arm` or `right_arm`. pose: angles of all its joints, radians.
        """
        return None

    def calibrate(self, offsets: Mapping[str, Radians]) -> None:
        """Correct the angles of joints from now on: as told, asked for and estimated they are the true ones.

        offsets: to be added to what a joint measures, by joint.

        Raises:
            InputRefused: it corrects none, or has no such joint. By default it corrects none.
        """
        if offsets:
            reason = f"the body {self.capabilities.body} does not correct the angle of {', '.join(offsets)}"
            advice = "leave [offsets] out of the calibration; its [errors] count all the same"
            raise InputRefused(Fault(reason=reason, where="control.calibration", advice=advice, service="control"))


T = TypeVar("T")

EARLY: Seconds = 1e-9
"""A loop may run a timer this much too early: a task that then still found its instant ahead would wait for ever."""


class Bell:
    """Wakes the one task that waits in `wait`; `ring` may come before or during that. Tells the loop time, too."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._rung = asyncio.Event()

    def now(self) -> Seconds:
        """Loop time."""
        return self._loop.time()

    def is_past(self, at: Seconds) -> bool:
        return self._loop.time() >= at - EARLY

    def ring(self) -> None:
        self._rung.set()

    async def wait(self, until: Seconds) -> None:
        """Return once the bell has been rung since the last time, or at loop time `until` (inf: never)."""
        if self.is_past(until):
            return
        timer = None if until == inf else self._loop.call_at(until, self._rung.set)
        try:
            await self._rung.wait()
            self._rung.clear()
        finally:
            if timer is not None:
                timer.cancel()


async def within(seconds: Seconds, awaited: Awaitable[T]) -> T:
    """Await something for some seconds at most. Raises TimeoutError."""
    async with asyncio.timeout(seconds):
        return await awaited

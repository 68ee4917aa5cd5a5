"""The contract of a body: behaviors in, measured sync points out. Everything specific to a robot is behind it.

The realizer knows sync points, not joints. A robot with an SDK joins by one class: `docs/control.md` walks through it
and `tests/control/contract.py` is the suite that it has to pass.
"""

import asyncio
from abc import ABC, abstractmethod
from collections.abc import AsyncGenerator, Callable, Mapping
from typing import Literal

from msgspec import Struct

from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.behaviors import (
    BlockBehavior,
)
from engage_hri.schemas.body import BodyPose, Capabilities, Estimate, Ray
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World

How = Literal["relax", "freeze"]


class Arrived(Struct, frozen=True):
    """The body waits at hold point `sync`, which it may not pass yet."""

    sync: str
    at: Seconds


class Reached(Struct, frozen=True):
    """The body passed `sync` at `at`; it had come there at `arrived`, earlier if it had to wait. Loop time."""

    sync: str
    at: Seconds
    arrived: Seconds


class Spoke(Struct, frozen=True):
    """The voice has finished `word`; `position` characters of the text have been said."""

    word: str
    position: int
    at: Seconds


Progress = Arrived | Reached | Spoke


class BehaviorRefused(EngageError):
    """The body cannot do this; nothing has moved."""


class BodyFailed(EngageError):
    """The behavior could not be finished. What had moved is on its way to the safe pose."""


class Revoked(Exception):
    """The behavior was aborted while it waited for its authority."""


class MovementAuthority:
    """How far a behavior may go. It is extended, never shrunk; revoking it is how a behavior is aborted.

    A simple body awaits `granted(sync)` before it leaves a hold point. One that plans ahead asks `covers` and
    is told of changes through `watch`.

    pace: loop times at which it is asked to come to its points, where its own pace would miss them. A body that can
    be no faster or slower ignores it; its estimates say how far it can.
    """

    def __init__(self, behavior: BlockBehavior, through: str, pace: Mapping[str, Seconds] | None = None) -> None:
        """Raises ValueError if the behavior has no sync point `through`."""
        self.points = sync_points(behavior)
        self.pace: Mapping[str, Seconds] = dict(pace or {})
        self.revoked: How | None = None
        self._through = self._index(through)
        self._watchers: list[Callable[[], None]] = []

    @property
    def through(self) -> str:
        """The last sync point that may be passed without asking."""
        return self.points[self._through]

    def covers(self, sync: str) -> bool:
        return self.points.index(sync) <= self._through

    def extend(self, through: str) -> None:
        """Raises ValueError for a sync point the behavior does not have. An earlier one changes nothing."""
        if (index := self._index(through)) > self._through:
            self._through = index
            self._tell()

    def set_pace(self, pace: Mapping[str, Seconds]) -> None:
        """Ask for these instants from now on, and no others."""
        if dict(pace) != self.pace:
            self.pace = dict(pace)
            self._tell()

    def revoke(self, how: How = "relax") -> None:
        """End the behavior now: go to the safe pose at once, or freeze, then go."""
        if self.revoked is None:
            self.revoked = how
            self._tell()

    def watch(self, on_change: Callable[[], None]) -> Callable[[], None]:
        """Call `on_change` after each of these changes, until the returned function is called."""
        self._watchers.append(on_change)
        return lambda: self._watchers.remove(on_change)

    async def granted(self, sync: str) -> None:
        """Wait until `sync` may be passed. Raises Revoked."""
        changed = asyncio.Event()
        unwatch = self.watch(changed.set)
        try:
            while self.revoked is None and not self.covers(sync):
                changed.clear()
                await changed.wait()
        finally:
            unwatch()
        if self.revoked is not None:
            raise Revoked

    def _index(self, sync: str) -> int:
        if sync not in self.points:
            raise ValueError(f"no sync point {sync!r}: expected one of {', '.join(self.points)}")
        return self.points.index(sync)

    def _tell(self) -> None:
        for watcher in list(self._watchers):
            watcher()


class BodyState(Struct, frozen=True, kw_only=True):
    """What a body measures of itself. moving: is anything in motion? looking_at: entity on the gaze axis."""

    pose: BodyPose
    gaze: Ray
    left_arm: Ray
    right_arm: Ray
    moving: bool
    looking_at: str = ""
    speaking: str = ""


class Body(ABC):
    """A robot, or what passes for one. All of it is called on the event loop and none of it may block."""

    capabilities: Capabilities

    @abstractmethod
    def estimate(self, behavior: BlockBehavior, pose: BodyPose | None, world: World) -> Estimate:
        """What `behavior` would take from `pose` (None: from where the body is). Quick, and changes nothing."""

    @abstractmethod
    def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        """Do it: every sync point once, in order, at the measured time, and never past the authority.

        Ending after `end` means done; ending earlier means that the authority was revoked. Raises BehaviorRefused
        before the first progress if it can't be done, BodyFailed if it fails. However it ends, the parts
        it used go on to their safe pose by themselves.
        """

    @abstractmethod
    async def home(self, parts: tuple[str, ...] = ()) -> None:
        """Move `parts` (empty: all) to the safe pose; return when they are there. Ends what moves them as aborted."""

    @abstractmethod
    def state(self) -> BodyState:
        """Now, as measured."""

    @abstractmethod
    def see(self, world: World) -> None:
        """The world has changed: gaze follows its entities."""

"""Parts that move along plans in time: which behavior has each, and how they change hands. Nothing waits here.

Time is that of a clock: of the event loop for a body, of its own for a rehearsal.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from math import inf
from typing import Any, Generic, Protocol, TypeVar

from engage_hri.schemas.behaviors import BlockBehavior, Gaze
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import World
from engage_hri.services.control.contract.body import Bell, MovementAuthority
from engage_hri.services.control.motion.motion import Motion, MotionPlan, Track, WalkPoint, is_shift
from engage_hri.services.control.motion.path import Path

FREEZE: Seconds = 0.5
"""Seconds that a part stands still when it is told to freeze, before it relaxes."""


class Clock(Protocol):
    """Source of the time."""

    def time(self) -> Seconds: ...


class Run:
    """A behavior that is being performed. bell: rings when its authority, its joints or its target have news.

    course: the way that it goes. pending: sync points that it has not passed. motion: of its joints, from when it was
    given its parts. holding: it waits at a hold point, standing or still coming to a stop.
    """

    course: MotionPlan
    motion: Motion

    def __init__(self, behavior: BlockBehavior, course: MotionPlan, authority: MovementAuthority) -> None:
        self.behavior, self.course, self.authority = behavior, course, authority
        self.bell = Bell()
        self.pending: list[WalkPoint] = list(course.points)
        self.holding = False
        self.is_beneath = False
        """True for a shift of the head that a look lies over: it moves no more, and takes nothing from the look."""
        self._is_held = False
        self._missed: frozenset[str] = frozenset()
        """Hold points at which it could not stop any more when it was told to wait."""

    def awaits(self, sync: str) -> bool:
        """True if it has not passed a sync point yet."""
        return any(point.sync == sync for point in self.pending)

    @property
    def is_over(self) -> bool:
        """True once it moves its parts no more, or has lost them."""
        return self.is_beneath or self.authority.revoked is not None

    @property
    def is_taken_over(self) -> bool:
        """True once another behavior has taken one of its parts."""
        return self.authority.revoked == "taken_over"

    @property
    def stands(self) -> bool:
        """True if it has come to a stop where it has to wait."""
        return self.holding and self.bell.is_past(self.motion.end)

    def may_pass(self, hold: str) -> bool:
        """True if it may go on from a hold point now, or has to, since it could stop there no more."""
        return self.authority.covers(hold) or hold in self._missed

    def waits_at(self, point: WalkPoint) -> bool:
        """True if it may not pass a sync point yet."""
        return bool(point.held_with) and not self.may_pass(point.held_with)

    def limit(self, path: Path) -> Seconds:
        """Position on `path`, in its natural seconds, up to which it may go now."""
        for point in self.pending:
            if not point.is_told or self.waits_at(point):
                return path.marks.get(point.stands_at or point.sync, inf)
        return inf

    def due(self, point: WalkPoint) -> Seconds | None:
        """Instant at which the plan passes `point`; None if it does not go so far yet."""
        mark = self.motion.path.marks.get(point.sync)
        return None if mark is None else self.motion.crossing(mark)

    def brake_for_hold(self, now: Seconds) -> None:
        """While the behavior is held, stop at the next hold point where the joints can."""
        is_news, self._is_held = self.authority.held and not self._is_held, self.authority.held
        if not self._is_held:
            self._missed = frozenset()
            return
        if is_news:
            marks = self.motion.path.marks
            self._missed = frozenset(
                point.held_with
                for point in self.pending
                if point.held_with
                and self.authority.is_granted(point.held_with)
                and not self.motion.can_stop_at(marks.get(point.stands_at or point.sync, inf), now)
            )
        if (limit := self.limit(self.motion.path)) < self.motion.limit:
            self.motion.brake(now, limit)

    def leave(self, hold: str, now: Seconds) -> list[str]:
        """Stop waiting at `hold`; return the sync points passed. The same place may be another hold point, too."""
        passed = [point.sync for point in self.pending if point.held_with == hold]
        self.pending = [point for point in self.pending if point.held_with != hold]
        following = next(point for point in self.pending if point.is_told)
        here = self.motion.s(now) + 1e-9
        is_here = following.held_with and self.motion.path.marks.get(following.sync, inf) <= here
        self.holding = self.stands and bool(is_here)
        return passed

    def passed_by(self, at: Seconds) -> list[tuple[str, Seconds]]:
        """Sync points that it has passed by then and not reported yet, each with its instant."""
        passed: list[tuple[str, Seconds]] = []
        for point in () if self.holding else self.pending:
            due = self.due(point) if point.is_told else None
            if due is None or due > at or self.waits_at(point):
                break
            passed.append((point.sync, due))
        return passed


R = TypeVar("R", bound=Run)


class MovingParts(ABC, Generic[R]):
    """The parts of a body, each on a track. runs: the behavior that has a part, by the track.

    base: authority of the shift of the head that has set where the head goes home to.
    """

    def __init__(self, clock: Clock, tracks: Mapping[str, Track[Any]]) -> None:
        self.clock = clock
        self.tracks: Mapping[str, Any] = tracks
        for track in tracks.values():
            track.trunk = tracks.get("torso", track)
        self.runs: dict[str, R] = {}
        self.homeward: list[Bell] = []
        """Bells of those who wait for parts to come home: each behavior that takes parts rings them."""
        self.world = World(entities=())
        self.base: MovementAuthority | None = None

    # -- what a robot says --------------------------------------------------------------------------------------

    @abstractmethod
    def take_over(self, run: R) -> None:
        """Give a behavior its parts (`take`), and start its motion. Raises Impossible: nothing has changed."""

    @abstractmethod
    def leave(self, run: R, point: WalkPoint, *, has_waited: bool) -> Sequence[str]:
        """Let a behavior go on behind a point. has_waited: at this hold point. Returns the sync points passed."""

    @abstractmethod
    def abandon(self, run: R) -> None:
        """Send home the parts of a behavior that has ended early. A shift of the head stays where it can stop."""

    @abstractmethod
    def relax(self, names: Collection[str]) -> None:
        """Send tracks to where they go home to."""

    @abstractmethod
    def rest_on(self, run: R | None) -> None:
        """Let the head go home to the goal of a shift; None: to the safe pose."""

    @abstractmethod
    def follow(self) -> None:
        """Turn what is on an entity, or on its way to one, to where that is now."""

    # -- hands --------------------------------------------------------------------------------------------------

    def set_out(self, run: R) -> R:
        """Begin a behavior. A shift of the head beneath a look takes no part and moves nothing. Raises Impossible."""
        run.is_beneath = is_shift(run.behavior) and self.is_overlaid()
        if run.is_beneath:
            self.set_base(run)
            self.follow()
        else:
            self.take_over(run)
        return run

    def take(self, run: R) -> list[str]:
        """Give a behavior its parts, and cut those that had them. Returns the parts that these had besides."""
        left: list[str] = []
        for earlier in dict.fromkeys(self.runs[name] for name in run.course.parts if name in self.runs):
            self.release(earlier)
            if is_shift(earlier.behavior) and isinstance(run.behavior, Gaze):
                earlier.is_beneath = True
            else:
                earlier.authority.revoke("taken_over")
            earlier.bell.ring()
            left += [name for name in earlier.course.parts if name not in run.course.parts]
        self.runs.update(dict.fromkeys(run.course.parts, run))
        for bell in self.homeward:
            bell.ring()
        if is_shift(run.behavior):
            self.set_base(run)
        return left

    def set_base(self, run: R) -> None:
        """Make the goal of a shift where the head goes home to. One before it that has not ended is taken over."""
        if self.base is not None:
            self.base.revoke("taken_over")
        self.base = run.authority
        self.rest_on(run)

    def is_overlaid(self) -> bool:
        """True if a look has the head: a shift then lies beneath it."""
        return "head" in self.runs and isinstance(self.runs["head"].behavior, Gaze)

    def owns(self, run: R) -> bool:
        """True if a behavior has any part."""
        return any(owner is run for owner in self.runs.values())

    def release(self, run: R) -> None:
        """Take from a behavior the parts that it still has."""
        for name in [name for name, owner in self.runs.items() if owner is run]:
            del self.runs[name]

    def go_home(self, parts: Sequence[str] = ()) -> set[str]:
        """Send parts to the safe pose, and end what moves them. Returns their tracks. parts: empty: all."""
        going = {name for name, track in self.tracks.items() if not parts or track.part in parts}
        for run in dict.fromkeys(run for name, run in self.runs.items() if name in going):
            going.update(run.course.parts)
            self.release(run)
            run.authority.revoke()
        self.rebase(going)
        self.relax(sorted(going))
        return going

    def rebase(self, names: Collection[str]) -> None:
        """Make the safe pose where tracks go home to."""
        for track in (self.tracks[name] for name in names):
            track.base = track.home
        if "head" in names:
            self.rest_on(None)
            if self.base is not None:
                self.base.revoke()
                self.base = None

    def extend(self, run: R) -> None:
        """Let a behavior go as far as its authority says now. A body that can be faster or slower does that, too."""
        now = self.clock.time()
        run.motion.extend(run.limit(run.motion.path), now)
        run.brake_for_hold(now)

    def stop(self, run: R) -> Seconds:
        """Stop the motion of a behavior that is to freeze. Returns until when its parts then stand still."""
        run.motion.brake(self.clock.time())
        return run.motion.end + FREEZE

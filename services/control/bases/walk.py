"""Walk of a behavior through its sync points: one for all bodies whose parts move along a plan.

A sync point is a promise to others. Words wait for a stroke, a person waits for a look, another behavior waits for
the arm. The walk keeps the promises of one behavior; a body tells it where the plan is and where the joints are.

What goes wrong without it:

- A point that is reported because a planned time is over lets words run ahead of an arm that is stuck. So a point is
  passed only when the plan has come there and the joints have come along (`come`).
- A behavior may have to wait at a *hold point*, since something else is late. Where it stops it says `Arrived`; where
  it leaves, `Reached`. Points of one instant wait together, else one of them would be told and the other not.
- Who asks may be silent: the behavior is *held*. It brakes at the next hold point at which its joints still can stop.
  One that it can stop at no more is missed, and passed: a joint that stops at once breaks its limits.
- Another behavior may take a part at any instant, also between "may go on" and the next turn of the task. The points
  that the joints have passed by then are reported, in order, and no others. A look takes nothing from a shift of the
  head: the shift lies *beneath* it, moves no more, and its `end` says where the look goes home to.
- However a behavior ends, by an abort, a failure or a task that is cancelled, its parts go home by themselves. One
  that is told to freeze stands still first.

The authority, the seven points and these rules are those of docs/control.md; a plan of paths in time is `motion`.
The walk knows loop time alone, and nothing of joints: the same walk serves formulas, physics and measured motors.
"""

import asyncio
from abc import abstractmethod
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing
from math import inf
from typing import Generic, TypeVar

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.bell import Bell
from engage_hri.services.control.contract.body import (
    Arrived,
    BehaviorRefused,
    Body,
    MovementAuthority,
    Progress,
    Reached,
)
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.motion.motion import Motion
from engage_hri.services.control.motion.path import Path
from engage_hri.services.control.motion.points import WalkPoint

FREEZE: Seconds = 0.5
"""Seconds that a part stands still when it is told to freeze, before it relaxes."""
CATCHES_UP: Seconds = 0.02
"""Seconds between two looks at whether it has come to a target that has moved."""


class Run:
    """A behavior that is being performed. bell: rings when its authority, its joints or its target have news.

    pending: sync points that it has not passed. motion: of its joints, from when it was given its parts.
    holding: it waits at a hold point, standing or still coming to a stop.
    """

    motion: Motion

    def __init__(self, behavior: BlockBehavior, points: Sequence[WalkPoint], authority: MovementAuthority) -> None:
        self.behavior = behavior
        self.authority = authority
        self.bell = Bell()
        self.pending: list[WalkPoint] = list(points)
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


class WalkingBody(Body, Generic[R]):
    """A body whose behaviors walk through their sync points. A driver on it says what moves, and what is measured."""

    def __init__(self) -> None:
        """Make the body, in a running event loop."""
        self._loop = asyncio.get_running_loop()

    # -- what a body says ---------------------------------------------------------------------------------------

    @abstractmethod
    def set_out(self, behavior: BlockBehavior, authority: MovementAuthority) -> R:
        """Give a behavior its parts, cut those that had them, and start its motion. Raises Impossible.

        A shift of the head beneath a look takes no part: it comes back as `is_beneath`.
        """

    @abstractmethod
    def leave(self, run: R, point: WalkPoint, *, has_waited: bool) -> Sequence[str]:
        """Let a behavior go on behind a point. has_waited: at this hold point. Returns the sync points passed."""

    @abstractmethod
    def owns(self, run: R) -> bool:
        """True if a behavior has any part."""

    @abstractmethod
    def release(self, run: R) -> None:
        """Take from a behavior the parts that it still has."""

    @abstractmethod
    def abandon(self, run: R) -> None:
        """Send home the parts of a behavior that has ended early. A shift of the head stays where it can stop."""

    def extend(self, run: R) -> None:
        """Let a behavior go as far as its authority says now. A body that can be faster or slower does that, too."""
        now = self._loop.time()
        run.motion.extend(run.limit(run.motion.path), now)
        run.brake_for_hold(now)

    def due(self, run: R, point: WalkPoint) -> Seconds | None:
        """Instant at which the plan of a behavior passes a point; None: it does not go so far yet."""
        return run.due(point)

    async def come(self, run: R, point: WalkPoint, due: Seconds) -> Seconds | None:
        """Wait until the joints have come to a point that the plan has passed at `due`. Returns when they had.

        None: something else may have changed; the walk looks again. Raises BodyFailed. Not overridden, the joints are
        where the plan has them.
        """
        return due

    def has_come(self, run: R, point: WalkPoint) -> bool:
        """True if the joints have come to a point that the plan has passed."""
        return True

    def check(self, run: R) -> None:
        """Raise BodyFailed if a behavior cannot be finished, as when its joints make no way any more."""

    def confirm(self, run: R, sync: str) -> None:
        """Raise BodyFailed if a sync point would claim what is not so, as a look at what is out of reach."""

    def is_behind(self, run: R) -> bool:
        """True if a behavior that waits on its target is still on its way to where that has moved."""
        return False

    def stop(self, run: R) -> None:
        """Stop the motion of a behavior as soon as its joints can: it is to freeze."""
        run.motion.brake(self._loop.time())

    # -- the walk -----------------------------------------------------------------------------------------------

    async def walk(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        """Perform a behavior that moves parts. Raises BehaviorRefused, BodyFailed."""
        try:
            run = self.set_out(behavior, authority)
        except Impossible as impossible:
            raise BehaviorRefused(impossible.fault(behavior)) from impossible
        unwatch = authority.watch(run.bell.ring)
        try:
            if not run.is_beneath:
                async with aclosing(self._pass_points(run)) as points:
                    async for progress in points:
                        yield progress
            if run.is_beneath and run.pending:
                async with aclosing(self._pass_beneath(run)) as points:
                    async for progress in points:
                        yield progress
            if authority.revoked == "freeze" and self.owns(run):
                await self._freeze(run)
        finally:
            unwatch()
            # After an abort, a failure or a cancelled task the parts go home by themselves.
            if self.owns(run):
                self.release(run)
                if run.pending:
                    self.abandon(run)

    async def _pass_points(self, run: R) -> AsyncGenerator[Progress, None]:
        """Report the sync points of `run` as it crosses them, until it is done, cut or revoked. Raises BodyFailed."""
        since = -inf
        while run.pending and not run.is_over:
            self.check(run)
            if not run.holding:
                self.extend(run)
            point = run.pending[0]
            due = self.due(run, point)
            if not run.holding and (due is None or not run.bell.is_past(due)):
                await run.bell.wait(inf if due is None else due)
            elif (came := await self.come(run, point, self._loop.time() if due is None else due)) is None:
                continue
            elif point.held_with and (run.holding or run.waits_at(point)):
                if not run.holding:
                    self.confirm(run, point.sync)
                arrived = max(came, since)
                if run.waits_at(point):
                    run.holding = True
                    yield Arrived(point.held_with, arrived)
                if await self._wait_to_go_on(run, point):
                    since = self._loop.time()
                    for sync in self.leave(run, point, has_waited=True):
                        yield Reached(sync, since, arrived)
            else:
                self.confirm(run, point.sync)
                came = max(came, since)
                for sync in self.leave(run, point, has_waited=False):
                    yield Reached(sync, came, came)
        if run.is_beneath or run.is_taken_over:
            for sync, due in run.passed_by(self._loop.time()):
                if not self.has_come(run, run.pending[0]):
                    break
                run.pending.pop(0)
                yield Reached(sync, at := max(due, since), at)

    async def _wait_to_go_on(self, run: R, point: WalkPoint) -> bool:
        """Wait at a hold point until it may be left, by authority and by joints. False: it is not left any more."""
        is_there = False
        while not run.is_over and not is_there:
            self.check(run)
            if run.waits_at(point):
                await run.bell.wait(inf)
            elif self.is_behind(run):
                await run.bell.wait(self._loop.time() + CATCHES_UP)
            else:
                is_there = await self.come(run, point, self._loop.time()) is not None
        if not run.is_over:
            self.confirm(run, point.sync)
            return True
        # What is taken over just as it may go on has passed the point, and goes no further.
        return run.is_taken_over and run.may_pass(point.held_with) and self.has_come(run, point)

    async def _pass_beneath(self, run: R) -> AsyncGenerator[Progress, None]:
        """Report the points of a shift under a look: nothing moves. It ends at once, or at the instant asked for."""
        now = self._loop.time()
        if run.awaits("start"):
            yield Reached("start", now, now)
        run.pending.clear()
        while run.authority.revoked is None and not run.bell.is_past(due := run.authority.pace.get("end", now)):
            await run.bell.wait(due)
        if run.authority.revoked is None:
            yield Reached("end", at := self._loop.time(), at)

    async def _freeze(self, run: R) -> None:
        self.stop(run)
        until = run.motion.end + FREEZE
        while self.owns(run) and not run.bell.is_past(until):
            await run.bell.wait(until)

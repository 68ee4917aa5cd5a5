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
import math
from abc import abstractmethod
from collections import defaultdict
from collections.abc import AsyncGenerator, Callable, Collection, Iterable, Sequence
from contextlib import aclosing
from math import inf
from typing import Generic

import numpy as np
from msgspec import Struct

from engage_hri.schemas.behaviors import BlockBehavior, Wait
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Radians, Seconds
from engage_hri.services.control.bases.moving_parts import MovingParts, R
from engage_hri.services.control.contract.body import (
    EARLY,
    Arrived,
    BehaviorRefused,
    Bell,
    Body,
    MovementAuthority,
    Progress,
    Reached,
    TakenOver,
)
from engage_hri.services.control.contract.refusals import Impossible
from engage_hri.services.control.motion.motion import WalkPoint
from engage_hri.services.control.motion.path import Path

# -- patience with joints --------------------------------------------------------------------------------------------

PATIENCE: Seconds = 1.5
"""Seconds without any way after which joints do not come any more."""
WAY: Radians = math.radians(0.3)
"""What counts as way; noise of the encoders does not."""
ENOUGH = 8
"""Measurements without way that it takes at least."""
SAMPLES = 6
"""Places of a stretch that are looked at."""
STANDS: Seconds = 0.25
"""Seconds without way after which a joint has come to stand, if it is short of patience."""


class Off(Struct, frozen=True):
    """The joint that is farthest off, as a share of what is allowed. here, there: where it is and should be."""

    joint: str
    share: float
    here: Radians
    there: Radians


def farthest(rows: Iterable[tuple[str, Radians, Radians, Radians]]) -> Off:
    """The joint that is off by the greatest share of what is allowed. rows: joint, here, there, allowed."""
    return max((Off(joint, abs(b - a) / limit, a, b) for joint, a, b, limit in rows), key=lambda off: off.share)


def nearest(since: Seconds, until: Seconds, off_at: Callable[[Seconds], Off]) -> Off:
    """Measure how far joints are off the nearest place on a stretch of a path: they may have passed its beginning.

    off_at: measures how far they are off one place.
    """
    places = np.linspace(since, until, SAMPLES).tolist() if until - since > 1e-9 else [since]
    return min(map(off_at, places), key=lambda off: off.share)


def settling(path: Path, mark: Seconds, lag: Seconds, near: Sequence[Radians], every: Seconds) -> Seconds:
    """Time from when the plan is at a place of a path until the joints, which follow it, are measured near it.

    lag: seconds by which they follow. near: how far each may be off. every: seconds between two measurements.
    """
    if mark <= 0.0:
        return 0.0
    steps = 16
    for step in range(1, steps + 1):
        behind = path.position(mark - min(mark, lag * step / steps))
        if (abs(behind - path.position(mark)) > near).any():
            return lag * (1.0 - (step - 1) / steps) + every / 2
    return every / 2


class Watch:
    """Watches joints that are off. They make way as long as one comes nearer to where it should be.

    off: what it saw last. Only measurements count: time in which none come is no evidence against the joints.
    """

    def __init__(self, patience: Seconds = PATIENCE) -> None:
        """patience: seconds without any way after which they are stuck."""
        self.off: Off | None = None
        self._patience = patience
        self._best = math.inf
        self._since: Seconds = 0.0
        self._last: Seconds = -math.inf
        self._seen = 0

    def see(self, off: Off, measured: Seconds) -> None:
        """Note how far they are off, as it was measured at that time."""
        self.off = off
        if (left := abs(off.there - off.here)) < self._best - WAY:
            self._best, self._since, self._seen = left, measured, 0
        if measured > self._last:
            self._last, self._seen = measured, self._seen + 1

    @property
    def is_stuck(self) -> bool:
        """True if they have made no way for too long."""
        return self._last - self._since > self._patience and self._seen > ENOUGH

    @property
    def stands(self) -> bool:
        """True if they have come to stand."""
        return self._last - self._since > STANDS and self._seen > ENOUGH

    def fault(self, where: str, what_for: str = "", advice: str = "") -> Fault:
        """The fault of joints that are stuck. where: what they move for. what_for: the sync point, if one is due."""
        assert self.off is not None
        here, there = (math.degrees(angle) for angle in (self.off.here, self.off.there))
        due = f" for its {what_for}" if what_for else ""
        reason = (
            f"{self.off.joint} stands at {round(here, 1) + 0.0:.1f} degrees, {abs(there - here):.1f} from where it "
            f"should be{due}, and has made no way for {self._last - self._since:.1f} s"
        )
        return Fault(reason=reason, where=where, advice=advice, service="control")


CATCHES_UP: Seconds = 0.02
"""Seconds between two looks at whether it has come to a target that has moved."""


class WalkingBody(Body, Generic[R]):
    """A body whose behaviors walk through their sync points. A driver on it says what is measured.

    moves: its parts, and where they go.
    """

    moves: MovingParts[R]
    stuck_after: Seconds = PATIENCE
    """Seconds without any way after which joints on their way home are stuck."""

    def __init__(self) -> None:
        """Make the body, in a running event loop."""
        self._loop = asyncio.get_running_loop()

    # -- what a body says ---------------------------------------------------------------------------------------

    @abstractmethod
    def set_out(self, behavior: BlockBehavior, authority: MovementAuthority) -> R:
        """Begin a behavior: `MovingParts.set_out`. Raises BehaviorRefused, Impossible.

        behavior: what to do. authority: that under which it moves.
        """

    def due(self, run: R, point: WalkPoint) -> Seconds | None:
        """Instant at which the plan of a behavior passes a point; None: it does not go so far yet.

        run: the behavior. point: where it is to come to.
        """
        return run.due(point)

    async def come(self, run: R, point: WalkPoint, due: Seconds) -> Seconds | None:
        """Wait until the joints have come to a point that the plan has passed. Returns when they had.

        run: the behavior. point: where they are to come to. due: when the plan passed it, in seconds.
        None: something else may have changed; the walk looks again. Raises BodyFailed. Not overridden, the joints are
        where the plan has them.
        """
        return due

    def has_come(self, run: R, point: WalkPoint) -> bool:
        """True if the joints have come to a point that the plan has passed.

        run: the behavior. point: where they were to come to.
        """
        return True

    def check(self, run: R) -> None:
        """Raise BodyFailed if a behavior cannot be finished, as when its joints make no way any more."""

    def confirm(self, run: R, sync: str) -> None:
        """Raise BodyFailed if a sync point would claim what is not so, as a look at what is out of reach."""

    def is_behind(self, run: R) -> bool:
        """True if a behavior that waits on its target is still on its way to where that has moved."""
        return False

    def coming_home(self, going: Collection[str], watches: defaultdict[str, Watch]) -> Seconds | None:
        """Look if joints are at home; None: they are. Returns when to look again (inf: on news).

        going: names of their tracks. watches: of their joints, since they have set out. Raises BodyFailed: they make
        no way any more.
        """
        until: Seconds = max((self.moves.tracks[name].motion.end for name in going), default=0.0)
        return None if self._loop.time() >= until - EARLY else until

    # -- the walk -----------------------------------------------------------------------------------------------

    def perform(self, behavior: BlockBehavior, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
        return wait(behavior, authority) if isinstance(behavior, Wait) else self.walk(behavior, authority)

    async def home(self, parts: tuple[str, ...] = ()) -> None:
        going, watches, bell = (
            self.moves.go_home(parts),
            defaultdict[str, Watch](lambda: Watch(self.stuck_after)),
            Bell(),
        )
        self.moves.homeward.append(bell)
        try:
            while (until := self.coming_home(going, watches)) is not None:
                await bell.wait(until)
                if taken := sorted({self.moves.tracks[name].part for name in going if name in self.moves.runs}):
                    raise TakenOver(taken)
        finally:
            self.moves.homeward.remove(bell)

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
            if authority.revoked == "freeze" and self.moves.owns(run):
                await self._freeze(run)
        finally:
            unwatch()
            # After an abort, a failure or a cancelled task the parts go home by themselves.
            if self.moves.owns(run):
                self.moves.release(run)
                if run.pending:
                    self.moves.abandon(run)

    async def _pass_points(self, run: R) -> AsyncGenerator[Progress, None]:
        """Report the sync points of `run` as it crosses them, until it is done, cut or revoked. Raises BodyFailed."""
        since = -inf
        while run.pending and not run.is_over:
            self.check(run)
            if not run.holding:
                self.moves.extend(run)
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
                    for sync in self.moves.leave(run, point, has_waited=True):
                        yield Reached(sync, since, arrived)
            else:
                self.confirm(run, point.sync)
                came = max(came, since)
                for sync in self.moves.leave(run, point, has_waited=False):
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
        until = self.moves.stop(run)
        while self.moves.owns(run) and not run.bell.is_past(until):
            await run.bell.wait(until)


async def wait(behavior: Wait, authority: MovementAuthority) -> AsyncGenerator[Progress, None]:
    """Let the duration of the behavior pass, and then hold until its end may be passed."""
    bell = Bell()
    begin = bell.now()
    due = begin + (behavior.duration or 0.0)
    unwatch = authority.watch(bell.ring)
    try:
        yield Reached("start", begin, begin)
        while not bell.is_past(due) and authority.revoked is None:
            await bell.wait(due)
        left = due
        if authority.revoked is None and not authority.covers("end"):
            yield Arrived("end", due)
            while authority.revoked is None and not authority.covers("end"):
                await bell.wait(inf)
            left = bell.now()
        if authority.revoked is None:
            yield Reached("end", left, due)
    finally:
        unwatch()

"""A service `control` that lies: it takes behaviors as control does, and then follows tests/rigs/hostile/lies.py."""

import asyncio
from random import Random

from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import sync_points
from engage_hri.schemas.body import (
    AbortBehavior,
    BehaviorAborted,
    BehaviorOutcome,
    Capabilities,
    EstimateBehaviors,
    Estimates,
    GoHome,
    HomeReached,
    PerformBehavior,
    SyncPointArrived,
    SyncPointReached,
    WordSpoken,
)
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Cancel, Request
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.service import Ready
from tests.rigs.hostile.lies import Lie, Status, Step, estimate, lie

NAME = "control"
TERM: Seconds = 2.0
"""Seconds that movement authority lasts if its request names no lease."""


class LyingBody:
    """A body on the bus that lies about its behaviors. chance: source of its lies; the same seed, the same lies."""

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self._acts: dict[str, _LyingBehavior] = {}

    async def serve(self, bus: Bus, ready: Ready) -> None:
        """Serve until cancelled."""
        self._acts.clear()
        self._bus = bus
        self._desk = RequestDesk(bus, NAME, self._cancelled, on_extend=self._serve, term=TERM)
        bus.answer(keys.ESTIMATE, self._estimate)
        bus.answer(keys.DESCRIBE, lambda question: Capabilities(body="liar", types=(), parts=()))
        try:
            async with asyncio.TaskGroup() as self._tasks:
                with bus.subscribe(*RequestDesk.patterns(NAME)) as inbox:
                    ready()
                    async for received in inbox:
                        if (request := self._desk.take(received)) is not None:
                            self._serve(request)
        finally:
            self._desk.close()

    def _estimate(self, question: Message) -> Message:
        if not isinstance(question, EstimateBehaviors):
            raise InputRefused(Fault(reason="expected EstimateBehaviors", where=keys.ESTIMATE, service=NAME))
        items = tuple(estimate(self._chance, item.behavior) for item in question.items)
        return Estimates(items=items if self._chance.random() < 0.98 else items[1:])

    def _serve(self, request: Request) -> None:
        match request:
            case PerformBehavior() if request.id in self._acts:
                self._acts[request.id].extend(request)
            case PerformBehavior():
                act = self._acts[request.id] = _LyingBehavior(request, lie(self._chance, request.behavior))
                act.task = self._tasks.create_task(self._perform(act), name=f"lie {request.id}")
            case AbortBehavior():
                self._desk.end(BehaviorAborted(id=request.id))
            case GoHome():
                self._tasks.create_task(self._go_home(request), name=f"lie home {request.id}")
            case Cancel():
                self._cancelled(request)

    def _cancelled(self, cancel: Cancel) -> None:
        act = self._acts.get(cancel.id)
        if act is not None and not act.lie.ignores_cancel and act.task is not None:
            act.task.cancel()
            self._tasks.create_task(self._end_cancelled(act), name=f"lie end {cancel.id}")

    async def _end_cancelled(self, act: "_LyingBehavior") -> None:
        await asyncio.sleep(act.lie.cancel_delay)
        self._end(act, "aborted")

    async def _go_home(self, request: GoHome) -> None:
        self._desk.accept(request.id)
        await asyncio.sleep(self._chance.choice((0.0, 0.5, 8.0)))
        self._desk.end(HomeReached(id=request.id, at=self._bus.stamp()))

    async def _perform(self, act: "_LyingBehavior") -> None:
        plan = act.lie
        await asyncio.sleep(plan.accept_delay)
        if plan.refuse:
            del self._acts[act.request.id]
            self._desk.refuse(act.request.id, Fault(reason="no", where=act.request.behavior.id, service=NAME))
            return
        self._desk.accept(act.request.id)
        for step in plan.steps:
            await self._report(act, step)
        if plan.end is not None:
            await asyncio.sleep(plan.end_delay)
            self._end(act, plan.end)
            for step in plan.afterwards:
                await self._report(act, step)

    async def _report(self, act: "_LyingBehavior", step: Step) -> None:
        await asyncio.sleep(step.delay)
        arrived = self._bus.now()
        if step.waits and not act.covers(step.sync):
            self._publish(act, Step("arrived", step.sync, 0.0), arrived)
            await act.granted(step.sync)
        for _ in range(2 if step.twice else 1):
            self._publish(act, step, arrived)

    def _publish(self, act: "_LyingBehavior", step: Step, arrived: Seconds) -> None:
        request = act.request
        id, behavior = self._desk.asked(request.id).id, request.behavior.id
        if step.unasked:
            id, behavior = f"{id}-not", self._chance.choice(("b1", "nobody", ""))
        block, at = request.block, self._bus.stamp(self._bus.now() + step.off)
        told: Message
        match step.say:
            case "arrived":
                told = SyncPointArrived(id=id, block=block, behavior=behavior, sync=step.sync, at=at)
            case "reached":
                came = self._bus.stamp(arrived + step.off)
                told = SyncPointReached(id=id, block=block, behavior=behavior, sync=step.sync, at=at, arrived=came)
            case "word":
                position = self._chance.randrange(-5, 60)
                told = WordSpoken(block=block, behavior=behavior, word="word", position=position, at=at)
        self._bus.publish(keys.SYNC_POINT, told)

    def _end(self, act: "_LyingBehavior", status: Status) -> None:
        request = act.request
        if self._acts.pop(request.id, None) is act and self._desk.is_live(request.id):
            behavior, at = request.behavior.id, self._bus.stamp()
            self._desk.end(
                BehaviorOutcome(id=request.id, block=request.block, behavior=behavior, status=status, at=at)
            )


class _LyingBehavior:
    """A behavior that is being performed, and the lie about it."""

    def __init__(self, request: PerformBehavior, plan: Lie) -> None:
        self.request = request
        self.lie = plan
        self.task: asyncio.Task[None] | None = None
        self._points = sync_points(request.behavior)
        self._extended = asyncio.Event()

    def extend(self, request: PerformBehavior) -> None:
        self.request = request
        self._extended.set()

    def covers(self, sync: str) -> bool:
        through = self.request.through
        known = sync in self._points and through in self._points
        return not known or self._points.index(sync) <= self._points.index(through)

    async def granted(self, sync: str) -> None:
        while not self.covers(sync):
            self._extended.clear()
            await self._extended.wait()

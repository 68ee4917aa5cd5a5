"""One behavior of a live block: an asyncio task that awaits its sync points, and talks to what performs it.

The running net resolves a future for each sync point and each instant that is awaited (`SyncPointFutures`).

The body may end it early: handed over, with all that matters done, or lost. When the block ends first, the body is
told to stop what still runs, and is given time to do so (`all_ended`).
"""

import asyncio
from collections.abc import Callable, Container, Mapping, Sequence
from typing import NamedTuple, TypeVar

from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Event, TurnSignal, Wait
from engage_hri.schemas.blocks import WarningKind
from engage_hri.schemas.body import BehaviorOutcome, SyncPointArrived, SyncPointReached
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.decide.decisions import Begin, Decisions, Extend
from engage_hri.services.realizer.net.running import Observer, RunningNet
from engage_hri.services.realizer.perform.links import ControlLink, RecognitionLink
from engage_hri.services.realizer.plan.phases import with_planned_hand
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.words import AS_IN_DRAFTS, Spelling
from engage_hri.services.realizer.points import EPSILON, FINISH, Point, performer
from engage_hri.services.realizer.report.outcome import Spoken
from engage_hri.services.realizer.together.live import Ending
from engage_hri.services.requests.ends import NeverEnded, Pending, RequestRefused, unfinished

T = TypeVar("T")


class PointPassed(NamedTuple):
    """A behavior has passed `point`. arrived: when it had come there, if it waited. by_body: told by the body."""

    point: Point
    at: Seconds
    arrived: Seconds | None = None
    by_body: bool = False


class SyncPointFutures(Observer):
    """Futures by sync point, each made when first awaited. They outlive the net."""

    def __init__(self) -> None:
        self._granted: dict[Point, asyncio.Future[None]] = {}
        self._fired: dict[Point, asyncio.Future[Seconds]] = {}
        self._reached: dict[Point, asyncio.Future[Seconds]] = {}
        self._reported: dict[Point, asyncio.Future[PointPassed | None]] = {}

    def adopt(self, net: RunningNet) -> "SyncPointFutures":
        """Observe another net of the same block from now on."""
        self._net = net
        for transition in net.instants if self._fired else ():
            self.on_fired(transition, net.instants[transition])
        return self

    def granted(self, point: Point) -> "asyncio.Future[None]":
        """Resolved when the behavior may pass `point`; of its start: when it is to begin."""
        return _future(self._granted, point)

    def fired(self, point: Point) -> "asyncio.Future[Seconds]":
        """Resolved when the transition of `point` fires, with the time. `FINISH`: when the block is over."""
        future = _future(self._fired, point)
        transition = self._net.end if point == FINISH else self._net.at[point]
        if transition in self._net.instants:
            _resolve(self._fired, point, self._net.instants[transition])
        return future

    def grant(self, point: Point) -> None:
        """Let the behavior pass `point`."""
        if not (future := self.granted(point)).done():  # done: its task was cancelled
            future.set_result(None)

    def reached(self, point: Point) -> "asyncio.Future[Seconds]":
        """Resolved when the behavior itself has passed `point`, with the time, whatever else is of that instant."""
        return _future(self._reached, point)

    def reach(self, point: Point, at: Seconds) -> None:
        """Note that the behavior has passed `point`."""
        _resolve(self._reached, point, at)

    def reported(self, point: Point) -> "asyncio.Future[PointPassed | None]":
        """Resolved with the report of the body about `point`; with None if it was lost, or there will be none."""
        return _future(self._reported, point)

    def report(self, point: Point, news: PointPassed | None) -> None:
        """Note what the body has reported of `point`; what comes after the first is ignored."""
        if not (future := _future(self._reported, point)).done():
            future.set_result(news)

    def cancel(self) -> None:
        """Cancel all that is still awaited: the block has ended."""
        for futures in (self._granted, self._fired, self._reached, self._reported):
            for future in futures.values():
                future.cancel()

    # -- what happens (see `Observer`) ---------------------------------------------------------------------------

    def on_fired(self, transition: int, at: Seconds) -> None:
        if self._fired:
            for point in self._net.net.transitions[transition].points or (FINISH,):
                _resolve(self._fired, point, at)


def _future(futures: dict[Point, "asyncio.Future[T]"], point: Point) -> "asyncio.Future[T]":
    if (future := futures.get(point)) is None:
        future = futures[point] = asyncio.get_running_loop().create_future()
    return future


def _resolve(futures: dict[Point, "asyncio.Future[Seconds]"], point: Point, at: Seconds) -> None:
    if (future := futures.get(point)) is not None and not future.done():
        future.set_result(at)


_TAKEN = Fault(reason="", cause="replaced")


def has_lost_nothing(plan: Plan, outcome: BehaviorOutcome, reached: Container[Point]) -> bool:
    """True if a behavior is done, or was taken over when it had nothing left to do but its way home.

    reached: points that were measured.
    """
    id = outcome.behavior
    if outcome.status != "taken_over" or id not in plan.kept:
        return outcome.status == "done"
    points = plan.chains[id].points
    return all(point in reached for point in points[: points.index(plan.kept[id]) + 1])


def loss(outcome: BehaviorOutcome, spelling: Spelling = AS_IN_DRAFTS) -> Fault:
    """Reason why a behavior has not come to its end."""
    if outcome.status == "taken_over":
        passed = spelling.sync(Point(outcome.behavior, outcome.passed)) if outcome.passed else "nothing of it"
        return replace(outcome.fault or _TAKEN, reason=f"another behavior took its part after {passed}", where="")
    return outcome.fault or Fault(reason=f"the body {outcome.status} it")


class PointHeld(NamedTuple):
    """A behavior holds at `point`."""

    point: Point
    at: Seconds


class BehaviorLost(NamedTuple):
    """A behavior cannot be finished. at_rest: its parts rest."""

    behavior: str
    fault: Fault
    kind: WarningKind = "EXECUTION_FAILURE"
    at_rest: bool = False


class BodyLost(NamedTuple):
    """The end of what performs the block."""

    fault: Fault


RunNews = PointHeld | PointPassed | BehaviorLost | BodyLost
"""What becomes of a behavior, as its run tells it."""


class Stage(NamedTuple):
    """Values that the runs of one block share.

    id, plan: of the block, as it began. tell: takes what becomes of a behavior.
    """

    id: str
    plan: Plan
    decisions: Decisions
    bus: Bus
    body: ControlLink
    recognition: RecognitionLink
    futures: SyncPointFutures
    spoken: Spoken
    tell: Callable[[RunNews], None]


class BehaviorRun:
    """Performance of one behavior.

    behavior: as it was begun (a later plan may have chosen another hand); None before. asked: the last command to it.
    pending: the request to what performs it.
    """

    __slots__ = ("_asked", "_block", "_hold_changed", "_points", "behavior", "id", "pending")

    def __init__(self, block: Stage, id: str) -> None:
        self.id = id
        self.behavior: BlockBehavior | None = None
        self.pending: Pending | None = None
        self._block = block
        self._asked: Begin | Extend | None = None
        self._hold_changed: asyncio.Future[None] | None = None
        self._points: Sequence[Point] = ()

    @property
    def is_by_body(self) -> bool:
        """True if the body performs it: it has begun."""
        return self.behavior is not None and performer(self.behavior) == "body"

    def command(self, asked: Begin | Extend) -> None:
        """Let it begin, or go on as far as is asked."""
        self._asked = asked
        if asked.through == "end" and performer(self._block.plan.chains[self.id].behavior) == "clock":
            self._block.futures.grant(Point(self.id, "end"))
        if isinstance(asked, Begin):
            self._block.futures.grant(Point(self.id, "start"))
        elif self._hold_changed is not None and not self._hold_changed.done():
            self._hold_changed.set_result(None)
        elif self.is_by_body and self.pending is not None:
            self._send()

    def feed(self, message: SyncPointArrived | SyncPointReached) -> None:
        """Take a report of the body: it resolves the future of its sync point, which the behavior awaits."""
        block, point = self._block, Point(self.id, message.sync)
        if self.pending is None or self.pending.request.id != message.id or self.pending.outcome.done():
            return
        facts, bus = block.decisions.facts, block.bus
        at = facts.plausible(point, bus.local(message.at), bus.now())
        if isinstance(message, SyncPointArrived):
            block.tell(PointHeld(point, at))
        elif point in self._points:
            same = message.arrived == message.at
            arrived = at if same else facts.plausible(point, bus.local(message.arrived), at)
            self._report(point, PointPassed(point, at, arrived, by_body=True))

    def _report(self, point: Point, news: PointPassed | None) -> None:
        """Resolve the future of a sync point. Earlier ones that nobody has reported are made good by this one."""
        for each in self._points[: self._points.index(point) + 1]:
            self._block.futures.report(each, news if each == point else None)

    async def perform(self) -> None:
        """Wait until it may begin, and perform it to its end."""
        block = self._block
        await block.futures.granted(Point(self.id, "start"))
        if (chain := block.decisions.plan.chains.get(self.id)) is None:
            return  # It was lost before its turn on the loop came.
        behavior = self.behavior = with_planned_hand(chain)
        match behavior:
            case Wait(duration=duration):
                await self._wait(duration or 0.0)
            case Event():
                await self._event(behavior)
            case TurnSignal():
                block.recognition.signal(block.body.id(self.id), block.id, behavior)
                self._at_once()
            case _ if performer(behavior) == "clock":
                await self._wait(0.0)
            case _:
                await self._by_body(behavior, chain.points)

    def _send(self) -> Pending:
        assert self.behavior is not None
        assert self._asked is not None
        self.pending = self._block.body.perform(self.behavior, self._asked)
        return self.pending

    async def _by_body(self, behavior: BlockBehavior, points: Sequence[Point]) -> None:
        """Follow the body through the sync points of the behavior.

        A report of the body resolves the future of a point: the behavior tells it, and the net fires. What the net
        grants then is sent at once (`command`), whichever point the behavior awaits.
        """
        block = self._block
        block.decisions.count_from(self.id, block.bus.now())
        ended, self._points = self._send().outcome, points
        ended.add_done_callback(lambda _: self._report(points[-1], None))
        for point in points:
            if (reached := await block.futures.reported(point)) is not None:
                block.tell(reached)
        try:
            outcome = await ended
        except (RequestRefused, NeverEnded) as error:
            refused = isinstance(error, RequestRefused)
            self.lose(error.fault, "CANNOT_CREATE_BEHAVIOR" if refused else "EXECUTION_FAILURE")
            return
        except EngageError as error:
            self.pending = None
            block.tell(BodyLost(error.fault.at(block.id)))
            return
        if not isinstance(outcome, BehaviorOutcome):
            self.lose(Fault(reason=f"control ended it with a {type(outcome).__name__}"))
            return
        block.spoken.end(outcome)
        if outcome.status == "lapsed":  # the body has gone home: nothing of this block can be as planned
            unsaid = Fault(reason="nobody has renewed it", where=block.plan.block.id, cause="unrenewed")
            block.tell(BodyLost(outcome.fault or unsaid))
            return
        facts, end = block.decisions.facts, points[-1]
        at = facts.plausible(end, block.bus.local(outcome.at), block.bus.now())
        if outcome.status == "taken_over":  # its last report may be lost
            block.tell(PointPassed(Point(self.id, outcome.passed), at, by_body=True))
        if has_lost_nothing(block.decisions.plan, outcome, facts.reached):
            block.tell(PointPassed(end, at, by_body=outcome.status == "done"))
        else:
            self.lose(loss(outcome, Spelling(block.plan.block)), at_rest=outcome.status != "failed")

    def lose(self, fault: Fault, kind: WarningKind = "EXECUTION_FAILURE", *, at_rest: bool = False) -> None:
        """Give it up: it cannot be finished. The fault gets the line of the behavior."""
        assert self.behavior is not None
        fault = replace(fault, line=fault.line or self.behavior.line)
        self._block.tell(BehaviorLost(self.id, fault, kind, at_rest))

    def _at_once(self) -> None:
        now = self._block.bus.now()
        self._block.tell(PointPassed(Point(self.id, "start"), now))
        self._block.tell(PointPassed(Point(self.id, "end"), now))

    async def _wait(self, duration: Seconds) -> None:
        block, end = self._block, Point(self.id, "end")
        began = block.bus.now()
        block.tell(PointPassed(Point(self.id, "start"), began))
        if duration:
            await self._time(began, duration)
        arrived = block.bus.now()
        block.tell(PointHeld(end, arrived))
        await block.futures.granted(end)
        block.tell(PointPassed(end, block.bus.now(), arrived))

    async def _time(self, began: Seconds, duration: Seconds) -> None:
        """Wait for so long, not counting the time in which the behavior is held."""
        facts, bus = self._block.decisions.facts, self._block.bus
        while True:
            left = began + duration + facts.held_between(began, bus.now(), self.id) - bus.now()
            if left <= EPSILON:
                return
            self._hold_changed = asyncio.get_running_loop().create_future()
            await asyncio.wait([self._hold_changed], timeout=None if facts.is_held(self.id) else left)

    async def _really_begun(self, event: Event) -> Seconds:
        """Time at which an event begins that may: with the first report of what it needs, else now.

        The body may refuse what it needs only as that begins. Then recognition must not hear of the event: with a
        person who looks already, it would succeed at once. Of a backchannel it has to hear before it hears the robot,
        whose sign would answer the person else.
        """
        block, now = self._block, self._block.bus.now()
        starts = [Point(id, "start") for id in event.needs if id in block.decisions.plan.chains]
        if not starts or event.kind == "backchannel":
            return now
        if not any(start in block.decisions.facts.reached for start in starts):
            awaited = [block.futures.reached(start) for start in starts]
            await asyncio.wait(awaited, return_when=asyncio.FIRST_COMPLETED)
        reached = block.decisions.facts.reached
        return max(now, min(reached[start] for start in starts if start in reached))

    async def _event(self, event: Event) -> None:
        block = self._block
        began = await self._really_begun(event)
        block.tell(PointPassed(Point(event.id, "start"), began))
        pending = block.recognition.ask(block.body.id(event.id), block.id, event, began)
        if pending is not None:
            self.pending = pending
        try:
            facts = block.decisions.facts
            decision = await block.recognition.decision(event, block.plan.block, pending, facts)
        except RequestRefused as error:
            self.lose(error.fault, "CANNOT_CREATE_BEHAVIOR")
        else:
            end = Point(event.id, "end")
            block.tell(PointPassed(end, max(began, decision.at), by_body=decision.by_recognition))


ABORT: Seconds = 5.0
"""Time that the body may take to end what was aborted before the block ends without it. Ours."""


async def all_ended(
    runs: Mapping[str, BehaviorRun],
    tasks: Mapping[str, asyncio.Task[None]],
    body: ControlLink,
    ending: Ending,
    bus: Bus,
) -> None:
    """Cancel what still runs, and return when all that the body does has ended, or `ABORT` is over."""
    moving = dict[asyncio.Task[None], str]()
    for id, run in runs.items():
        if run.pending is None or tasks[id].done():
            continue
        if run.is_by_body:
            moving[tasks[id]] = id
        if ending.status != "done" and not run.pending.outcome.done():
            body.cancel(id, ending.fault or f"block {ending.status}")
    for task in await unfinished(moving, ABORT, bus):
        # Its request is not to be kept alive: it is over, though the body does not say so.
        body.cancel(moving[task], "its block has ended")

"""One behavior of a live block: an asyncio task from its start to its end, and what it says to who performs it.

The task awaits a future for all that may take time (`SyncPointFutures`): that the behavior may begin, that others are
where it needs them, that it has ended. What the net decides and what the body reports takes no time: it goes from
the report to the net, and from the net to the body, in one call. Were a task woken in between, all that is ready on
the loop would run first, and a word that waits for a stroke would wait for that, too (decision 0159).

Connection events and turn signals are recognition's (`RecognitionLink`). It may not be there, or die: then the clock
decides its events, so who is on the bus is followed here (`Presence`).

The body may end it early: handed over, with all that matters done, or lost. When the block ends first, the body is
told to stop what still runs, and is given time to do so (`all_ended`).
"""

import asyncio
from collections.abc import Callable, Container, Iterable, Mapping
from typing import Any, NamedTuple, TypeVar

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import TYPES, canonical_sync
from engage_hri.schemas.behaviors import EVENT_KINDS, BlockBehavior, Event, Speech, TurnSignal, Wait
from engage_hri.schemas.blocks import Block, WarningKind
from engage_hri.schemas.body import (
    BehaviorOutcome,
    GoHome,
    PerformBehavior,
    PlannedInstant,
    SyncPointArrived,
    SyncPointReached,
)
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import EventOutcome, RequestEvent, SignalTurn
from engage_hri.schemas.references import SyncRef, type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Silences
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.decide.decisions import Begin, Decisions, Extend
from engage_hri.services.realizer.net.facts import Facts
from engage_hri.services.realizer.net.running import Observer, RunningNet
from engage_hri.services.realizer.plan.phases import with_planned_hand
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.words import AS_IN_DRAFTS, Spelling
from engage_hri.services.realizer.points import EPSILON, FINISH, Point
from engage_hri.services.realizer.report import Spoken
from engage_hri.services.realizer.together.live import Ending
from engage_hri.services.requests.ends import (
    NeverEnded,
    Pending,
    Requester,
    RequestRefused,
    ServerRestarted,
    unfinished,
)

# -- recognition --------------------------------------------------------------------------------------------------


class Presence:
    """Services that are, or were, on the bus; not managers: ever new ones come. changed: at the next change."""

    def __init__(self) -> None:
        self._is_there: dict[str, bool] = {}
        self._loop = asyncio.get_running_loop()
        self.changed: asyncio.Future[None] = self._loop.create_future()

    def feed(self, message: PeerAlive | PeerGone) -> None:
        if message.participant in keys.SERVICES:
            self._is_there[message.participant] = isinstance(message, PeerAlive)
            self.changed.set_result(None)
            self.changed = self._loop.create_future()

    def has_left(self, participant: str) -> bool:
        """True if the participant was there and is not now."""
        return not self._is_there.get(participant, True)

    def __contains__(self, participant: str) -> bool:
        return self._is_there.get(participant, False)


UNTOLD: Seconds = 2.5
"""Limit of an event where neither the block nor recognition names one, because recognition is not there. Nobody can
say then what the person does: the robot leaves the time in which most people follow a point or begin to answer."""
GRACE: Seconds = 0.5
"""Time after its limit at which an event ends as failed if recognition is not there to decide it."""


def event_deadline(event: Event, block: Block, reached: Mapping[Point, Seconds]) -> Seconds:
    """Time at which an event has failed, if recognition is not there to decide it.

    The limit counts from the start or from the last of the anchors that are reached by now.
    """
    anchors = (reached.get(_point(text, block)) for text in event.anchors)
    since = max(time for time in (reached[Point(event.id, "start")], *anchors) if time is not None)
    return since + (event.limit or UNTOLD) + GRACE


def _point(text: str, block: Block) -> Point:
    ref = SyncRef.parse(text)
    behavior = next((each for each in block.behaviors if each.id == ref.behavior), None)
    if isinstance(behavior, Speech):
        ref = SyncRef.parse(text, [mark.id for mark in behavior.marks])
    sync = canonical_sync(ref.sync, type_name(behavior) if behavior else "", block.dialect)
    return Point(ref.behavior, sync)


UNPROMISED: Seconds = 30.0
"""Time from the robot's last deed that a recognizer has which promises none, before its event is given up."""


class Decision(NamedTuple):
    """Time of an event's decision; by recognition, or by the realizer if recognition does not decide."""

    at: Seconds
    by_recognition: bool


class RecognitionLink(NamedTuple):
    """Asks recognition for the events of one block. deeds: times when the robot last did something of each block."""

    bus: Bus
    requests: Requester
    peers: Presence
    deeds: Callable[[], Iterable[Seconds]]

    def signal(self, id: str, block: str, signal: TurnSignal) -> None:
        """Tell recognition what became of a turn. The answer does not matter."""
        message = SignalTurn(id=id, signal=signal, at=self.bus.stamp(), block=block)
        if "recognition" in self.peers:
            self.requests.send(keys.TURN, message)
        else:
            self.bus.publish(keys.command(keys.TURN, self.bus.role, self.bus.name), message)

    def ask(self, id: str, block: str, event: Event, began: Seconds) -> Pending | None:
        """Request the event; None if recognition is not there to decide it."""
        if "recognition" not in self.peers:
            return None
        request = RequestEvent(id=id, block=block, event=event, at=self.bus.stamp(began))
        return self.requests.send(keys.EVENT, request)

    async def decision(self, event: Event, block: Block, pending: Pending | None, facts: Facts) -> Decision:
        """Wait for the decision of an event. Raises RequestRefused.

        Recognition decides as long as it is there, in the time that it has promised: counted from the last deed of
        the robot, since the turn may go on in other blocks. Else the clock does. The time for which the event is held
        is not counted. facts: those of the block, as they grow.
        """
        began = deed = facts.reached[Point(event.id, "start")]
        time = Silences[str](self.bus.sight)
        while True:
            if pending is not None and pending.outcome.done():
                try:
                    decided = await pending.outcome
                except RequestRefused:
                    raise
                except ServerRestarted:
                    return Decision(self.bus.now(), False)  # Its new life knows nothing of the event.
                except EngageError:
                    pending = None  # Recognition has died.
                    continue
                at = self.bus.local(decided.at) if isinstance(decided, EventOutcome) else self.bus.now()
                return Decision(at, True)
            now = self.bus.now()
            deed = max(deed, *self.deeds())
            if pending is None or "recognition" not in self.peers:
                due = event_deadline(event, block, facts.reached)
            else:
                due = deed + (UNPROMISED if pending.within is None else pending.within)
            time.keep("decision", due + facts.held_between(began, now, event.id), now)
            if time.due(now + EPSILON) is not None:
                if pending is not None:
                    late = self.bus.sight.fault("no decision in time", "", "late", "recognition", "", deed)
                    self.requests.cancel(pending.request.id, late)
                return Decision(self.bus.now(), False)
            assert time.earliest is not None
            # The deadline is computed again after this: meanwhile points were reached, or the promise was heard.
            news: list[asyncio.Future[Any]] = [self.peers.changed]
            if pending is not None:
                news += [each for each in (pending.outcome, pending.accepted) if not each.done()]
            await asyncio.wait(news, timeout=time.earliest - now, return_when=asyncio.FIRST_COMPLETED)


# -- a behavior ---------------------------------------------------------------------------------------------------


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

    def adopt(self, net: RunningNet) -> "SyncPointFutures":
        """Observe another net of the same block from now on."""
        self._net = net
        for transition in net.fired if self._fired else ():
            self.on_fired(transition, net.fired[transition])
        return self

    def granted(self, point: Point) -> "asyncio.Future[None]":
        """Resolved when the behavior may pass `point`; of its start: when it is to begin."""
        return _future(self._granted, point)

    def fired(self, point: Point) -> "asyncio.Future[Seconds]":
        """Resolved when the transition of `point` fires, with the time. `FINISH`: when the block is over."""
        future = _future(self._fired, point)
        transition = self._net.end if point == FINISH else self._net.at[point]
        if transition in self._net.fired:
            _resolve(self._fired, point, self._net.fired[transition])
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

    def cancel(self) -> None:
        """Cancel all that is still awaited: the block has ended."""
        for futures in (self._granted, self._fired, self._reached):
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


LONGEST_WAY: Seconds = 10.0
"""Most seconds on the way home; a body that does not say that it is there is not asked for longer."""


class ControlLink(NamedTuple):
    """Sends the body what one block asks of it.

    request: the id of the block's request; that of a behavior is `<request>/<behavior>`, with `%2F` for a slash in
    the behavior's, so that no two are alike. Ids of behaviors hold no colon. held_after: see `RealizerConfig`.
    """

    bus: Bus
    requests: Requester
    request: str
    block: str
    held_after: Seconds

    def id(self, behavior: str) -> str:
        """Id of the request for a behavior, to whatever service performs it."""
        quoted = behavior.replace("%", "%25").replace("/", "%2F")
        return f"{self.request}/{quoted}"

    def perform(self, behavior: BlockBehavior, asked: Begin | Extend) -> Pending:
        """Ask the body to begin a behavior, or to go on as far as is asked."""
        perform = PerformBehavior(
            id=self.id(behavior.id),
            block=self.block,
            behavior=behavior,
            through=asked.through.partition(":")[0],  # without the number of a repeated stroke
            pace=tuple(PlannedInstant(sync=sync, at=self.bus.stamp(at)) for sync, at in asked.pace),
            held=isinstance(asked, Extend) and asked.held,
            held_after=self.held_after,
        )
        return self.requests.send(keys.BEHAVIOR, perform)

    def cancel(self, behavior: str, why: Fault | str) -> None:
        """Cancel the request for a behavior, to whatever service performs it. why: what has happened."""
        self.requests.cancel(self.id(behavior), why)

    def go_home(self, parts: Iterable[str], behavior: str = "") -> None:
        """Send these parts home. behavior: the one that used them; empty: the whole block."""
        going = GoHome(id=f"{self.id(behavior)}:home", parts=tuple(sorted(parts)))
        self.requests.send(keys.BEHAVIOR, going, within=LONGEST_WAY)


class Stage(NamedTuple):
    """Values that the runs of one block share.

    id, plan: of the block, as it began. arrive, reach: take that a behavior holds at a point, and has passed one.
    lose: takes that a behavior cannot be finished, and whether its parts rest. lose_body: that nothing of the block
    is performed any more.
    """

    id: str
    plan: Plan
    decisions: Decisions
    bus: Bus
    body: ControlLink
    recognition: RecognitionLink
    futures: SyncPointFutures
    spoken: Spoken
    arrive: Callable[[Point, Seconds], None]
    reach: Callable[[PointPassed], None]
    lose: Callable[[str, Fault, WarningKind, bool], None]
    lose_body: Callable[[Fault], None]


class BehaviorRun:
    """Performance of one behavior.

    behavior: as it was begun (a later plan may have chosen another hand); None before. asked: the last command to it.
    pending: the request to what performs it.
    """

    __slots__ = ("_asked", "_block", "_hold_changed", "_performer", "behavior", "id", "pending")

    def __init__(self, block: Stage, id: str) -> None:
        self.id = id
        self.behavior: BlockBehavior | None = None
        self.pending: Pending | None = None
        self._block = block
        self._performer = TYPES[block.plan.chains[id].type].performer
        self._asked: Begin | Extend | None = None
        self._hold_changed: asyncio.Future[None] | None = None

    @property
    def is_by_body(self) -> bool:
        """True if the body performs it: it has begun."""
        return self.behavior is not None and self._performer == "body"

    def command(self, asked: Begin | Extend) -> None:
        """Let it begin, or go on as far as is asked. The body hears of it at once."""
        block, self._asked = self._block, asked
        if isinstance(asked, Begin):
            self.behavior = with_planned_hand(block.decisions.plan.chains[self.id])
            if self.is_by_body:
                self._send()
            block.futures.grant(Point(self.id, "start"))
        elif self._hold_changed is not None and not self._hold_changed.done():
            self._hold_changed.set_result(None)
        elif self.is_by_body:
            self._send()
        if asked.through == "end" and self._performer == "clock":
            block.futures.grant(Point(self.id, "end"))

    def feed(self, message: SyncPointArrived | SyncPointReached) -> None:
        """Take a report of the body. Points before it that nobody has reported are passed, too."""
        block, point = self._block, Point(self.id, message.sync)
        if self.pending is None or self.pending.request.id != message.id or self.pending.outcome.done():
            return
        facts, bus = block.decisions.facts, block.bus
        at = facts.plausible(point, bus.local(message.at), bus.now())
        if isinstance(message, SyncPointArrived):
            block.arrive(point, at)
        else:
            same = message.arrived == message.at
            arrived = at if same else facts.plausible(point, bus.local(message.arrived), at)
            block.reach(PointPassed(point, at, arrived, by_body=True))

    async def perform(self) -> None:
        """Wait until it may begin, and perform it to its end."""
        block = self._block
        await block.futures.granted(Point(self.id, "start"))
        if self.pending is not None:
            await self._by_body(self.pending)
        elif self.id in block.decisions.plan.chains:  # Else it was lost before its turn on the loop came.
            match self.behavior:
                case Wait(duration=duration):
                    await self._wait(duration or 0.0)
                case Event() as event:
                    await self._event(event)
                case TurnSignal() as signal:
                    block.recognition.signal(block.body.id(self.id), block.id, signal)
                    self._at_once()
                case _:
                    await self._wait(0.0)

    def _send(self) -> None:
        assert self.behavior is not None
        assert self._asked is not None
        self.pending = self._block.body.perform(self.behavior, self._asked)

    async def _by_body(self, sent: Pending) -> None:
        """Follow the body to the end of the behavior. Sync points on the way are taken as they are told (`feed`)."""
        block = self._block
        try:
            outcome = await sent.outcome
        except (RequestRefused, NeverEnded) as error:
            refused = isinstance(error, RequestRefused)
            self.lose(error.fault, "CANNOT_CREATE_BEHAVIOR" if refused else "EXECUTION_FAILURE")
            return
        except EngageError as error:
            self.pending = None
            block.lose_body(error.fault.at(block.id))
            return
        if not isinstance(outcome, BehaviorOutcome):
            self.lose(Fault(reason=f"control ended it with a {type(outcome).__name__}"))
            return
        block.spoken.end(outcome)
        if outcome.status == "lapsed":  # the body has gone home: nothing of this block can be as planned
            unsaid = Fault(reason="nobody has renewed it", where=block.plan.block.id, cause="unrenewed")
            block.lose_body(outcome.fault or unsaid)
            return
        facts, end = block.decisions.facts, block.plan.chains[self.id].points[-1]
        at = facts.plausible(end, block.bus.local(outcome.at), block.bus.now())
        if outcome.status == "taken_over":  # its last report may be lost
            block.reach(PointPassed(Point(self.id, outcome.passed), at, by_body=True))
        if has_lost_nothing(block.decisions.plan, outcome, facts.reached):
            block.reach(PointPassed(end, at, by_body=outcome.status == "done"))
        else:
            self.lose(loss(outcome, Spelling(block.plan.block)), at_rest=outcome.status != "failed")

    def lose(self, fault: Fault, kind: WarningKind = "EXECUTION_FAILURE", *, at_rest: bool = False) -> None:
        """Give it up: it cannot be finished. The fault gets the line of the behavior."""
        assert self.behavior is not None
        fault = replace(fault, line=fault.line or self.behavior.line)
        self._block.lose(self.id, fault, kind, at_rest)

    def _at_once(self) -> None:
        now = self._block.bus.now()
        self._block.reach(PointPassed(Point(self.id, "start"), now))
        self._block.reach(PointPassed(Point(self.id, "end"), now))

    async def _wait(self, duration: Seconds) -> None:
        block, end = self._block, Point(self.id, "end")
        began = block.bus.now()
        block.reach(PointPassed(Point(self.id, "start"), began))
        if duration:
            await self._time(began, duration)
        arrived = block.bus.now()
        block.arrive(end, arrived)
        await block.futures.granted(end)
        block.reach(PointPassed(end, block.bus.now(), arrived))

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
        if not starts or not EVENT_KINDS[event.kind].is_answered:
            return now
        if not any(start in block.decisions.facts.reached for start in starts):
            awaited = [block.futures.reached(start) for start in starts]
            await asyncio.wait(awaited, return_when=asyncio.FIRST_COMPLETED)
        reached = block.decisions.facts.reached
        return max(now, min(reached[start] for start in starts if start in reached))

    async def _event(self, event: Event) -> None:
        block = self._block
        began = await self._really_begun(event)
        block.reach(PointPassed(Point(event.id, "start"), began))
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
            block.reach(PointPassed(end, max(began, decision.at), by_body=decision.by_recognition))


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

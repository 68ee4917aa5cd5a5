"""The generation service: fragments, people and the body in; blocks, outcomes and the owner of the head out."""

import asyncio
from collections.abc import Sequence

from schemas import keys
from schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from schemas.attention import HeadOwner, Inhibit, InhibitionEnded
from schemas.behaviors import GazeShift, TurnSignal
from schemas.blocks import BlockOutcome, PerformBlock
from schemas.body import (
    AbortBehavior,
    Capabilities,
    DescribeBody,
    Estimate,
    EstimateBehaviors,
    EstimateItem,
    Estimates,
    RobotState,
)
from schemas.faults import EngageError, Fault, InputRefused, NoReply, RunFailed
from schemas.feedback import SyncPointProgress, WarningFeedback, WarningKind
from schemas.fragments import PerformFragment
from schemas.messages import Message
from schemas.presence import PeerGone
from schemas.recognition import ConnectionEvent, SignalTurn, Statistics
from schemas.requests import Cancel, Unreadable
from schemas.units import Seconds
from schemas.world import World
from services.bus import Bus, Received
from services.generation.arbiter import Arbiter, Shift
from services.generation.config import GenerationConfig
from services.generation.fragment_check import checked
from services.generation.leases import Leases
from services.generation.motions import Motions, collect, distinct, from_each_other, from_here
from services.generation.performance import Performance, TurnEvents
from services.generation.planning import plan, targets
from services.generation.turn_policy import Aborted, TurnPolicy
from services.requests import RequestDesk, Requester, RequestRefused
from services.runtime import Ready

NAME = "generation"
PATTERNS = (
    *RequestDesk.patterns(NAME), keys.ANY_REQUEST_STATE, keys.FEEDBACK, keys.CONNECTION_EVENT, keys.WORLD,
    keys.ANY_ACTION, keys.ROBOT_STATE, keys.ANY_STATISTICS,
)  # fmt: skip


async def generate(bus: Bus, ready: Ready, config: GenerationConfig) -> None:
    """Serve until cancelled. A bad fragment is refused with a fault; it never ends the service."""
    with bus.subscribe(*PATTERNS) as inbox:
        generation = _Generation(bus, config)
        try:
            async with asyncio.TaskGroup() as tasks:
                tasks.create_task(generation.perform_in_order(), name="fragments")
                tasks.create_task(generation.keep_deadlines(), name="deadlines")
                ready()
                async for received in inbox:
                    generation.take(received)
        finally:
            generation.close()


class _Generation:
    """Decodes, feeds the policies, publishes what they say."""

    def __init__(self, bus: Bus, config: GenerationConfig) -> None:
        self._bus = bus
        self._config = config
        self._desk = RequestDesk(bus, NAME, self._cancel)
        self._requests = Requester(bus)
        self._turns = TurnPolicy(bus.robot, config)
        self._arbiter = Arbiter(bus.robot, config)
        self._leases = Leases(config)
        self._events = TurnEvents()
        self._world: World | None = None
        self._body: Capabilities | None = None
        self._early: dict[str, tuple[PerformFragment, Seconds]] = {}
        """Fragments that came before the first report of the world, and when they give up."""
        self._live: dict[str, Performance] = {}
        """By request id: from acceptance to outcome."""
        self._line: asyncio.Queue[Performance] = asyncio.Queue()
        self._changed = asyncio.Event()
        self._session = f"{bus.name}@{bus.now():.6f}"
        """Makes request ids of our own unique after a restart."""
        self._signals = 0

    def close(self) -> None:
        self._requests.close()
        self._desk.close()

    # -- what arrives ---------------------------------------------------------------------------------------------

    def take(self, received: Received) -> None:
        now = self._bus.now()
        self._requests.feed(received)
        message = received.message
        if isinstance(message, Inhibit) and self._desk.is_live(message.id):
            self._leases.take(message, now)  # sent again: renewed
        match self._desk.take(received):
            case PerformFragment() as request:
                self._admit(request, now)
            case Inhibit() as request:
                self._grant(request, now)
            case Cancel() as cancel:
                self._cancel(cancel)
        match message:
            case World():
                self._world = message
                self._arbiter.feed(message, now)
                early, self._early = self._early, {}
                for request, _ in early.values():
                    self._admit(request, now)
            case ConnectionEvent():
                self._events.feed(message)
                self._arbiter.feed(message, now)
            case ActionBegan() | ActionEnded():
                self._turns.feed(message, now)
                if message.actor != self._bus.robot:
                    self._arbiter.feed(message, now)
            case RobotState() | Statistics() | ActorFound() | ActorLost():
                self._arbiter.feed(message, now)
            case SyncPointProgress():
                self._follow(message)
            case Unreadable(id=id, fault=fault):
                self._warn(id, "PARSING_FAILURE", str(fault))
            case PeerGone(participant="control"):
                self._body = None  # another may come
        self._after(now)

    def _admit(self, request: PerformFragment, now: Seconds) -> None:
        if self._world is None:
            self._early[request.id] = (request, now + self._config.world_patience)
            return
        try:
            fragment = checked(request.fragment, self._world, self._bus.robot)
            turn = self._turns.accept(fragment, fragment.addressee)
        except EngageError as error:
            self._refuse(request.id, error.fault)
            self._warn(request.fragment.id, "PARSING_FAILURE", str(error.fault))
            return
        performance = Performance(request, fragment, turn, self._config.decision_patience)
        self._events.expect(fragment.id, turn.turn)
        if any(not each.is_over for each in self._live.values()):
            self._accept(performance)
        # The first in line is accepted with its block: what the realizer finds impossible is refused here, too.
        self._live[request.id] = performance
        self._line.put_nowait(performance)

    def _accept(self, performance: Performance) -> None:
        if not performance.accepted:
            performance.accepted = True
            self._desk.accept(performance.request.id)

    def _grant(self, request: Inhibit, now: Seconds) -> None:
        try:
            if request.target and self._world is not None and self._world.entity(request.target) is None:
                raise InputRefused(Fault(reason=f"the world does not know {request.target!r}", where=request.id))
            self._leases.take(request, now)
        except EngageError as error:
            self._refuse(request.id, error.fault)
        else:
            self._desk.accept(request.id)

    def _refuse(self, id: str, fault: Fault) -> None:
        self._desk.refuse(id, fault)
        self._bus.publish(keys.fault(NAME), fault)

    def _warn(self, fragment: str, kind: WarningKind, message: str) -> None:
        """fragment: empty where nobody knows whose it was."""
        self._bus.publish(keys.FRAGMENT_FEEDBACK, WarningFeedback(block=fragment or None, kind=kind, message=message))

    def _follow(self, progress: SyncPointProgress) -> None:
        """The arbiter sees the gazes of fragments where they are realized."""
        named = [each for each in self._live.values() if each.fragment.id == progress.block]
        if not named:
            return
        performance = min(named, key=lambda each: each.is_over)  # an ended one may still hear of its events
        before = performance.gaze
        performance.feed(progress)
        gaze = performance.gaze
        if gaze is not None and gaze is not before:
            if isinstance(gaze, GazeShift):
                self._arbiter.fragment_shifts(gaze.target)
            else:
                self._arbiter.fragment_gazes(gaze.target)
        elif gaze is None and before is not None:
            self._arbiter.fragment_lets_go()

    def _cancel(self, cancel: Cancel) -> None:
        """On request, or because the requester is gone."""
        now = self._bus.now()
        if self._leases.release(cancel.id):
            reason = "owner_lost" if cancel.reason == "requester is gone" else "released"
            self._desk.end(InhibitionEnded(id=cancel.id, reason=reason))  # type: ignore[arg-type]
        elif self._early.pop(cancel.id, None):
            self._desk.refuse(cancel.id, Fault(reason="cancelled", where=cancel.id))
        elif performance := self._live.get(cancel.id):
            aborted = self._turns.fragment_ended(
                performance.fragment.id, complete=False, now=now, reason=cancel.reason or "cancelled"
            )
            self._interrupt(performance, cancel.reason or "cancelled", now)
            self._abort(aborted, now)
        self._after(now)

    # -- time -----------------------------------------------------------------------------------------------------

    async def keep_deadlines(self) -> None:
        """Ask the policies again when the earliest of their deadlines has come."""
        while True:
            self._changed.clear()
            try:
                async with asyncio.timeout_at(self._deadline()):
                    await self._changed.wait()
            except TimeoutError:
                self._after(self._bus.now())

    def _deadline(self) -> Seconds | None:
        due = [self._turns.deadline, self._arbiter.deadline, self._leases.deadline]
        due += [performance.deadline for performance in self._live.values()]
        due += [until for _, until in self._early.values()]
        return min((each for each in due if each is not None), default=None)

    def _after(self, now: Seconds) -> None:
        """Whatever happened: what follows from it by now."""
        for id, (_, until) in list(self._early.items()):
            if now >= until:
                del self._early[id]
                fault = Fault(reason="the world is unknown", where=id, advice="is perception running?")
                self._refuse(id, fault)
        for id in self._leases.lapse(now):
            self._desk.end(InhibitionEnded(id=id, reason="lapsed"))
        while (aborted := self._turns.tick(now)) is not None:
            self._abort(aborted, now)
        for performance in list(self._live.values()):
            self._enforce_inhibitions(performance)
            if performance.refusal is not None:
                del self._live[performance.request.id]
                self._refuse(performance.request.id, performance.refusal)
            elif (outcome := performance.outcome(self._events, now)) is not None:
                del self._live[performance.request.id]
                self._desk.end(outcome)
        self._events.forget({each.turn.turn for each in self._live.values()} | {self._turns.open_turn})
        self._rule(now)
        self._changed.set()

    # -- the head -------------------------------------------------------------------------------------------------

    def _rule(self, now: Seconds) -> None:
        self._arbiter.inhibit(self._leases.claim())
        ruling = self._arbiter.rule(now)
        if ruling.changed:
            since = self._bus.stamp(ruling.since)
            self._bus.publish(keys.HEAD_OWNER, HeadOwner(owner=ruling.owner, since=since, waiting=ruling.waiting))
        if ruling.shift is not None:
            self._send(ruling.shift)

    def _send(self, shift: Shift) -> None:
        id = f"{self._session}/{shift.id}"
        request = PerformBlock(id=id, requester=self._bus.name, block=shift.block)
        pending = self._requests.send(keys.BLOCK, request)

        def ended(outcome: "asyncio.Future[object]") -> None:
            if outcome.cancelled():
                return
            result = outcome.result() if outcome.exception() is None else None
            if not (isinstance(result, BlockOutcome) and result.status == "done"):
                self._arbiter.shift_failed(shift.id, self._bus.now())
                self._changed.set()

        pending.outcome.add_done_callback(ended)  # type: ignore[arg-type]

    def _enforce_inhibitions(self, performance: Performance) -> None:
        permits = self._leases.permits()
        for id in performance.forbid(gaze=permits.gaze, hands=permits.hands):
            self._bus.publish(keys.BEHAVIOR, AbortBehavior(id=id, requester=self._bus.name))

    # -- fragments, one after the other ---------------------------------------------------------------------------

    async def perform_in_order(self) -> None:
        while True:
            performance = await self._line.get()
            if not performance.is_over:
                await self._perform(performance)
            self._after(self._bus.now())

    async def _perform(self, performance: Performance) -> None:
        fragment = performance.fragment
        self._arbiter.stop_thinking()
        self._arbiter.speak_to(performance.turn.addressee)
        try:
            motions = await self._ask_body(targets(fragment))
            if performance.is_over:  # cancelled meanwhile
                return
            assert self._world is not None
            performance.begin(
                plan(
                    fragment, performance.turn, self._world, self._body, motions, self._leases.permits(), self._config
                )
            )
            outcome = await self._perform_block(performance)
            performance.end_with(outcome, self._bus.now())
        except RequestRefused as error:
            performance.refuse(error.fault, self._bus.now())  # the realizer did
        except EngageError as error:
            performance.end(self._bus.now(), "failed", fault=error.fault)
        now = self._bus.now()
        self._arbiter.fragment_lets_go()
        complete = performance.status == "done"
        aborted = self._turns.fragment_ended(
            fragment.id, complete=complete, now=now, reason=f"{fragment.id} {performance.status}"
        )
        self._abort(aborted, now, performance)
        if complete and self._turns.thinks_after(fragment):
            self._arbiter.think(fragment.delay_target)

    async def _perform_block(self, performance: Performance) -> BlockOutcome:
        assert performance.plan is not None
        for message in performance.plan.warnings:
            self._warn(performance.fragment.id, "POLICY", message)
        request = PerformBlock(id=performance.block_id, requester=self._bus.name, block=performance.plan.block)
        pending = self._requests.send(keys.BLOCK, request)
        await pending.accepted
        self._accept(performance)
        outcome = await pending.outcome
        if not isinstance(outcome, BlockOutcome):
            raise RunFailed(Fault(reason=f"the realizer answered {type(outcome).__name__}", where=request.id))
        return outcome

    def _interrupt(self, performance: Performance, reason: str, now: Seconds) -> None:
        if performance.plan is not None:
            self._requests.cancel(performance.block_id, reason)
        else:
            performance.end(now, "interrupted", fault=Fault(reason=reason, where=performance.fragment.id))

    def _abort(self, aborted: Aborted | None, now: Seconds, cause: Performance | None = None) -> None:
        """A turn has ended early: so have its fragments in line, and recognition learns of it."""
        if aborted is None:
            return
        self._arbiter.stop_thinking()
        for performance in list(self._live.values()):
            if performance.fragment.id in aborted.fragments and performance is not cause:
                self._interrupt(performance, aborted.reason, now)
        if cause is not None and (cause.signalled_end or cause.plan is None):
            return
        self._signals += 1
        id = f"turn-aborted-{self._signals}"
        signal = TurnSignal(id=id, turn=aborted.turn, signal="aborted", actor=aborted.addressee)
        request = SignalTurn(
            id=f"{self._session}/{id}", requester=self._bus.name, signal=signal, at=self._bus.stamp(now)
        )
        self._requests.send(keys.TURN, request)

    # -- what the body says ---------------------------------------------------------------------------------------

    async def _ask_body(self, sequence: Sequence[str]) -> Motions:
        """Costs, rays and poses of everything the references could need. Raises NoReply without a body."""
        if not sequence:
            return Motions({}, {})
        if self._body is None:
            described = await self._ask(keys.DESCRIBE, DescribeBody())
            if isinstance(described, Capabilities):
                self._body = described
                self._arbiter.gaze_perceived_within(described.gaze_half_angle)
        hand = self._leases.permits().only_hand
        here = await self._estimates(from_here(distinct(sequence), hand))
        return collect(sequence, here, await self._estimates(from_each_other(sequence, here, hand)))

    async def _estimates(self, items: tuple[EstimateItem, ...]) -> tuple[Estimate, ...]:
        if not items:
            return ()
        answer = await self._ask(keys.ESTIMATE, EstimateBehaviors(items=items))
        if not isinstance(answer, Estimates) or len(answer.items) != len(items):
            raise RunFailed(Fault(reason="the body's estimates do not fit the question", where=keys.ESTIMATE))
        return answer.items

    async def _ask(self, key: str, question: Message) -> Message:
        """Once more and again, while a body may still come up."""
        until = self._bus.now() + self._config.body_patience
        while True:
            try:
                return await self._bus.query(key, question)
            except NoReply:
                if self._bus.now() >= until:
                    raise

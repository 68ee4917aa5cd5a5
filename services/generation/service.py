"""The generation service: fragments, people and the body in; blocks, outcomes and the owner of the head out."""

import asyncio
from collections.abc import Collection
from functools import reduce

from schemas import keys
from schemas.actions import ActionBegan, ActionEnded, ActorFound, ActorLost
from schemas.attention import HeadOwner, Inhibit, InhibitionEnded
from schemas.behaviors import GazeShift, TurnSignal
from schemas.blocks import BlockOutcome, PerformBlock
from schemas.body import AbortBehavior, RobotState
from schemas.faults import EngageError, Fault, InputRefused, RunFailed
from schemas.feedback import SyncPointProgress, WarningFeedback, WarningKind
from schemas.fragments import PerformFragment
from schemas.presence import PeerGone
from schemas.recognition import ConnectionEvent, SignalTurn, Statistics
from schemas.requests import Cancel, Unreadable
from schemas.units import Seconds
from schemas.world import World
from services.bus import Bus, Received
from services.generation.arbiter import Arbiter, Shift
from services.generation.body_link import BodyLink
from services.generation.config import GenerationConfig
from services.generation.fragment_check import checked
from services.generation.leases import Leases
from services.generation.performance import GazesOfFragments, Performance
from services.generation.planning import plan, targets
from services.generation.trail import NOTHING, Trail
from services.generation.turn_events import TurnEvents, TurnOutcomes
from services.generation.turn_policy import Aborted, TurnPolicy
from services.requests import Pending, RequestDesk, Requester, RequestRefused
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
        self._outcomes = TurnOutcomes(self._events, config.decision_patience)
        self._gazes = GazesOfFragments()
        self._world: World | None = None
        self._body = BodyLink(bus, config.body_patience)
        self._early: dict[str, tuple[PerformFragment, Seconds]] = {}
        """Fragments that came before the first report of the world, and when they give up."""
        self._live: dict[str, Performance] = {}
        """By request id: from acceptance to outcome."""
        self._line: asyncio.Queue[Performance] = asyncio.Queue()
        self._blocks: dict[asyncio.Task[None], str] = {}
        """What waits for the end of a fragment's block, and of which turn that is."""
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
            self._leases.renew(message.id, now)
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
                self._body.forget()
                self._arbiter.body_lost()
            case PeerGone(participant="realizer"):
                self._arbiter.body_lost()
            case PeerGone(participant="recognition"):
                self._arbiter.recognition_lost()
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
        if (displaced := self._outcomes.expect(fragment.id, turn)) is not None:
            self._bus.publish(keys.TURN_CLOSED, displaced)
        self._events.expect(fragment.id, turn.turn)
        if any(not each.is_over and each.turn.turn != turn.turn for each in self._live.values()):
            self._accept(performance)
        # What need not wait is accepted with its block: what the realizer finds impossible is refused here, too.
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
            self._leases.release(request.id)
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
        performance.feed(progress)
        if performance.signalled_end:
            self._turns.turn_ended(performance.turn.turn)
        self._follow_gaze(performance)

    def _follow_gaze(self, performance: Performance) -> None:
        before = self._gazes.holder
        self._gazes.follow(performance)
        gaze = self._gazes.holder
        if not self._gazes.rest:
            self._arbiter.fragment_lets_go()
        elif gaze is None and before is not None:
            self._arbiter.fragment_rests()
        elif isinstance(gaze, GazeShift) and gaze is not before:
            self._arbiter.fragment_shifts(gaze.target, gaze.id)
        elif gaze is not None and gaze is not before:
            self._arbiter.fragment_gazes(gaze.target, gaze.id)

    def _cancel(self, cancel: Cancel) -> None:
        """On request, or because the requester is gone."""
        now = self._bus.now()
        if self._leases.release(cancel.id):
            reason = "owner_lost" if cancel.reason == "requester is gone" else "released"
            self._desk.end(InhibitionEnded(id=cancel.id, reason=reason))  # type: ignore[arg-type]
        elif self._early.pop(cancel.id, None):
            self._desk.refuse(cancel.id, Fault(reason="cancelled", where=cancel.id))
        elif performance := self._live.get(cancel.id):
            reason = cancel.reason or "cancelled"
            aborted = self._turns.fragment_ended(performance.fragment.id, complete=False, now=now, reason=reason)
            self._interrupt({performance.fragment.id, *(aborted.fragments if aborted else ())}, reason, now)
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
        due = [self._turns.deadline, self._outcomes.deadline, self._arbiter.deadline, self._leases.deadline]
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
                self._outcomes.refuse(performance.fragment.id, performance.turn)
                self._refuse(performance.request.id, performance.refusal)
            elif (outcome := performance.outcome(self._events, now)) is not None:
                del self._live[performance.request.id]
                self._outcomes.end(outcome, performance.turn, now)
                self._desk.end(outcome)
        going = {each.turn.turn for each in self._live.values()} | {self._turns.open_turn}
        for closed in self._outcomes.closed(going, now):
            self._bus.publish(keys.TURN_CLOSED, closed)
        self._events.forget({*going, *self._outcomes.turns})
        self._rule(now)
        self._changed.set()

    # -- the head -------------------------------------------------------------------------------------------------

    def _rule(self, now: Seconds) -> None:
        self._arbiter.inhibit(self._leases.inhibition)
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
        for id in performance.forbid(self._leases.permits()):
            self._bus.publish(keys.BEHAVIOR, AbortBehavior(id=id, requester=self._bus.name))

    # -- fragments: those of a turn at once, turns one after the other --------------------------------------------

    async def perform_in_order(self) -> None:
        """Send each fragment's block as soon as the turn before has ended: what it is to follow stands in it."""
        async with asyncio.TaskGroup() as tasks:
            while True:
                performance = await self._line.get()
                turn = performance.turn.turn
                if before := [block for block, its in self._blocks.items() if its != turn]:
                    await asyncio.wait(before)
                if not performance.is_over and (pending := await self._begin(performance)) is not None:
                    block = tasks.create_task(self._await_end(performance, pending), name=performance.block_id)
                    self._blocks[block] = turn
                    block.add_done_callback(self._blocks.pop)
                self._after(self._bus.now())

    async def _begin(self, performance: Performance) -> Pending | None:
        """The request for its block, accepted; None if nothing comes of it."""
        fragment, turn = performance.fragment, performance.turn
        self._arbiter.stop_thinking()
        self._arbiter.speak_to(turn.addressee)
        permits = self._leases.permits
        try:
            while True:
                company = [each for each in self._live.values() if each.goes_on_with(performance)]
                moving = [behavior for each in company for behavior in each.moving]
                motions = await self._body.motions(targets(fragment), permits().only_hand, moving)
                if performance.is_over:  # cancelled meanwhile
                    return None
                assert self._world is not None
                body = self._body.capabilities
                if body is not None:
                    self._arbiter.gaze_perceived_within(body.gaze_half_angle)
                before = reduce(Trail.then, (each.trail for each in company), NOTHING)
                performance.begin(plan(fragment, turn, self._world, body, motions, permits(), self._config, before))
                try:
                    return await self._send_block(performance)
                except RequestRefused:
                    if not any(each.is_over for each in company):
                        raise
                    # It has named blocks that ended while it was on its way: once more, without them.
        except RequestRefused as error:
            performance.refuse(error.fault, self._bus.now())  # the realizer did
        except EngageError as error:
            performance.end(self._bus.now(), "failed", fault=error.fault)
        self._block_ended(performance)
        return None

    async def _send_block(self, performance: Performance) -> Pending:
        assert performance.plan is not None
        request = PerformBlock(id=performance.block_id, requester=self._bus.name, block=performance.plan.block)
        self._turns.fragment_begins(performance.turn.turn)
        pending = self._requests.send(keys.BLOCK, request)
        await pending.accepted
        self._accept(performance)
        for message in performance.plan.warnings:
            self._warn(performance.fragment.id, "POLICY", message)
        return pending

    async def _await_end(self, performance: Performance, pending: Pending) -> None:
        try:
            outcome = await pending.outcome
            if not isinstance(outcome, BlockOutcome):
                reason = f"the realizer answered {type(outcome).__name__}"
                raise RunFailed(Fault(reason=reason, where=performance.block_id))
            performance.end_with(outcome, self._bus.now())
        except EngageError as error:
            performance.end(self._bus.now(), "failed", fault=error.fault)
        self._block_ended(performance)
        self._after(self._bus.now())

    def _block_ended(self, performance: Performance) -> None:
        """Or there will be none."""
        now, fragment = self._bus.now(), performance.fragment
        self._follow_gaze(performance)
        if performance.refusal is not None:
            aborted = self._turns.fragment_refused(fragment.id, now)
        else:
            complete, reason = performance.status == "done", f"{fragment.id} {performance.status}"
            aborted = self._turns.fragment_ended(fragment.id, complete=complete, now=now, reason=reason)
        self._abort(aborted, now)
        if target := self._turns.averted_to:
            self._arbiter.think(target)

    def _interrupt(self, fragments: Collection[str], reason: str, now: Seconds) -> None:
        """The latest first: what follows the words of another must not begin because those end."""
        for performance in reversed(self._live.values()):
            if performance.is_over or performance.fragment.id not in fragments:
                continue
            if performance.plan is not None:
                self._requests.cancel(performance.block_id, reason)
            else:
                performance.end(now, "interrupted", fault=Fault(reason=reason, where=performance.fragment.id))

    def _abort(self, aborted: Aborted | None, now: Seconds) -> None:
        """A turn has ended early: so have its fragments, and recognition learns of it."""
        if aborted is None:
            return
        self._arbiter.stop_thinking()
        self._outcomes.abort(aborted)
        self._interrupt(aborted.fragments, aborted.reason, now)
        if not aborted.is_known:
            return
        self._signals += 1
        id = f"turn-aborted-{self._signals}"
        signal = TurnSignal(id=id, turn=aborted.turn, signal="aborted", actor=aborted.addressee)
        request = SignalTurn(
            id=f"{self._session}/{id}", requester=self._bus.name, signal=signal, at=self._bus.stamp(now)
        )
        self._requests.send(keys.TURN, request)

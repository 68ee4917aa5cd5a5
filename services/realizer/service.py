"""The realizer on the bus: takes blocks, answers each exactly once, and performs any number of them at a time."""

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import (
    BehaviorInterrupted,
    BlockOutcome,
    InterruptBehavior,
    PerformBlock,
    SteerPerformance,
    SteerRobot,
    WarningFeedback,
)
from engage_hri.schemas.body import (
    GoHome,
    SyncPointArrived,
    SyncPointReached,
    WordSpoken,
)
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.references import disambiguated
from engage_hri.schemas.requests import Cancel, Outcome, Request, Unreadable
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.realizer.config import LEASE, RealizerConfig
from engage_hri.services.realizer.perform.behavior_run import ABORT, LONGEST_WAY, Presence
from engage_hri.services.realizer.perform.net_stream import telling_of_turn
from engage_hri.services.realizer.perform.performance import BlockPerformance, SharedContext
from engage_hri.services.realizer.perform.steering import Steering
from engage_hri.services.realizer.plan.known import BLOCK_END, qualified
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.relations import LASTING, BlockRefused
from engage_hri.services.realizer.together.live import Ending, Live, absence, told
from engage_hri.services.realizer.together.live_blocks import LiveBlocks, Past, WaitingBlock
from engage_hri.services.realizer.together.planning import Planning
from engage_hri.services.requests.ends import Patience, RequestDesk, Requester, unfinished
from engage_hri.services.runtime.ledger import NotedInputs
from engage_hri.services.runtime.service import Ready, tell_settings

PULSE: Seconds = 1.0
"""Time between two renewals of the requests to the body and to recognition: two may be lost within a
`LEASE`. Ours."""
Result = TypeVar("Result")


class _Realizer:
    def __init__(self, bus: Bus, config: RealizerConfig) -> None:
        self.bus = bus
        self.config = config
        self.requests = Requester(bus, Patience(pulse=PULSE, lease=LEASE, cancel=ABORT))
        self.desk = RequestDesk(bus, "realizer", self.cancel)
        self.live: dict[str, Live] = {}
        self.performances: dict[str, BlockPerformance] = {}
        """Blocks of `live` that are being performed, by the id of the request."""
        self.routes: dict[str, BlockPerformance] = {}
        self.peers = Presence()
        self.live_blocks = LiveBlocks(bus.now)
        self.endings = Past[Ending](bus.now)
        """How the blocks have ended that are over, by id."""
        self.homing: set[asyncio.Future[Outcome]] = set()
        """Outcomes of the parts that are on their way home, sent by blocks that replace others."""
        self.noted = NotedInputs(bus, "realizer")
        self.planning = Planning(bus, self.live_blocks, lambda: self.shared.performed(), self.noted.take_own)
        self.steering = Steering(bus, self.desk, config, self.live, self.performances, self.live_blocks)
        self.shared = SharedContext(
            bus, self.requests, config, self.peers, self.routes, self.performing, self.live_blocks,
            self.steering.forget, self.planning.estimates,
        )  # fmt: skip

    # -- what arrives ---------------------------------------------------------------------------------------------

    def take(self, received: Received, tasks: asyncio.TaskGroup) -> None:
        match received.message:
            case SyncPointArrived() | SyncPointReached() as report:
                self._hear(report)
                return
            case WordSpoken() as word:
                self._hear_word(word)
                return
            case PeerAlive() | PeerGone() as change:
                self.peers.feed(change)
            case Unreadable(block=block, fault=fault):
                self.bus.publish(keys.FEEDBACK, unread(block, fault))
        self.requests.feed(received)
        if (request := self.desk.take(received)) is not None:
            with self.desk.serving(request):
                self._serve(request, tasks)

    def _serve(self, request: Request, tasks: asyncio.TaskGroup) -> None:
        match request:
            case PerformBlock():
                if len(self.live) >= self.config.blocks:
                    self.desk.refuse(request.id, self._too_many(request.block.id))
                    return
                live = self.live[request.id] = Live(request, tuple(self.live.values()), self.endings)
                tasks.create_task(self._perform(live), name=f"block {request.block.id}")
            case InterruptBehavior():
                tasks.create_task(self.interrupt(request), name=f"interruption {request.id}")
            case SteerPerformance() | SteerRobot():
                tasks.create_task(self.steering.steer(request), name=f"steering {request.id}")
            case Cancel():
                self.cancel(request)

    def _too_many(self, block: str) -> Fault:
        reason = f"{len(self.live)} blocks are live, the most that are performed in time"
        advice = "wait until one has ended; `realizer.blocks` is the limit"
        return Fault(reason=reason, where=block, advice=advice, service="realizer")

    def _hear(self, report: SyncPointArrived | SyncPointReached) -> None:
        performance = self.routes.get(report.id)
        if performance is not None and report.requester in ("", self.bus.name):
            with performance.containing():
                performance.feed(report)

    def performing(self) -> list[BlockPerformance]:
        return list(self.performances.values())

    def cancel(self, cancel: Cancel) -> None:
        if live := self.live.get(cancel.id):
            live.stop(Ending("interrupted", cancel.fault(live.id)))

    async def interrupt(self, request: InterruptBehavior) -> None:
        """End one behavior of a block, and answer what came of it."""
        block, behavior = request.block, request.behavior
        with self.desk.serving(request):
            live = next((each for each in self.live.values() if each.id == block), None)
            if live is None or not self.steering.is_going_on(live, behavior):
                self.desk.refuse(request.id, absence(block, behavior, self.live.values()))
                return
            self.desk.accept(request.id)
            performance = self.performances.get(live.request.id)
            was_done = await self.steering.interrupt(live, behavior)
            said = None if performance is None else performance.spoken.of(behavior)
            text = said.text if said is not None else ""
            end = BehaviorInterrupted(id=request.id, block=block, behavior=behavior, spoken=text, was_done=was_done)
            self.desk.end(end)

    def _hear_word(self, word: WordSpoken) -> None:
        for performance in self.performing():
            if performance.id == word.block:
                performance.spoken.hear(word.behavior, word.position)
                if performance.decisions.say(word.behavior, word.position, self.bus.local(word.at), self.bus.now()):
                    performance.take_in()
                performance.tell_stuck()  # A voice that is held may stand now.

    async def _perform(self, live: Live) -> None:
        """Perform a block; an exception that nothing else catches ends this block only, and takes its parts home."""
        with self.bus.containing(str(live), lambda fault: self._abandon(live, fault)):
            await self.perform(live)

    def _abandon(self, live: Live, fault: Fault) -> None:
        live.stop(Ending("failed", fault))
        performance = self.performances.get(live.request.id)
        if live.request.id in self.live:
            self._forget(live)
            self.desk.end(replace(live.outcome, status="failed", fault=fault))
        if performance is not None:
            with self.bus.containing(f"the rest of {live}"):
                performance.abandon()

    async def perform(self, live: Live) -> None:
        """Answer a request for a block: refuse it, or perform the block to its outcome."""
        block = live.request.block
        if self.live_blocks.is_live(block.id):
            advice = "give it another id, or wait until that has ended: a cancelled one ends with its word"
            fault = Fault(reason="a block of this id is still being performed", where=block.id, advice=advice)
            self._refuse(live, BlockRefused(fault))
            return
        if live.unknown:
            reason = f"it follows {', '.join(live.unknown)}: no block of that id is known"
            advice = f"a block can be followed from its request until {LASTING:g} s after its end"
            self._refuse(live, BlockRefused(Fault(reason=reason, where=block.id, advice=advice)))
            return
        if live.request.follows and block.composition == "REPLACE":
            advice = "leave out one of the two: REPLACE ends all that runs, and a block ends with those it follows"
            fault = Fault(reason="it follows blocks that it replaces", where=block.id, advice=advice)
            self._refuse(live, BlockRefused(fault))
            return
        with self.live_blocks.opened(disambiguated(block)) as live.block:
            live.elsewhere = self.live_blocks.named_by(live.block.id)
            try:
                plan = await _result_or_stopped(live.ending, self.planning.plan(live))
            except EngageError as error:
                self._refuse(live, error)
                return
            if plan is not None:
                self.desk.accept(live.request.id)
                with telling_of_turn(self.bus, live):
                    plan = await _result_or_stopped(live.ending, self._await_turn(live, plan))
            if plan is None:
                await self._end(live, live.outcome)
                return
            performance = self.performances[live.request.id] = BlockPerformance(
                live, plan, self.shared, self.steering.held(live), is_held=self.steering.is_holding
            )
            live.settle()
            await self._end(live, await performance.run())

    async def _await_turn(self, live: Live, plan: Plan) -> Plan:
        """Wait for earlier blocks if composition asks for that. Returns the plan, made anew if that took time."""
        earlier, live.earlier = live.earlier, []
        replaces = live.block.composition == "REPLACE"
        is_free = not earlier and not (replaces and self.homing)
        if live.block.composition == "MERGE" or is_free:
            return plan
        performed = (self.performances.get(other.request.id) for other in earlier)
        replaced = [each for each in performed if each is not None]
        if replaces:
            for other in earlier:
                by = live.request.requester
                fault = Fault(reason=f"{live.id} replaced it", where=other.id, cause="replaced", whose=by)
                other.stop(Ending("interrupted", fault, replaced_by=live.id))
        leaders = {other.block.id for other in earlier}
        waiting = WaitingBlock(
            plan, self.live_blocks, self.bus.now, leaders, lambda: self.steering.held(live) is None
        )
        self.live_blocks.perform(live.block.id, waiting, live.elsewhere)
        ends = [qualified(name, BLOCK_END) for name in leaders] if not replaces else []
        with self.live_blocks.followed(waiting, ends):
            live.settle()
            if earlier:
                await asyncio.wait([other.ended for other in earlier])
        if replaces:
            self._send_home(live, replaced)
            if self.homing:
                # Among them are parts sent home by a block that was itself replaced before it began.
                self.homing -= await unfinished(self.homing, ABORT, self.bus)
        await self.planning.planned(live.block, self.live.values())
        try:
            live.unsettle()
            # Asked again: the body is elsewhere by now.
            return await self.planning.again(plan, live.elsewhere)
        except EngageError as error:
            self._warn(live, error)
            live.fail(error.fault)
            return plan

    def _send_home(self, live: Live, replaced: list[BlockPerformance]) -> None:
        parts = {part for other in replaced for part in other.parts_used}
        parts = parts.difference(*(other.parts_moving for other in self.performing() if other not in replaced))
        if parts:
            home = GoHome(id=f"{live.request.id}/:way", parts=tuple(sorted(parts)))
            way = self.requests.send(keys.BEHAVIOR, home, within=LONGEST_WAY).outcome
            self.homing.add(way)
            way.add_done_callback(self.homing.discard)

    def _warn(self, live: Live, error: EngageError) -> None:
        kind = error.kind if isinstance(error, BlockRefused) else "PARSING_FAILURE"
        block = live.request.block
        warning = WarningFeedback(
            block=block.id or None,
            kind=kind,
            message=told(error.fault).within(block.id),
            character_id=block.character_id,
        )
        self.bus.publish(keys.FEEDBACK, warning)

    def _refuse(self, live: Live, error: EngageError) -> None:
        self._warn(live, error)
        live.fail(error.fault)
        self._forget(live)
        self.desk.refuse(live.request.id, told(error.fault))

    async def _end(self, live: Live, outcome: BlockOutcome) -> None:
        """Send the outcome, as the last word about the block: that it is no longer held comes before.

        If the block ended with one that it follows, after that one's: its outcome is the cause.
        """
        if live.ended_by is not None:
            await asyncio.wait([live.ended_by.ended])
        self._forget(live)
        self.desk.end(outcome)

    def _forget(self, live: Live) -> None:
        del self.live[live.request.id]
        self.steering.forget(live.id)
        self.performances.pop(live.request.id, None)
        live.settle()
        live.ended.set_result(None)
        if not any(each.id == live.id for each in self.live.values()):  # else it was refused for its id
            self.endings.add(live.id, live.ending.result())


async def _result_or_stopped(stopped: asyncio.Future[Ending], work: Coroutine[Any, Any, Result]) -> Result | None:
    """The result of `work`; None, and `work` is cancelled, if `stopped` is done first."""
    task = asyncio.ensure_future(work)
    try:
        either: list[asyncio.Future[Any]] = [task, stopped]
        await asyncio.wait(either, return_when=asyncio.FIRST_COMPLETED)
        return None if stopped.done() else task.result()
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


def unread(block: str, fault: Fault) -> WarningFeedback:
    """The warning about a message that came as a block and could not be read. block: its id; empty: not known."""
    return WarningFeedback(block=block or None, kind="PARSING_FAILURE", message=fault.within(block))


async def realize(bus: Bus, ready: Ready, config: RealizerConfig) -> None:
    """Serve until cancelled. A bad block is answered with a fault; it never ends the service."""
    realizer = _Realizer(bus, config)
    patterns = dict.fromkeys((*RequestDesk.patterns("realizer"), *Requester.PATTERNS, keys.SYNC_POINT))
    try:
        with bus.subscribe(*patterns) as inbox:
            realizer.steering.tell()
            tell_settings(bus, "realizer", config)
            ready()
            async with asyncio.TaskGroup() as tasks:
                is_same_turn = False
                async for received in inbox:
                    with bus.containing(received):
                        realizer.noted.take(received, is_same_turn=is_same_turn)
                        realizer.take(received, tasks)
                    is_same_turn = len(inbox) > 0
    finally:
        realizer.noted.close()
        realizer.steering.close()
        realizer.desk.close()
        realizer.requests.close()

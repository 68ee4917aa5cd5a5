"""The realizer on the bus: takes blocks, answers each exactly once, and performs any number of them at a time."""

import asyncio
from collections.abc import Mapping

from msgspec import Struct

from schemas import keys
from schemas.blocks import Block, BlockOutcome, PerformBlock
from schemas.body import (
    BodyPose,
    Estimate,
    EstimateBehaviors,
    EstimateItem,
    Estimates,
    GoHome,
    SyncPointArrived,
    SyncPointReached,
)
from schemas.faults import EngageError, Fault, NoReply
from schemas.feedback import WarningFeedback
from schemas.presence import PeerAlive, PeerGone
from schemas.requests import Cancel
from services.bus import Bus
from services.realizer.config import RealizerConfig
from services.realizer.executor import Performance
from services.realizer.planner import Plan, plan_block, poses_before
from services.realizer.points import performer
from services.realizer.relations import BlockRefused, relations
from services.realizer.surroundings import Ending, Surroundings
from services.requests import RequestDesk, Requester
from services.runtime import Ready


class _Live(Struct, eq=False):
    """A block from its request to its outcome.

    earlier: those that were there when it came. ended: resolved when its outcome is out.
    """

    request: PerformBlock
    earlier: list["_Live"]
    ended: asyncio.Future[None]
    performance: Performance | None = None
    ending: Ending | None = None
    """How it is to end, if that was decided before it began."""

    def stop(self, ending: Ending) -> None:
        self.ending = self.ending or ending
        if self.performance is not None:
            self.performance.stop(ending)


class _Realizer:
    def __init__(self, bus: Bus, config: RealizerConfig) -> None:
        self.bus = bus
        self.config = config
        self.requests = Requester(bus)
        self.desk = RequestDesk(bus, "realizer", self.cancel)
        self.live: dict[str, _Live] = {}
        self.routes: dict[str, Performance] = {}
        self.peers: set[str] = set()
        self.around = Surroundings(bus, self.requests, config, self.peers.__contains__, self.routes, self.performing)

    def performing(self) -> list[Performance]:
        return [live.performance for live in self.live.values() if live.performance is not None]

    def cancel(self, cancel: Cancel) -> None:
        if live := self.live.get(cancel.id):
            reason = cancel.reason or "cancelled"
            live.stop(Ending("interrupted", Fault(reason=reason, where=live.request.block.id)))

    def admit(self, request: PerformBlock) -> _Live:
        live = _Live(request, list(self.live.values()), asyncio.get_running_loop().create_future())
        self.live[request.id] = live
        return live

    async def perform(self, live: _Live) -> None:
        """A block from request to outcome."""
        request = live.request
        try:
            plan = await self._plan(live)
        except EngageError as error:
            self._refuse(live, error)
            return
        self.desk.accept(request.id)
        if await self._make_way(live):
            # The body is elsewhere by now.
            plan = await self._anew(plan, live)
        if live.ending is not None:
            self._end(live, self._never_begun(request, live.ending))
            return
        live.performance = Performance(request, plan, self.around)
        self._end(live, await live.performance.run())

    async def _plan(self, live: _Live) -> Plan:
        block = live.request.block
        if any(other.request.block.id == block.id and not other.ended.done() for other in live.earlier):
            raise BlockRefused(Fault(reason="a block of this id is still being performed", where=block.id))
        elsewhere = frozenset(point for other in self.performing() for point in other.elsewhere)
        relations(block, elsewhere)  # A bad reference is seen without asking the body.
        plan = plan_block(block, await self._estimates(block, {}), elsewhere=elsewhere)
        if (before := poses_before(plan)) or plan.block is not block:
            # The plan may have given a gesture the other hand.
            plan = plan_block(plan.block, await self._estimates(plan.block, before), elsewhere=elsewhere)
        return plan

    async def _estimates(self, block: Block, before: Mapping[str, BodyPose]) -> tuple[Estimate, ...]:
        """before: where the body will be when a behavior starts; the others are asked for from where it is now."""
        behaviors = [behavior for behavior in block.behaviors if performer(behavior) == "body"]
        if not behaviors:
            return ()
        items = (EstimateItem(behavior=behavior, pose=before.get(behavior.id)) for behavior in behaviors)
        question = EstimateBehaviors(items=tuple(items))
        try:
            answer = await self.bus.query(keys.ESTIMATE, question, timeout=self.config.estimate)
        except NoReply as error:
            fault = Fault(reason="there is no body to perform it", where=block.id, advice="start control")
            raise BlockRefused(fault, "CANNOT_CREATE_BEHAVIOR") from error
        assert isinstance(answer, Estimates)
        return answer.items

    async def _make_way(self, live: _Live) -> bool:
        """What composition asks of the blocks that are already there; whether it had to wait for them."""
        earlier, replaces = live.earlier, live.request.block.composition == "REPLACE"
        live.earlier = []
        if live.request.block.composition == "MERGE" or not earlier:
            return False
        if replaces:
            for other in earlier:
                other.stop(Ending("interrupted", replaced_by=live.request.block.id))
        await asyncio.wait([other.ended for other in earlier])
        parts = {part for other in earlier if other.performance is not None for part in other.performance.parts_used}
        if replaces and parts:
            home = GoHome(id=f"{live.request.id}/way", requester=self.bus.name, parts=tuple(sorted(parts)))
            pending = self.requests.send(keys.BEHAVIOR, home)
            await asyncio.wait([pending.outcome], timeout=self.config.abort)
        return True

    async def _anew(self, plan: Plan, live: _Live) -> Plan:
        """The same plan from where the body is now; the block ends as failed if there is none."""
        elsewhere = [point for point in plan.at if ":" in point.behavior]
        try:
            estimates = await self._estimates(plan.block, poses_before(plan))
            return plan_block(plan.block, estimates, elsewhere=elsewhere)
        except EngageError as error:
            live.stop(Ending("failed", error.fault))
            return plan

    def _never_begun(self, request: PerformBlock, ending: Ending) -> BlockOutcome:
        return BlockOutcome(
            id=request.id,
            block=request.block.id,
            status=ending.status,
            replaced_by=ending.replaced_by,
            fault=ending.fault,
        )

    def _refuse(self, live: _Live, error: EngageError) -> None:
        fault = error.fault
        kind = error.kind if isinstance(error, BlockRefused) else "PARSING_FAILURE"
        warning = WarningFeedback(block=live.request.block.id or None, kind=kind, message=str(fault))
        self.bus.publish(keys.FEEDBACK, warning)
        self.desk.refuse(live.request.id, fault)
        self._forget(live)

    def _end(self, live: _Live, outcome: BlockOutcome) -> None:
        self.desk.end(outcome)
        self._forget(live)

    def _forget(self, live: _Live) -> None:
        del self.live[live.request.id]
        live.ended.set_result(None)


async def realize(bus: Bus, ready: Ready, config: RealizerConfig) -> None:
    """Serve until cancelled. A bad block is answered with a fault; it never ends the service."""
    realizer = _Realizer(bus, config)
    patterns = dict.fromkeys((*RequestDesk.patterns("realizer"), *Requester.PATTERNS, keys.SYNC_POINT))
    try:
        with bus.subscribe(*patterns) as inbox:
            ready()
            async with asyncio.TaskGroup() as tasks:
                async for received in inbox:
                    match received.message:
                        case SyncPointArrived(id=id) | SyncPointReached(id=id) as report if id in realizer.routes:
                            realizer.routes[id].feed(report)
                        case PeerAlive(participant=peer):
                            realizer.peers.add(peer)
                        case PeerGone(participant=peer):
                            realizer.peers.discard(peer)
                    realizer.requests.feed(received)
                    match realizer.desk.take(received):
                        case PerformBlock(id=id) as request if id not in realizer.live:
                            live = realizer.admit(request)
                            tasks.create_task(realizer.perform(live), name=f"block {request.block.id}")
                        case Cancel() as cancel:
                            realizer.cancel(cancel)
    finally:
        realizer.desk.close()
        realizer.requests.close()

"""A realizer, a fake body and, if wanted, a fake recognition on one memory bus; and what they were seen to do."""

import asyncio
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from functools import partial

from msgspec import Struct, field

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import After, Before, BlockBehavior, Constraint, Synchronize
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    BlockProgress,
    PerformBlock,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.recognition import EventOutcome, RequestEvent, SignalTurn, TurnOutcome
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import Pending, RequestDesk, Requester
from engage_hri.services.runtime.service import Ready, Service, running
from tests.realizer.fake_body import FakeBody


def block(
    behaviors: Sequence[BlockBehavior], *operators: Synchronize | After | Before, id: str = "b", **rest: object
) -> Block:
    constraints = (Constraint(operators=operators, id="constraint-1"),) if operators else ()
    return Block(id=id, behaviors=tuple(behaviors), constraints=constraints, **rest)  # type: ignore[arg-type]


def together(*refs: str) -> Synchronize:
    return Synchronize(ref=refs[0], syncs=refs[1:])


def after(ref: str, *syncs: str) -> After:
    return After(ref=ref, syncs=syncs)


def before(ref: str, *syncs: str) -> Before:
    return Before(ref=ref, syncs=syncs)


class FakeRecognition:
    """Decides each event as told: seconds after its start, by behavior id; None: never, though 12 s are promised."""

    within: Seconds | None = 12.0

    def __init__(self, decisions: Mapping[str, Seconds | None] | None = None, refuse: Sequence[str] = ()) -> None:
        self.decisions = dict(decisions or {})
        self.refuse = refuse
        self.events: list[RequestEvent] = []
        self.signals: list[SignalTurn] = []
        self.cancelled: list[str] = []

    async def serve(self, bus: Bus, ready: Ready) -> None:
        desk = RequestDesk(bus, "recognition", lambda cancel: None)
        try:
            with bus.subscribe(*RequestDesk.patterns("recognition")) as inbox:
                ready()
                async with asyncio.TaskGroup() as tasks:
                    async for received in inbox:
                        match desk.take(received):
                            case RequestEvent() as request:
                                self.events.append(request)
                                if request.event.id in self.refuse:
                                    desk.refuse(request.id, Fault(reason="unknown actor"))
                                    continue
                                desk.accept(request.id, within=self.within)
                                tasks.create_task(self._decide(bus, desk, request))
                            case SignalTurn() as signal:
                                self.signals.append(signal)
                                desk.end(TurnOutcome(id=signal.id, at=bus.stamp()))
                            case Cancel(id=id):
                                self.cancelled.append(id)
        finally:
            desk.close()

    async def _decide(self, bus: Bus, desk: RequestDesk, request: RequestEvent) -> None:
        delay = self.decisions.get(request.event.id)
        if delay is not None:
            await asyncio.sleep(delay)
            desk.end(EventOutcome(id=request.id, event="e1", state="succeeded", at=bus.stamp()))


class Stage(Struct):
    """Everything seen. times: of each reported sync point, `block/behavior:sync`, from its block's start."""

    hub: MemoryHub
    body: FakeBody
    recognition: FakeRecognition
    requests: Requester
    feedback: list[object] = field(default_factory=list)
    news: asyncio.Event = field(default_factory=asyncio.Event)

    def ask(self, block: Block, *follows: str) -> Pending:
        request = PerformBlock(id=f"r-{block.id}", requester="test", block=block, follows=follows)
        return self.requests.send(keys.BLOCK, request)

    async def perform(self, block: Block) -> BlockOutcome:
        outcome = await self.ask(block).outcome
        assert isinstance(outcome, BlockOutcome)
        return outcome

    async def some_feedback(self) -> None:
        """Wait until the realizer has said something more."""
        self.news.clear()
        await self.news.wait()

    async def seen(self, point: str, block: str = "b") -> None:
        """Wait for a sync point."""
        while point not in self.times(block):
            await self.some_feedback()

    def progress(self, block: str = "b") -> list[SyncPointProgress]:
        return [each for each in self.feedback if isinstance(each, SyncPointProgress) and each.block == block]

    def times(self, block: str = "b") -> dict[str, Seconds]:
        return {f"{each.behavior}:{each.sync}": each.time for each in self.progress(block)}

    def warnings(self) -> list[WarningFeedback]:
        return [each for each in self.feedback if isinstance(each, WarningFeedback)]

    def ends(self) -> list[BlockProgress]:
        return [each for each in self.feedback if isinstance(each, BlockProgress) and each.progress == "end"]


@asynccontextmanager
async def stage(
    body: FakeBody | None = None,
    recognition: FakeRecognition | None = None,
    config: RealizerConfig | None = None,
    hub: MemoryHub | None = None,
) -> AsyncIterator[Stage]:
    body = body or FakeBody()
    own = MemoryHub() if hub is None else hub
    services: dict[str, Service] = {
        "control": body.serve,
        "realizer": partial(realize, config=config or RealizerConfig()),
    }
    if recognition is not None:
        services["recognition"] = recognition.serve
    async with running(own, services):
        bus = own.join("test")
        async with Requester(bus) as requests:
            seen = Stage(own, body, recognition or FakeRecognition(), requests)
            listening = asyncio.create_task(_listen(bus, seen), name="listen to feedback")
            try:
                yield seen
            finally:
                await asyncio.sleep(0)
                listening.cancel()
                await asyncio.gather(listening, return_exceptions=True)
        await bus.leave()


async def _listen(bus: Bus, seen: Stage) -> None:
    with bus.subscribe(keys.FEEDBACK) as inbox:
        async for received in inbox:
            seen.feedback.append(received.message)
            seen.news.set()

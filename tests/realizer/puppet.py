"""A body that does what the test says, line by line, and nothing by itself: it may lie, stammer, die, come back."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.blocks import (
    Block,
    BlockOutcome,
    BlockProgress,
    PerformBlock,
    PredictionFeedback,
    SyncPointProgress,
    WarningFeedback,
)
from engage_hri.schemas.body import (
    BehaviorOutcome,
    Estimate,
    EstimateBehaviors,
    Estimates,
    GoHome,
    HomeReached,
    PerformBehavior,
    SyncPointArrived,
    SyncPointReached,
)
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.requests import Accepted, Answer, Cancel, Refused, Request, answering
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus, Hub
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import Pending, Requester
from engage_hri.services.runtime.service import running
from tests.realizer.fake_body import FakeBody

DRAFT = "org.mindmakers.bml"
BML_1_0 = "http://www.bml-initiative.org/bml/bml-1.0"


def bml(content: str, id: str = "b", dialect: str = DRAFT, composition: str = "") -> Block:
    """A block from its elements as text."""
    composed = f' composition="{composition}"' if composition else ""
    block = decode_xml(f'<bml id="{id}"{composed} xmlns="{dialect}">{content}</bml>'.encode())
    assert isinstance(block, Block)
    return block


class Puppet:
    """Also the client, and who listens: everything on one bus participant per role.

    estimates: what it answers about a behavior, by id, instead of `FakeBody`'s durations. None: it answers nothing.
    """

    def __init__(self, hub: Hub, estimates: Mapping[str, Estimate] | None = None, *, is_mute: bool = False) -> None:
        self.hub = hub
        self.estimates = dict(estimates or {})
        self.is_mute = is_mute
        self.performs: dict[str, list[PerformBehavior]] = {}
        """By `block:behavior`, each version once."""
        self.aborted: list[str] = []
        self.homes: list[tuple[str, ...]] = []
        self.feedback: list[Any] = []
        self.outcomes: dict[str, BlockOutcome] = {}
        self._news = asyncio.Event()
        self._known: set[tuple[str, str, int]] = set()
        self.goes_home = True
        self.aborts = True
        """Does it end what is aborted?"""

    # -- the client ----------------------------------------------------------------------------------------------

    def ask(self, block: Block) -> Pending:
        return self.requests.send(
            keys.BLOCK, PerformBlock(id=f"r-{block.id}", requester=self.client.name, block=block)
        )

    async def perform(self, block: Block) -> BlockOutcome:
        outcome = await self.ask(block).outcome
        assert isinstance(outcome, BlockOutcome)
        return outcome

    # -- what is seen ----------------------------------------------------------------------------------------------

    def points(self, block: str = "b") -> list[str]:
        return [
            f"{said.behavior}:{said.sync}"
            for said in self.feedback
            if isinstance(said, SyncPointProgress) and said.block == block
        ]

    def progress(self, name: str, block: str = "b") -> SyncPointProgress:
        (found,) = [
            said
            for said in self.feedback
            if isinstance(said, SyncPointProgress) and (said.block, f"{said.behavior}:{said.sync}") == (block, name)
        ]
        return found

    def time(self, name: str, block: str = "b") -> Seconds:
        return self.progress(name, block).time

    def warnings(self) -> list[tuple[str, str]]:
        """`block:behavior` and type."""
        return [
            (":".join(filter(None, (said.block, said.behavior))), said.kind)
            for said in self.feedback
            if isinstance(said, WarningFeedback)
        ]

    def predictions(self, block: str = "b") -> list[dict[str, Seconds]]:
        return [
            {f"{each.behavior}:{each.sync}": each.time for each in said.points}
            for said in self.feedback
            if isinstance(said, PredictionFeedback) and said.block == block
        ]

    def course(self) -> list[tuple[str | None, str, str]]:
        """Beginnings and ends of blocks."""
        return [(said.block, said.progress, said.status) for said in self.feedback if isinstance(said, BlockProgress)]

    def through(self, name: str) -> list[str]:
        """How far `block:behavior` was told it may go, over time."""
        return [each.through for each in self.performs.get(name, ())]

    async def until(self, condition: Any) -> None:
        while not condition():
            self._news.clear()
            await self._news.wait()

    async def told(self, behavior: str, through: str = "", block: str = "b") -> PerformBehavior:
        """Wait for the command to perform it, through a point if one is named."""
        name = f"{block}:{behavior}"
        await self.until(lambda: self.performs.get(name) and through in ("", self.performs[name][-1].through))
        return self.performs[name][-1]

    # -- the body, as the test tells it --------------------------------------------------------------------------

    def say(self, message: Message, key: str = keys.SYNC_POINT) -> None:
        self.bus.publish(key, message)

    def accept(self, behavior: str, block: str = "b") -> None:
        self.answer_to(behavior, block, Accepted(id=""))

    def refuse(self, behavior: str, block: str = "b") -> None:
        self.answer_to(behavior, block, Refused(id="", fault=Fault(reason="conflict")))

    def answer_to(self, behavior: str, block: str, answer: Answer) -> None:
        """To the command to perform it, if there was one."""
        for request in self.performs.get(f"{block}:{behavior}", ())[-1:]:
            self.say(answering(request, answer), keys.request_state("control"))  # type: ignore[arg-type]

    def reach(self, behavior: str, *syncs: str, at: Seconds | None = None, block: str = "b") -> None:
        stamp = self.stamp(at)
        for sync in syncs:
            self.say(
                SyncPointReached(
                    id=f"r-{block}/{behavior}", block=block, behavior=behavior, sync=sync, at=stamp, arrived=stamp
                )
            )

    def leave(self, behavior: str, sync: str, arrived: Seconds, block: str = "b") -> None:
        """Pass a point at which it has waited since `arrived`."""
        self.say(
            SyncPointReached(
                id=f"r-{block}/{behavior}",
                block=block,
                behavior=behavior,
                sync=sync,
                at=self.stamp(),
                arrived=self.stamp(arrived),
            )
        )

    def hold(self, behavior: str, sync: str, block: str = "b") -> None:
        self.say(
            SyncPointArrived(id=f"r-{block}/{behavior}", block=block, behavior=behavior, sync=sync, at=self.stamp())
        )

    def end(self, behavior: str, status: Any = "done", spoken: str = "", block: str = "b", passed: str = "") -> None:
        outcome = BehaviorOutcome(
            id="",
            block=block,
            behavior=behavior,
            status=status,
            at=self.stamp(),
            passed=passed,
            spoken=spoken,
            fault=Fault(reason="overheated") if status == "failed" else None,
        )
        self.answer_to(behavior, block, outcome)

    def stamp(self, at: Seconds | None = None) -> Stamp:
        return self.bus.stamp(at)

    async def do(self, behavior: str, *syncs: str, every: Seconds = 0.0, block: str = "b") -> None:
        """Accept it, and reach these points, `every` seconds one."""
        await self.told(behavior, block=block)
        self.accept(behavior, block)
        for number, sync in enumerate(syncs):
            if number:
                await asyncio.sleep(every)
            self.reach(behavior, sync, block=block)
        if syncs and syncs[-1] == "end":
            self.end(behavior, block=block)

    def die(self) -> None:
        assert isinstance(self.hub, MemoryHub)
        self.listening.cancel()
        self.hub.kill("control")

    def revive(self) -> None:
        self.bus = self.hub.join("control")
        self._serve(asyncio.get_running_loop())

    # -- its ears --------------------------------------------------------------------------------------------------

    async def _listen(self, bus: Bus) -> None:
        with bus.subscribe(keys.commands("control")) as inbox:
            async for received in inbox:
                if isinstance(received.message, Request):
                    self._hear(received.message)
                self._news.set()

    def _hear(self, request: Request) -> None:
        version = (type(request).__name__, request.id, request.revision)
        if version in self._known:
            return
        self._known.add(version)
        match request:
            case PerformBehavior(block=block, behavior=behavior):
                self.performs.setdefault(f"{block}:{behavior.id}", []).append(request)
            case Cancel(id=id):
                behavior = id.partition("/")[2]
                self.aborted.append(behavior)
                if self.aborts:
                    self.end(behavior, "aborted", block=id.partition("/")[0].removeprefix("r-"))
            case GoHome(parts=parts):
                self.homes.append(parts)
                if self.goes_home:
                    self.say(answering(request, HomeReached(id="", at=self.stamp())), keys.request_state("control"))

    def estimate(self, behavior: BlockBehavior) -> Estimate:
        return self.estimates.get(behavior.id) or FakeBody().estimate(behavior)

    def answer(self, question: Message) -> Message:
        assert isinstance(question, EstimateBehaviors)
        return Estimates(items=tuple(self.estimate(item.behavior) for item in question.items))

    async def _watch(self) -> None:
        with self.client.subscribe(keys.FEEDBACK, keys.request_state("realizer")) as inbox:
            async for received in inbox:
                if isinstance(received.message, BlockOutcome):
                    assert received.message.block not in self.outcomes, "a second outcome"
                    self.outcomes[received.message.block] = received.message
                elif not isinstance(received.message, Accepted | Refused):
                    self.feedback.append(received.message)
                self._news.set()

    def _serve(self, loop: asyncio.AbstractEventLoop) -> None:
        if not self.is_mute:
            self.bus.answer(keys.ESTIMATE, self.answer)
        self.listening = loop.create_task(self._listen(self.bus), name="puppet listens")
        self.bus.declare_alive()


@asynccontextmanager
async def puppet(
    estimates: Mapping[str, Estimate] | None = None,
    *,
    config: RealizerConfig | None = None,
    hub: Hub | None = None,
    is_mute: bool = False,
) -> AsyncIterator[Puppet]:
    """A realizer, and a body and client in the hands of the test."""
    hub = hub or MemoryHub()
    body = Puppet(hub, estimates, is_mute=is_mute)
    body.bus, body.client = hub.join("control"), hub.join("client")
    body._serve(asyncio.get_running_loop())
    service = partial(realize, config=config or RealizerConfig())
    async with running(hub, {"realizer": service}), Requester(body.client) as body.requests:
        watching = asyncio.create_task(body._watch(), name="puppet watches")
        await asyncio.sleep(0)
        try:
            yield body
        finally:
            await asyncio.sleep(0)
            for task in (watching, body.listening):
                task.cancel()
            await asyncio.gather(watching, body.listening, return_exceptions=True)
    await body.bus.leave()
    await body.client.leave()

"""A server of long requests that performs blocks by waiting, and keeps a diary."""

import asyncio
from typing import Any

from msgspec.structs import replace

from engage_hri.schemas.behaviors import Wait
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.body import PerformBehavior
from engage_hri.schemas.requests import A, Cancel, Heard, Request, answering
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.requests.ends import Pending, RequestDesk


def block(id: str = "b", requester: str = "client", of: str = "") -> PerformBlock:
    """of: its block, if that is called otherwise."""
    return PerformBlock(id=id, requester=requester, block=Block(id=of or id))


def bare(request: Request) -> Request:
    """Without what a requester adds to it."""
    return replace(request, life="", lease=0.0)


def answered(pending: Pending, answer: A) -> A:
    """`answer` as it travels."""
    return answering(pending.request, answer)


def extent(through: str, id: str = "b") -> PerformBehavior:
    return PerformBehavior(id=id, requester="client", block="b", behavior=Wait(id="w"), through=through)


class Server:
    """Accepts every block, performs it for `seconds`, and keeps a diary. accepts: else it says only that it began."""

    def __init__(self, hub: MemoryHub, seconds: float = 0.5, name: str = "realizer", *, accepts: bool = True) -> None:
        self.bus = hub.join(name)
        self.desk = RequestDesk(self.bus, name, self.cancel)
        self.seconds = seconds
        self.begun = self.desk.accept if accepts else lambda id: self.desk.answer(Heard(id=id))
        self.taken: list[Request] = []
        self.ended: list[str] = []
        self.timers: dict[str, asyncio.TimerHandle] = {}
        self.task = asyncio.create_task(self.serve(), name=name)

    async def serve(self) -> None:
        with self.bus.subscribe(*RequestDesk.patterns(self.bus.name)) as inbox:
            self.bus.declare_alive()
            async for received in inbox:
                match self.desk.take(received):
                    case Cancel() as cancel:
                        self.taken.append(bare(cancel))
                        self.cancel(cancel)
                    case Request(id=id) as request:
                        self.taken.append(bare(request))
                        if id not in self.timers:
                            self.begun(id)
                            loop = asyncio.get_running_loop()
                            self.timers[id] = loop.call_later(self.seconds, self.end, id, "done")

    def cancel(self, cancel: Cancel) -> None:
        self.timers[cancel.id].cancel()
        self.end(cancel.id, "interrupted")

    def end(self, id: str, status: Any) -> None:
        self.ended.append(f"{id} {status}")
        self.desk.end(BlockOutcome(id=id, block=id, status=status))

    async def die(self, hub: MemoryHub) -> None:
        hub.kill(self.bus.name)
        for timer in self.timers.values():
            timer.cancel()
        self.desk.close()
        self.task.cancel()
        await asyncio.gather(self.task, return_exceptions=True)

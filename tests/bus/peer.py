"""One process of the tests: `python peer.py ROLE ROBOT RENDEZVOUS [ARGUMENT]`. Says what happens, a line each."""

import asyncio
import os
import sys
import threading

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, BlockOutcome, BlockProgress, PerformBlock
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.requests import Cancel
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.requests.ends import RequestDesk, Requester


def say(*words: object) -> None:
    print(*words, flush=True)


async def serve(bus: Bus, argument: str) -> None:
    """Perform blocks: accept, wait for `argument` seconds, done."""
    loop = asyncio.get_running_loop()
    timers: dict[str, asyncio.TimerHandle] = {}

    def end(id: str, status: str) -> None:
        say("ended", id, status)
        desk.end(BlockOutcome(id=id, block=id, status=status))  # type: ignore[arg-type]

    def cancel(cancel: Cancel) -> None:
        timers[cancel.id].cancel()
        end(cancel.id, "interrupted")

    desk = RequestDesk(bus, "realizer", cancel)
    with bus.subscribe(*RequestDesk.patterns("realizer")) as inbox:
        bus.declare_alive()
        say("stands")
        async for received in inbox:
            match desk.take(received):
                case PerformBlock(id=id):
                    desk.accept(id)
                    say("accepted", id)
                    timers[id] = loop.call_later(float(argument), end, id, "done")
                case Cancel() as request:
                    cancel(request)


async def ask(bus: Bus, argument: str) -> None:
    """Ask for block `argument` and say how it ended."""
    bus.declare_alive()
    async with Requester(bus) as requests:
        pending = requests.send(keys.BLOCK, PerformBlock(id=argument, requester="client", block=Block(id=argument)))
        say("sent", argument)
        try:
            await pending.accepted
            say("accepted")
            say("outcome", (await pending.outcome).status)  # type: ignore[attr-defined]
        except EngageError as error:
            say("failed", error.fault.reason)


async def tell(bus: Bus, argument: str) -> None:
    """Publish `argument` events and an outcome as the very last thing before leaving."""
    for number in range(int(argument)):
        bus.publish(keys.FEEDBACK, BlockProgress(block=str(number), progress="start", at=bus.stamp()))
    bus.publish(keys.request_state("realizer"), BlockOutcome(id="last", block="last", status="done"))


async def remark(bus: Bus, argument: str) -> None:
    """Publish one event, with its instant, and stay."""
    bus.publish(keys.FEEDBACK, BlockProgress(block="b", progress="start", at=bus.stamp()))
    await idle(bus, argument)


async def idle(bus: Bus, argument: str) -> None:
    bus.declare_alive()
    say("stands")
    await asyncio.Event().wait()


ROLES = {
    "serve": (serve, "realizer"),
    "ask": (ask, "client"),
    "tell": (tell, "teller"),
    "remark": (remark, "remarker"),
    "idle": (idle, "idler"),
}
FAR = 12345.0
"""Seconds that another machine's clock is ahead."""


async def main(role: str, robot: str, rendezvous: str, argument: str = "") -> None:
    run, name = ROLES[role]
    async with await open_hub(robot, rendezvous=rendezvous) as hub:
        await run(hub.join(name), argument)
        say("leaves", "with", threading.active_count(), "thread")


class FarLoop(asyncio.SelectorEventLoop):
    """The clock of another machine."""

    def time(self) -> float:
        return super().time() + FAR


if __name__ == "__main__":
    loop_factory = FarLoop if os.environ.get("FAR_CLOCK") else asyncio.SelectorEventLoop
    with asyncio.Runner(loop_factory=loop_factory) as runner:
        runner.run(main(*sys.argv[1:]))

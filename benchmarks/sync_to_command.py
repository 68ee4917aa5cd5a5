"""From a sync point to the command it releases: body -> bus -> realizer -> bus -> body, beside raw Zenoh.

    python benchmarks/sync_to_command.py [--laps 10] [--trips 100] [--chain 10] [--inside] [--json]

This process plays the body, another one is the realizer. A block is a chain of speeches, each synchronized with
the end of the one before. A trip begins when the body publishes `SyncPointReached` of an end, and is over when the
next `PerformBehavior` has come. It contains, at the realizer: the Petri net's step, the feedback about it, and the
new request. The first row is a raw Zenoh ping-pong of the same payload between two processes, in the same run.

The last row is the honest trip: the same, while recognition serves on that bus and a client follows the feedback, the
sync points, the actions and the connection events, each in a process of its own.

In the row before it realizer and body are in one process, as with `engage up --together realizer,control`: what they
say to one another goes in memory, and over Zenoh to such a client in another process.

With `--inside` there is one process and a bus in memory: what is left is the realizer; in the second row with
recognition and such a client, which take their turns on the same loop. And the memory that it keeps for each of 100
live blocks, as `tracemalloc` counts it.
"""

import argparse
import asyncio
import gc
import itertools
import json
import sys
import tracemalloc
from functools import partial
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bus_roundtrip import BusPings, RawPings, connected, free_endpoint, serve_bus, serve_raw
from benchmarks.harness import Contender, OtherSide, compare, report, stands
from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Constraint, Speech, Synchronize
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.body import (
    BehaviorOutcome,
    Estimate,
    EstimateBehaviors,
    Estimates,
    PerformBehavior,
    Phase,
    SyncPointReached,
)
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.commandline.shell.process import run, run_until_signal
from engage_hri.services.console.follow import following
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.service import recognize
from engage_hri.services.requests.ends import RequestDesk, Requester
from engage_hri.services.runtime.service import Ready, Service, running, serve

ROBOT = "benchmark"
NATURAL: Seconds = 0.001


def chain(id: str, links: int) -> Block:
    """Speeches, each starting when the one before has ended. Each block has a voice of its own."""
    speeches = tuple(Speech(id=f"{id}-{number}", text="go") for number in range(links))
    ties = tuple(
        Constraint(operators=(Synchronize(syncs=(f"{before.id}:end", after.id + ":start")),))
        for before, after in itertools.pairwise(speeches)
    )
    return Block(id=id, behaviors=speeches, constraints=ties)


def estimate(question: Message) -> Message:
    assert isinstance(question, EstimateBehaviors)
    phase = Phase(since="start", to="end", shortest=NATURAL, natural=NATURAL)
    items = (
        Estimate(
            behavior=item.behavior.id, feasible=True, parts=(item.behavior.id.rpartition("-")[0],), phases=(phase,)
        )
        for item in question.items
    )
    return Estimates(items=tuple(items))


class Body:
    """Performs every behavior in no time, and measures how soon the next one is asked for."""

    def __init__(self, bus: Bus, links: int, name: str = "sync point -> realizer -> next command") -> None:
        self.name = name
        self._bus = bus
        self._links = links
        self._blocks = itertools.count()
        self._desk = RequestDesk(bus, "control", lambda cancel: None)
        self._requests = Requester(bus)
        self._inbox = bus.subscribe(*RequestDesk.patterns("control"), *Requester.PATTERNS[:1])
        bus.answer(keys.ESTIMATE, estimate)
        bus.declare_alive()

    async def lap(self, count: int) -> list[Seconds]:
        seconds: list[Seconds] = []
        while len(seconds) < count:
            seconds += await self._play(min(self._links, count - len(seconds)))
        return seconds

    async def _play(self, count: int) -> list[Seconds]:
        """One block, `count` trips."""
        block = chain(f"block-{next(self._blocks)}", count + 1)
        request = PerformBlock(id=block.id, requester=self._bus.name, block=block)
        pending = self._requests.send(keys.BLOCK, request)
        seconds: list[Seconds] = []
        reached: Seconds | None = None
        while not pending.outcome.done():
            received = await self._inbox.next()
            assert received is not None
            self._requests.feed(received)
            command = self._desk.take(received)
            if isinstance(command, PerformBehavior):
                if reached is not None:
                    seconds.append(perf_counter() - reached)
                reached = self._perform(command)
        outcome = pending.outcome.result()
        assert isinstance(outcome, BlockOutcome), outcome
        assert outcome.status == "done", outcome
        assert len(seconds) == count, f"{len(seconds)} of {count}"
        return seconds

    def _perform(self, command: PerformBehavior) -> Seconds:
        self._desk.accept(command.id)
        self._reach(command, "start")
        reached = perf_counter()
        self._reach(command, "end")
        self._desk.end(
            BehaviorOutcome(
                id=command.id, block=command.block, behavior=command.behavior.id, status="done", at=self._bus.stamp()
            )
        )
        return reached

    def _reach(self, command: PerformBehavior, sync: str) -> None:
        now = self._bus.stamp()
        self._bus.publish(
            keys.SYNC_POINT,
            SyncPointReached(
                id=command.id, block=command.block, behavior=command.behavior.id, sync=sync, at=now, arrived=now
            ),
        )


async def serve_realizer(endpoint: str) -> None:
    async with await open_hub(ROBOT, listen=[endpoint]) as hub:
        await serve(hub, "realizer", REALIZER, stands)


async def serve_recognition(endpoints: str) -> None:
    """endpoints: its own, and that of the realizer."""
    own, *others = endpoints.split(",")
    async with await open_hub(ROBOT, listen=[own], connect=others) as hub:
        await serve(hub, "recognition", RECOGNITION, stands)


async def serve_client(endpoints: str) -> None:
    """endpoints: its own, that of the realizer, and that of recognition."""
    own, *others = endpoints.split(",")
    async with await open_hub(ROBOT, listen=[own], connect=others) as hub:
        await serve(hub, "client", client, stands)


async def client(bus: Bus, ready: Ready) -> None:
    """Follow all that a manager or a console follows."""
    async with following(bus, (lambda message, at: None,)):
        ready()
        await asyncio.get_running_loop().create_future()


REALIZER = partial(realize, config=RealizerConfig())
RECOGNITION = partial(recognize, config=RecognitionConfig())
TOGETHER = "the same, both in one process, and a client"
HONEST = "the same, recognition and a client listening"
SERVERS = {
    "raw": serve_raw, "bus": serve_bus, "realizer": serve_realizer, "recognition": serve_recognition,
    "client": serve_client,
}  # fmt: skip


async def measure(laps: int, trips: int, links: int, as_json: bool) -> None:
    raw_end, bus_end, realizer_end, other_end, seen_end, client_end, alone_end = (free_endpoint() for _ in range(7))
    with (
        OtherSide(__file__, "raw", raw_end),
        OtherSide(__file__, "bus", bus_end),
        OtherSide(__file__, "realizer", realizer_end),
        OtherSide(__file__, "realizer", other_end),
        OtherSide(__file__, "recognition", f"{seen_end},{other_end}"),
        OtherSide(__file__, "client", f"{client_end},{other_end},{seen_end}"),
        OtherSide(__file__, "client", alone_end),
    ):
        session = await connected(raw_end)
        quiet = await open_hub(ROBOT, connect=[bus_end, realizer_end])
        honest = await open_hub(ROBOT, connect=[other_end, seen_end, client_end])
        together = await open_hub(ROBOT, listen=[free_endpoint()], connect=[alone_end])
        async with quiet, honest, together, running(together, {"realizer": REALIZER}):
            bus = quiet.join("this")
            await _all_there(bus, 2)
            await _all_there(honest.join("this"), 3)
            await _all_there(together.join("this"), 2)
            places = ((quiet,), (together, TOGETHER), (honest, HONEST))
            bodies = [Body(hub.join("control"), links, *name) for hub, *name in places]
            contenders: list[Contender] = [RawPings(session), BusPings(bus), *bodies]
            report(await compare(contenders, laps, trips), as_json)
        session.close()  # type: ignore[no-untyped-call]


async def _all_there(bus: Bus, others: int) -> None:
    with bus.subscribe(keys.ANY_ALIVE) as who:
        for _ in range(others):
            await who.next()


async def measure_inside(laps: int, trips: int, links: int, as_json: bool) -> None:
    listeners: dict[str, Service] = {"realizer": REALIZER, "recognition": RECOGNITION, "client": client}
    async with (
        MemoryHub(decodes=False) as quiet,
        running(quiet, {"realizer": REALIZER}),
        MemoryHub(decodes=False) as honest,
        running(honest, listeners),
    ):
        bodies = [Body(quiet.join("control"), links), Body(honest.join("control"), links, HONEST)]
        report(await compare(bodies, laps, trips), as_json)
    for behaviors in (3, 50):
        size = await memory_per_block(behaviors)
        print(json.dumps({"live_block_kB": size, "behaviors": behaviors}) if as_json else
              f"a live block of {behaviors} behaviors keeps {size:.1f} kB")  # fmt: skip


async def memory_per_block(behaviors: int, blocks: int = 100) -> float:
    """kB that a realizer keeps for a block whose first behavior runs: plan, authority, tasks, requests."""
    config = RealizerConfig(stall=3600.0)
    # A bus keeps messages encoded, for those who come late: they are not the realizer's.
    async with MemoryHub() as hub, running(hub, {"realizer": partial(realize, config=config)}):
        bus = hub.join("control")
        desk, requests = RequestDesk(bus, "control", lambda cancel: None), Requester(bus)
        bus.answer(keys.ESTIMATE, estimate)
        bus.declare_alive()
        with bus.subscribe(*RequestDesk.patterns("control"), *Requester.PATTERNS[:1]) as inbox:
            sizes = []
            for lap in range(2):  # The first one pays for what all blocks share.
                gc.collect()
                tracemalloc.start()
                for number in range(blocks):
                    block = chain(f"block-{lap}-{number}", behaviors)
                    requests.send(keys.BLOCK, PerformBlock(id=block.id, requester=bus.name, block=block))
                begun = 0
                while begun < blocks:
                    received = await inbox.next()
                    assert received is not None
                    requests.feed(received)
                    if isinstance(command := desk.take(received), PerformBehavior):
                        desk.accept(command.id)
                        begun += command.block.startswith(f"block-{lap}-")  # Slow machines: others go on meanwhile.
                await asyncio.sleep(0.1)
                gc.collect()
                ours = [tracemalloc.Filter(True, "*/services/realizer/*"), tracemalloc.Filter(True, "*/asyncio/*")]
                kept = tracemalloc.take_snapshot().filter_traces(ours)
                sizes.append(sum(each.size for each in kept.statistics("filename")))
                tracemalloc.stop()
        requests.close()
        desk.close()
    return sizes[-1] / blocks / 1000


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laps", type=int, default=10)
    parser.add_argument("--trips", type=int, default=100)
    parser.add_argument("--chain", type=int, default=10, help="trips in a block")
    parser.add_argument("--inside", action="store_true", help="one process, a bus in memory")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--serve", nargs=2, metavar=("ROLE", "ENDPOINT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        role, endpoint = options.serve
        run_until_signal(SERVERS[role](endpoint))
    elif options.inside:
        run(measure_inside(options.laps, options.trips, options.chain, options.json))
    else:
        run(measure(options.laps, options.trips, options.chain, options.json))


if __name__ == "__main__":
    main()

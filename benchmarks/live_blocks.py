"""How many blocks one realizer performs at once: from a sync point to the command it releases, by their number.

    python benchmarks/live_blocks.py [--blocks 10 50 100 200 300 400 600] [--repeat 3] [--no-gc] [--json]

One process, a bus in memory, real time. Each block is three speeches of one second, each tied to the end of the one
before, so that a block gives two trips: the body publishes `SyncPointReached` of an end, and the trip is over when
the next `PerformBehavior` of that block has come. The body's own work is part of what the process does.

The blocks start either spread evenly over a second, or all in one instant: then every end is due in one instant, too,
and the 99th percentile is the time that the whole burst takes.

    callback    the longest single callback of the event loop, of processor time, without the collection of garbage
    garbage     the longest collection, which stops the loop as well: it grows with what all live blocks keep
    CPU         of the process, from the first request to the last outcome, and the share of one core that it is
"""

import argparse
import asyncio
import gc
import json
import sys
from functools import partial
from pathlib import Path
from time import perf_counter, process_time

from msgspec import Struct, field, structs

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.harness import percentile
from benchmarks.measuring import SteppedLoop
from benchmarks.sync_to_command import chain
from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BlockOutcome, PerformBlock
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
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.requests.ends import RequestDesk, Requester
from engage_hri.services.runtime.service import running

NATURAL: Seconds = 1.0
SPEECHES = 3
COUNTS = (10, 50, 100, 200, 300, 400, 600)


class Row(Struct):
    """Milliseconds of the trips; seconds of the rest."""

    blocks: int
    start: str
    p50_ms: float
    p99_ms: float
    callback_ms: float
    garbage_ms: float
    all_done: float
    cpu: float
    share: float


class Voices(Struct):
    """A body with a voice for every block, each of which takes the time that it says."""

    bus: Bus
    desk: RequestDesk
    trips: list[Seconds] = field(default_factory=list)
    ended: dict[str, Seconds] = field(default_factory=dict)
    """Of each block, when the last end was published."""

    def perform(self, command: PerformBehavior) -> None:
        if (before := self.ended.pop(command.block, None)) is not None:
            self.trips.append(perf_counter() - before)
        self.desk.accept(command.id)
        self._reach(command, "start")
        asyncio.get_running_loop().call_later(NATURAL, self._end, command)

    def _end(self, command: PerformBehavior) -> None:
        self.ended[command.block] = perf_counter()
        self._reach(command, "end")
        self.desk.end(
            BehaviorOutcome(
                id=command.id, block=command.block, behavior=command.behavior.id, status="done", at=self.bus.stamp()
            )
        )

    def _reach(self, command: PerformBehavior, sync: str) -> None:
        now = self.bus.stamp()
        self.bus.publish(
            keys.SYNC_POINT,
            SyncPointReached(
                id=command.id, block=command.block, behavior=command.behavior.id, sync=sync, at=now, arrived=now
            ),
        )


def estimate(question: Message) -> Message:
    assert isinstance(question, EstimateBehaviors)
    phase = Phase(since="start", to="end", shortest=NATURAL, natural=NATURAL)
    return Estimates(
        items=tuple(
            Estimate(behavior=item.behavior.id, feasible=True, parts=("voice",), phases=(phase,))
            for item in question.items
        )
    )


async def measure(blocks: int, over: Seconds) -> Row:
    """over: seconds within which the blocks start."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, SteppedLoop)
    async with MemoryHub() as hub, running(hub, {"realizer": partial(realize, config=RealizerConfig())}):
        bus = hub.join("control")
        desk, requests = RequestDesk(bus, "control", lambda cancel: None), Requester(bus)
        voices = Voices(bus, desk)
        bus.answer(keys.ESTIMATE, estimate)
        bus.declare_alive()
        patterns = dict.fromkeys((*RequestDesk.patterns("control"), *Requester.PATTERNS))
        with bus.subscribe(*patterns) as inbox:

            async def listen() -> None:
                async for received in inbox:
                    requests.feed(received)
                    if isinstance(command := desk.take(received), PerformBehavior):
                        voices.perform(command)

            listening = asyncio.create_task(listen())
            began, spent = loop.time(), process_time()
            pending = []
            for number in range(blocks):
                await asyncio.sleep(max(0.0, began + over * number / blocks - loop.time()))
                block = chain(f"block-{number}", SPEECHES)
                request = PerformBlock(id=block.id, requester=bus.name, block=block)
                pending.append(requests.send(keys.BLOCK, request))
            outcomes = await asyncio.gather(*(each.outcome for each in pending))
            taken, cpu = loop.time() - began, process_time() - spent
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)
        requests.close()
        desk.close()
    assert all(isinstance(each, BlockOutcome) and each.status == "done" for each in outcomes), outcomes
    assert len(voices.trips) == blocks * (SPEECHES - 1)
    return Row(
        blocks,
        "spread" if over else "at once",
        p50_ms=1000 * percentile(voices.trips, 50),
        p99_ms=1000 * percentile(voices.trips, 99),
        callback_ms=1000 * loop.longest,
        garbage_ms=1000 * loop.longest_collection,
        all_done=taken,
        cpu=cpu,
        share=cpu / taken,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--blocks", type=int, nargs="+", default=COUNTS)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--no-gc", action="store_true", help="without the collection of garbage")
    options = parser.parse_args()
    if options.no_gc:
        gc.disable()
    if not options.json:
        print(f"{'blocks':>6} {'start':8}{'p50 ms':>8}{'p99 ms':>8}{'callback ms':>13}{'garbage ms':>12}"
              f"{'all done s':>12}{'CPU s':>8}{'of a core':>11}")  # fmt: skip
    for over in (1.0, 0.0):
        for blocks in options.blocks:
            for _ in range(options.repeat):
                gc.collect()
                with asyncio.Runner(loop_factory=SteppedLoop) as runner:
                    row = runner.run(measure(blocks, over))
                if options.json:
                    print(json.dumps(structs.asdict(row)), flush=True)
                else:
                    print(f"{row.blocks:>6} {row.start:8}{row.p50_ms:>8.1f}{row.p99_ms:>8.1f}{row.callback_ms:>13.1f}"
                          f"{row.garbage_ms:>12.1f}{row.all_done:>12.2f}{row.cpu:>8.2f}{row.share:>11.0%}",
                          flush=True)  # fmt: skip


if __name__ == "__main__":
    main()

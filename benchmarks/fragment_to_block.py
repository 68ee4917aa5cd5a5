"""From a fragment with references to its block: time, processor time by part, and the longest step of each loop.

    python benchmarks/fragment_to_block.py [--against DIR] [--counts 1 3 10 20] [--laps 3] [--trips 10]
                                           [--how process bus load] [--table tangram hundred] [--json]

A trip begins when the fragment is sent and is over when its block has come to the realizer. Before each, every piece
of the table is moved a little, so that nothing that was worked out for the trip before is of use.

    process   generation and control in one process, a bus in memory
    bus       each of them a process of its own, and Zenoh between them
    load      a whole robot in one process, with 10 people whose heads and places come 30 times a second; the fragment
              is performed, and given up a second after its block has begun

    tangram   ten pieces; phrases are proposed from what the world knows, and reliability is that of the configuration
    hundred   a hundred pieces; ten phrases each, and so ambiguous that more gestures can win

A step is what a loop does between two looks at what else is due, in processor time, garbage collections aside; the
longest of all laps is told, and how many took more than 3 ms. CPU is that of the measuring process for a trip.
`--against DIR` measures the code of another work tree as well, lap by lap beside this one, and prints ratios:

    git worktree add ../before 05c1e04; python benchmarks/fragment_to_block.py --against ../before
"""

import argparse
import asyncio
import json
import os
import random
import subprocess
import sys
from collections import defaultdict
from collections.abc import AsyncIterator, Callable, Iterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from functools import partial
from itertools import count
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

sys.path.append(str(Path(__file__).resolve().parents[1]))  # behind PYTHONPATH, which names the measured tree

from msgspec.structs import replace

from benchmarks.bus_roundtrip import free_endpoint
from benchmarks.harness import percentile, stands
from benchmarks.measuring import Measurer, SteppedLoop, Stopwatch
from benchmarks.reference_policy import references, table
from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import FragmentBehavior, Reference, Speech
from engage_hri.schemas.blocks import BlockOutcome, BlockProgress, PerformBlock
from engage_hri.schemas.fragments import PerformFragment, TurnFragment
from engage_hri.schemas.participants import PeerAlive
from engage_hri.schemas.perception import HeadPose
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus, Hub
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.service import embody
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.service import generate
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.service import recognize
from engage_hri.services.requests.ends import RequestDesk, Requester
from engage_hri.services.runtime.service import Service, running
from engage_hri.services.simulation.still import table_world

HERE = Path(__file__).resolve().parents[1]
ROBOT = "measured"
COUNTS = (1, 3, 10, 20)
PEOPLE, HERTZ = 10, 30.0
SERVICES: dict[str, Service] = {
    "generation": partial(generate, config=GenerationConfig(decision_patience=0.001)),
    "control": partial(embody, config=ControlConfig()),
    "realizer": partial(realize, config=RealizerConfig()),
    "recognition": partial(recognize, config=RecognitionConfig()),
}
PARTS = (
    ("codec", "engage_hri.services.bus.memory", ("encode", "decode", "published")),
    ("estimates", "engage_hri.services.control.serving.questions", ("Questions.estimate", "Questions._estimated")),
    ("choice", "engage_hri.services.generation.pipeline", ("choose", "weigh", "unasked", "choice")),
    ("phrases", "engage_hri.services.generation.pipeline", ("proposed",)),
    ("block", "engage_hri.services.generation.pipeline", ("Emission.plan", "Emission.__init__")),
)  # fmt: skip
"""Parts of a trip in one process, and the functions that make them up, as far as the measured code has them."""


# -- what is asked for ---------------------------------------------------------------------------------------------


def moved(world: World, chance: random.Random) -> World:
    """Every piece a little elsewhere."""

    def shifted(entity: Entity) -> Entity:
        x, y, z = entity.position
        return replace(entity, position=(x + chance.uniform(-0.005, 0.005), y + chance.uniform(-0.005, 0.005), z))

    return World(entities=tuple(shifted(each) if each.kind == "object" else each for each in world.entities))


def asked(number: int, world: World, which: str) -> tuple[Reference, ...]:
    """So many references; more than there are pieces go round."""
    if which == "hundred":
        return references(number, world)
    ids = [entity.id for entity in world.objects]
    return tuple(Reference(id=f"ref-{each}", target=ids[each % len(ids)]) for each in range(number))


class Trips:
    """Sends fragments, and takes their blocks as the realizer, or beside the one there is."""

    def __init__(self, client: Bus, realizer: Bus | None, which: str, number: int) -> None:
        self._bus, self._realizer = client, realizer
        self._requests = Requester(client)
        self._which, self._number = which, number
        self._world = table() if which == "hundred" else table_world()
        self._chance = random.Random(number)
        self._names = count()
        self.steps: list[dict[str, Any]] = []
        self._inbox = (realizer or client).subscribe(
            *(RequestDesk.patterns("realizer") if realizer else (keys.BLOCK, keys.FEEDBACK))
        )
        self._desk = RequestDesk(realizer, "realizer", lambda cancel: None) if realizer else None
        self._answers = client.subscribe(*Requester.PATTERNS)
        self._feeding = asyncio.create_task(self._feed())

    async def _feed(self) -> None:
        async for received in self._answers:
            self._requests.feed(received)

    async def close(self) -> None:
        self._requests.close()
        self._feeding.cancel()
        await asyncio.gather(self._feeding, return_exceptions=True)

    async def set_up(self) -> None:
        """Show a table that nobody has seen, and wait until the robot has looked at it."""
        self._bus.publish(keys.WORLD, moved(self._world, self._chance))
        await asyncio.sleep(0.05)

    async def trip(self) -> Seconds:
        id = f"fragment-{next(self._names)}"
        behaviors: tuple[FragmentBehavior, ...] = (
            Speech(id="s", text="Take"),
            *asked(self._number, self._world, self._which),
        )
        fragment = TurnFragment(id=id, addressee="human", behaviors=behaviors)
        request = PerformFragment(id=id, requester=self._bus.name, fragment=fragment)
        began = perf_counter()
        pending = self._requests.send(keys.FRAGMENT, request)
        taken = await self._block(id) - began
        if self._realizer is None:
            self.note("to block")
            await self._begun(id)
            await asyncio.sleep(1.0)
            self.note("to a second later")
            self._requests.cancel(id, "measured")
        with suppress(Exception):
            await pending.outcome
        return taken

    def note(self, until: str) -> None:
        """Note the longest step of this loop up to here, and begin anew."""
        loop = asyncio.get_running_loop()
        assert isinstance(loop, SteppedLoop)
        self.steps.append({"service": until, "longest": loop.longest, "long": loop.long, "what": loop.what})
        loop.forget()

    async def _block(self, id: str) -> Seconds:
        async for received in self._inbox:
            request = self._desk.take(received) if self._desk else received.message
            if isinstance(request, PerformBlock):
                arrived = perf_counter()
                if self._desk:
                    self._desk.accept(request.id)
                    self._desk.end(BlockOutcome(id=request.id, block=request.block.id, status="done"))
                if request.block.id == id:
                    return arrived
        raise RuntimeError("the bus is closed")

    async def _begun(self, id: str) -> None:
        async for received in self._inbox:
            if isinstance(received.message, BlockProgress) and received.message.block == id:
                return


# -- the three ways ------------------------------------------------------------------------------------------------


@asynccontextmanager
async def served(endpoint: str, *names: str) -> AsyncIterator[tuple[list[dict[str, Any]], Callable[[], None]]]:
    """Services in processes of their own. At the end the list holds what each says of its steps.

    The function has them forget the steps so far.
    """
    said: list[dict[str, Any]] = []
    command = (sys.executable, __file__, "--serve")
    others = [
        await asyncio.create_subprocess_exec(*command, name, endpoint, stdout=subprocess.PIPE, stdin=subprocess.PIPE)
        for name in names
    ]

    def forget() -> None:
        for other in others:
            assert other.stdin is not None
            other.stdin.write(b"forget\n")

    try:
        for other in others:
            assert other.stdout is not None
            await other.stdout.readline()
        yield said, forget
    finally:
        for name, other in zip(names, others, strict=True):
            out, _ = await other.communicate(b"enough\n")
            said.append({"service": name, **json.loads(out or "{}")})


async def serve_one(name: str, endpoint: str) -> None:
    """Serve in this process until a line says that it is enough; then say what the loop has seen."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, SteppedLoop)
    told = asyncio.Event()
    async with await open_hub(ROBOT, connect=[endpoint]) as hub, running(hub, {name: SERVICES[name]}):
        loop.add_reader(sys.stdin, lambda: loop.forget() if sys.stdin.readline() == "forget\n" else told.set())
        stands()
        await told.wait()
        print(json.dumps({"longest": loop.longest, "long": loop.long, "what": loop.what}), flush=True)
        os._exit(0)  # closing would wait for the others


async def crowd(bus: Bus, world: World) -> None:
    """Heads of many people and their places, as often as a camera sees them."""
    for turn in count():
        bodies = []
        for person in range(PEOPLE):
            place = (1.3 + person / 10, (person - PEOPLE / 2) / 4 + 0.002 * (turn % 50), 1.2)
            head = HeadPose(
                actor=f"visitor-{person}", position=place, direction=(-1.0, 0.1 * (turn % 5), 0.0), at=bus.stamp()
            )
            bus.publish(keys.head_pose(head.actor), head)
            bodies.append(Entity(id=head.actor, kind="person", position=place))
        bus.publish(keys.WORLD, World(entities=(*world.entities, *bodies)))
        await asyncio.sleep(1 / HERTZ)


async def measured(how: str, which: str, number: int, trips: int, watch: Stopwatch) -> dict[str, Any]:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, SteppedLoop)
    async with AsyncExitStack() as stack:
        said, forget = list[dict[str, Any]](), loop.forget
        if how == "bus":
            endpoint = free_endpoint()
            hub: Hub = await stack.enter_async_context(await open_hub(ROBOT, listen=[endpoint]))
            others = served(endpoint, "generation", "control")
            said, forget = await stack.enter_async_context(others)
        else:
            hub = await stack.enter_async_context(MemoryHub())
        client = hub.join("client", "manager")
        realizer = None if how == "load" else hub.join("realizer", "realizer")
        there = client.subscribe(keys.ANY_ALIVE)
        names = {"process": ("generation", "control"), "load": tuple(SERVICES), "bus": ()}[how]
        await stack.enter_async_context(running(hub, {name: SERVICES[name] for name in names}))
        for bus in filter(None, (client, realizer)):
            bus.declare_alive()
        seen: set[str] = set()
        while not {"generation", "control"} <= seen:
            received = await there.next()
            assert received is not None
            if isinstance(received.message, PeerAlive):
                seen.add(received.message.participant)
        there.close()
        fragments = Trips(client, realizer, which, number)
        if how == "load":
            looking = asyncio.create_task(crowd(client, table_world()))
            stack.callback(looking.cancel)
        for _ in range(2 if how != "load" else 0):
            await fragments.set_up()
            await fragments.trip()
        taken, cpu = list[Seconds](), list[Seconds]()
        parts: dict[str, list[Seconds]] = defaultdict(list)
        forget()
        for _ in range(trips):
            if how != "load":
                await fragments.set_up()
            watch.spent.clear()
            if how == "load":
                loop.forget()
            since = process_time()
            taken.append(await fragments.trip())
            cpu.append(process_time() - since)
            for part, seconds in watch.spent.items():
                parts[part].append(seconds)
        await fragments.close()
        if how == "process":
            fragments.note("all")
    return {"taken": taken, "cpu": cpu, "parts": parts, "steps": fragments.steps + said}


# -- this work tree and another, in turns --------------------------------------------------------------------------


def obey() -> None:
    """Measure what each line of the standard input asks for, until there is no more."""
    watch = Stopwatch()
    watch.install(PARTS)
    stands()
    for line in sys.stdin:
        with asyncio.Runner(loop_factory=SteppedLoop) as runner:
            how, which, number, trips = json.loads(line)
            print(json.dumps(runner.run(measured(how, which, number, trips, watch))), flush=True)


def summed_up(laps: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Milliseconds of all laps together."""
    taken = [each for lap in laps for each in lap["taken"]]
    parts: dict[str, list[Seconds]] = defaultdict(list)
    for lap in laps:
        for part, seconds in lap["parts"].items():
            parts[part] += seconds
    steps = [step for lap in laps for step in lap["steps"]]
    row: dict[str, Any] = {"least": min(taken), "p50": percentile(taken, 50), "p99": percentile(taken, 99)}
    row["CPU"] = median(each for lap in laps for each in lap["cpu"])
    row |= {part: median(parts[part]) for part, _, _ in PARTS if part in parts}
    for service in dict.fromkeys(step["service"] for step in steps):
        row[f"step {service}"] = max(step["longest"] for step in steps if step["service"] == service)
    row = {name: round(1000 * seconds, 2) for name, seconds in row.items()}
    return {**row, "long": sum(step["long"] for step in steps), "what": max(steps, key=_length)["what"]}


def _length(step: dict[str, Any]) -> Seconds:
    length: Seconds = step["longest"]
    return length


def ratios(before: dict[str, Any], now: dict[str, Any]) -> Iterator[str]:
    for name, value in before.items():
        if isinstance(value, float) and now.get(name):
            yield f"{name} {value / now[name]:.1f}x"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--against", type=Path, metavar="DIR")
    parser.add_argument("--counts", type=int, nargs="+", default=COUNTS)
    parser.add_argument("--how", nargs="+", choices=("process", "bus", "load"), default=("process", "bus", "load"))
    parser.add_argument("--table", nargs="+", choices=("tangram", "hundred"), default=("tangram", "hundred"))
    parser.add_argument("--laps", type=int, default=3)
    parser.add_argument("--trips", type=int, default=10)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--obey", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--serve", nargs=2, metavar=("SERVICE", "ENDPOINT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.obey:
        obey()
    elif options.serve:
        with asyncio.Runner(loop_factory=SteppedLoop) as runner:
            runner.run(serve_one(*options.serve))
    else:
        compare(options)


def compare(options: argparse.Namespace) -> None:
    """Measure each case, of each work tree in turns, and print a row for each."""
    trees = {"before": options.against.resolve(), "now": HERE} if options.against else {"now": HERE}
    measurers = {name: Measurer(__file__, tree) for name, tree in trees.items()}
    cases = [
        (how, which, number)
        for how in options.how
        for which in (options.table if how != "load" else ("tangram",))
        for number in options.counts
    ]
    for how, which, number in cases:
        laps: dict[str, list[dict[str, Any]]] = {name: [] for name in measurers}
        for _ in range(options.laps):
            for name, measurer in measurers.items():
                laps[name].append(measurer.measure(how, which, number, 3 if how == "load" else options.trips))
        rows = {name: summed_up(each) for name, each in laps.items()}
        if options.json:
            print(json.dumps({"how": how, "table": which, "references": number, **rows}), flush=True)
            continue
        print(f"{how}, {which}, {number} reference{'s' if number > 1 else ''}: milliseconds")
        for name, row in rows.items():
            print(f"  {name:7}" + ", ".join(f"{each} {value}" for each, value in row.items()), flush=True)
        if options.against:
            print("  ratio  " + ", ".join(ratios(rows["before"], rows["now"])), flush=True)
    for measurer in measurers.values():
        measurer.close()


if __name__ == "__main__":
    main()

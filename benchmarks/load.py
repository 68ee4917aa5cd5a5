"""A robot under load: how long a command takes, what memory the robot takes, and what is dropped, load by load.

    python benchmarks/load.py [--seconds 10] [--loads LOAD ...] [--json]

A robot with a process for each service plays the tangram by itself, in real time. All are clients of a router, as
across machines. Four times a second this process has it perform a block that moves nothing, and waits for its end:
that is the command, from client to realizer and back. Loads, one at a time, each followed by a pause, the first is
none:

- slow watcher: it follows all that a person can watch, and takes one message in 0.1 s;
- frozen watcher: the same, stopped by SIGSTOP as soon as it is there, and let go on at the end;
- 50 watchers, each with a session of its own, in one process;
- 10 people, heads of whom a camera sees, 30 times a second each;
- 10,000 fragments asked for at once, and withdrawn at the end.

Memory is that of the robot's processes and of the router (proportional share), before and after a load. Linux only.
"""

import argparse
import asyncio
import json
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import AsyncIterator, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from itertools import count
from pathlib import Path
from statistics import median
from time import perf_counter
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bus_roundtrip import free_endpoint
from benchmarks.harness import percentile, stands
from benchmarks.robots_per_machine import family, megabytes
from engage_hri.schemas import keys
from engage_hri.schemas.access import WATCHED
from engage_hri.schemas.behaviors import Speech, Wait
from engage_hri.schemas.blocks import Block, PerformBlock
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.fragments import PerformFragment, TurnFragment
from engage_hri.schemas.participants import AskStatus, Status
from engage_hri.schemas.perception import HeadPose
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.commandline.shell.process import run, run_until_signal
from engage_hri.services.requests.ends import Requester

ROBOT = "loaded"
SERVICES = ("generation", "realizer", "recognition", "control")
LOADS = ("none", "slow watcher", "frozen watcher", "50 watchers", "10 people", "10,000 fragments")
PAUSE: Seconds = 3.0
PERIOD: Seconds = 0.25


@asynccontextmanager
async def started(*arguments: str) -> AsyncIterator[int]:
    """A command of ours that goes on; its process id."""
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "engage_hri", *arguments, stdout=subprocess.DEVNULL
    )
    try:
        yield process.pid
    finally:
        if process.returncode is None:
            process.terminate()
        await process.wait()


# -- what loads it, each in a process of its own ------------------------------------------------------------------


async def watch(endpoint: str, watchers: int, period: Seconds) -> None:
    """Follow everything with so many sessions; each takes a message no sooner than `period` after the last."""
    async with AsyncExitStack() as stack:
        hubs = [await stack.enter_async_context(await _hub(endpoint)) for _ in range(watchers)]
        buses = [hub.join(f"watcher-{number}", "observer") for number, hub in enumerate(hubs)]
        inboxes = [bus.subscribe(*WATCHED, keys.WORLD) for bus in buses]
        stands()
        taken = [0] * watchers

        async def read(number: int) -> None:
            async for _ in inboxes[number]:
                taken[number] += 1
                await asyncio.sleep(period)

        try:
            await asyncio.gather(*map(read, range(watchers)))
        finally:
            health = [bus.health for bus in buses]
            dropped = sum(each.overflowed + each.dropped for each in health)
            _report({"taken": sum(taken), "dropped": dropped, "lost": sum(each.lost for each in health)})


async def people(endpoint: str, number: int, period: Seconds) -> None:
    """Publish the heads of so many people, each as often as a camera does."""
    async with await _hub(endpoint) as hub:
        bus = hub.join("camera", "perception")
        bus.declare_alive()
        stands()
        sent, began = 0, asyncio.get_running_loop().time()
        try:
            for turn in count(1):
                for person in range(number):
                    actor, at = f"visitor-{person}", bus.stamp()
                    place = (1.0 + person / 10, (person - number / 2) / 4, 1.2)
                    head = HeadPose(actor=actor, position=place, direction=(-1.0, 0.1 * (turn % 5), 0.0), at=at)
                    bus.publish(keys.head_pose(actor), head)
                    sent += 1
                await asyncio.sleep(max(0.0, began + turn * period - asyncio.get_running_loop().time()))
        finally:
            _report({"heads": sent})


async def fragments(endpoint: str, number: int, period: Seconds) -> None:
    """Ask for so many fragments at once."""
    async with await _hub(endpoint) as hub:
        bus = hub.join("talkative", "manager")
        async with Requester(bus) as requests:
            bus.declare_alive()
            stands()
            asked = []
            for each in range(number):
                fragment = TurnFragment(id=f"talk-{each}", behaviors=(Speech(id=f"s{each}", text="well"),))
                request = PerformFragment(id=fragment.id, requester=bus.name, fragment=fragment)
                asked.append(requests.send(keys.FRAGMENT, request))
                if not each % 100:
                    await asyncio.sleep(0)
            try:
                await asyncio.wait([each.outcome for each in asked])
                await asyncio.get_running_loop().create_future()
            finally:
                ends = Counter("live" if not each.outcome.done() else _end(each.outcome) for each in asked)
                _report(dict(ends))


def _end(outcome: "asyncio.Future[Any]") -> str:
    error = outcome.exception()
    return getattr(outcome.result(), "status", "done") if error is None else type(error).__name__


def _report(counts: dict[str, int]) -> None:
    print(json.dumps(counts), flush=True)


async def _hub(endpoint: str) -> ZenohHub:
    return await open_hub(ROBOT, connect=[endpoint])


BURDENS = {
    "slow watcher": (watch, 1, 0.1),
    "frozen watcher": (watch, 1, 0.0),
    "50 watchers": (watch, 50, 0.0),
    "10 people": (people, 10, 1 / 30),
    "10,000 fragments": (fragments, 10_000, 0.0),
}

# -- what is measured ---------------------------------------------------------------------------------------------


async def probe(bus: Bus, requests: Requester, seconds: Seconds, numbers: "count[int]") -> list[Seconds]:
    """Times of commands during so many seconds."""
    loop, taken = asyncio.get_running_loop(), list[Seconds]()
    ends = loop.time() + seconds
    while loop.time() < ends:
        block = Block(id=f"probe-{next(numbers)}", behaviors=(Wait(id="w", duration=0.0),))
        began = perf_counter()
        request = PerformBlock(id=block.id, requester=bus.name, block=block)
        await asyncio.wait_for(requests.send(keys.BLOCK, request).outcome, 30.0)
        taken.append(perf_counter() - began)
        await asyncio.sleep(max(0.0, PERIOD - taken[-1]))
    return taken


async def healths(bus: Bus) -> dict[str, Status]:
    found = {}
    for name in SERVICES:
        try:
            answer = await bus.query(keys.status(name), AskStatus(), 5.0)
        except EngageError:
            continue
        if isinstance(answer, Status):
            found[name] = answer
    return found


def drops(states: dict[str, Status]) -> int:
    return sum(each.bus.dropped + each.bus.overflowed + each.bus.lost for each in states.values())


async def measure(loads: Sequence[str], seconds: Seconds, as_json: bool) -> None:
    endpoint, numbers, first = free_endpoint(), count(1), 0.0
    async with (
        started("router", "--listen", endpoint) as router,
        started("up", "--task", "--quiet", "--robot", ROBOT, "--connect", endpoint) as services,
        await _hub(endpoint) as hub,
    ):
        bus = hub.join("prober", "manager")
        async with Requester(bus) as requests:
            bus.declare_alive()
            await probe(bus, requests, 5.0, numbers)
            for load in loads:
                before, dropped = _megabytes(services, router), drops(await healths(bus))
                row = {"load": load, **await _under(load, endpoint, bus, requests, seconds, numbers)}
                first = first or row["p50 ms"]
                row |= {"p50 ratio": round(row["p50 ms"] / first, 2)}
                await asyncio.sleep(PAUSE)
                after = _megabytes(services, router)
                row |= {"robot dropped": drops(await healths(bus)) - dropped}
                row |= {"MB of robot and router": f"{before[0]:.0f} {before[1]:.0f}",
                        "after": f"{after[0]:.0f} {after[1]:.0f}"}  # fmt: skip
                print(json.dumps(row) if as_json else "; ".join(f"{each} {row[each]}" for each in row), flush=True)


def _megabytes(services: int, router: int) -> tuple[float, float]:
    return megabytes(family(services), "Pss"), megabytes(family(router), "Pss")


async def _under(
    load: str, endpoint: str, bus: Bus, requests: Requester, seconds: Seconds, numbers: "count[int]"
) -> dict[str, Any]:
    """Commands under a load, and what the load says of itself."""
    if load not in BURDENS:
        return _times(await probe(bus, requests, seconds, numbers))
    command = (sys.executable, __file__, "--serve", load, endpoint)
    other = await asyncio.create_subprocess_exec(*command, stdout=subprocess.PIPE)
    assert other.stdout is not None
    await other.stdout.readline()
    if load == "frozen watcher":
        other.send_signal(signal.SIGSTOP)
    try:
        taken = await probe(bus, requests, seconds, numbers)
    finally:
        other.send_signal(signal.SIGCONT)
        other.terminate()
        said = await other.stdout.readline()
        other.kill()  # Zenoh takes seconds to close each of many sessions in one process.
        await other.wait()
    return {**_times(taken), **json.loads(said or "{}")}


def _times(taken: list[Seconds]) -> dict[str, Any]:
    return {
        "commands": len(taken),
        "p50 ms": round(1000 * median(taken), 1),
        "p99 ms": round(1000 * percentile(taken, 99), 1),
        "longest ms": round(1000 * max(taken), 1),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--loads", nargs="*", choices=LOADS, default=LOADS)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--serve", nargs=2, metavar=("LOAD", "ENDPOINT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        load, endpoint = options.serve
        burden, number, period = BURDENS[load]
        run_until_signal(burden(endpoint, number, period))
    else:
        run(measure(options.loads, options.seconds, options.json))


if __name__ == "__main__":
    main()

"""Robots that run on one machine and one router, each with a manager that talks: memory, processor time, delay.

    python benchmarks/robots_per_machine.py [--robots 10] [--seconds 20] [--way processes] [--watchers 0] [--json]

All robots of a run start first, and are looked at while nobody speaks to them. Then each has a manager that performs
one fragment and one block of speeches that wait for one another, again and again without pause; the managers are in
one further process. `--watchers`: so many clients, a hundred in a process and spread over the robots, follow the sync
points and connection events of their robot meanwhile; told are the fewest and the most messages that one has got.
Processor time is that of all processes of a robot between two looks, as the kernel counts it. Memory is what is
resident (Rss), and the proportional share (Pss): what several processes have in common counts once. The delay is from
the sync point that ends a speech to the command for the next one, by the times at which the robot sent them, which
uvloop tells in whole milliseconds. What was not done is told on standard error. Linux only.
"""

import argparse
import asyncio
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import AsyncExitStack, ExitStack
from pathlib import Path
from statistics import mean

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bus_roundtrip import free_endpoint
from benchmarks.harness import percentile
from engage_hri.schemas import keys
from engage_hri.schemas.body import PerformBehavior, SyncPointReached
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.messages import decode
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Tap
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.robot import Robot
from engage_hri.services.commandline.shell.process import run
from engage_hri.services.commandline.shell.roster import ROBOT

TICKS = os.sysconf("SC_CLK_TCK")
WAYS = {
    "processes": (),
    "pair": ("--together", "realizer,control"),
    "in-one": ("--in-one",),
}
TOGETHER = 100
"""Watchers of one process."""
SETTLE: Seconds = 2.0
ROUND: Seconds = 4.0
"""Time that one fragment and one block take."""
FRAGMENT = {"turn_status": "full", "parts": [{"say": "One moment please, I am going to have a look."}]}
CHAIN = """<bml id="{id}"><speech id="s0"><text>Well.</text></speech>
<speech id="s1" start="s0:end"><text>Well.</text></speech>
<speech id="s2" start="s1:end"><text>Well.</text></speech></bml>"""


def family(pid: int) -> list[int]:
    """A process and all that descend from it."""
    found = [pid]
    for each in found:
        for task in Path(f"/proc/{each}/task").iterdir():
            found += map(int, (task / "children").read_text().split())
    return found


def processor_seconds(pids: list[int]) -> Seconds:
    """Time that the processes have computed so far, in user and system mode."""
    fields = [Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split() for pid in pids]
    return sum(int(each[11]) + int(each[12]) for each in fields) / TICKS


def megabytes(pids: list[int], what: str) -> float:
    """Memory of the processes. what: `Rss` or `Pss`."""
    lines = (line for pid in pids for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines())
    return sum(int(line.split()[1]) for line in lines if line.startswith(f"{what}:")) / 1024


def percent(pids: list[int], seconds: float) -> float:
    """Processor time of the next seconds, in percent of a core."""
    before, began = processor_seconds(pids), time.monotonic()
    time.sleep(seconds)
    return 100 * (processor_seconds(pids) - before) / (time.monotonic() - began)


def name(number: int) -> str:
    return f"measured-{number}"


def measure(way: str, robots: int, seconds: float, watchers: int = 0) -> dict[str, float]:
    """Start a router and the robots, look, let the managers talk, and look again."""
    engage, endpoint = [sys.executable, "-m", "engage_hri"], free_endpoint()
    with ExitStack() as stack:

        def start(*command: str, errors: int | None = subprocess.DEVNULL) -> "subprocess.Popen[str]":
            process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors, text=True)
            stack.callback(process.wait)
            stack.callback(process.terminate)
            return process

        def heard(process: "subprocess.Popen[str]", text: str) -> str:
            assert process.stdout is not None
            for line in process.stdout:
                if text in line:
                    return line
            raise RuntimeError(f"{process.args!r} ended without {text!r}")

        router = start(*engage, "router", "--listen", endpoint)
        began = time.monotonic()
        where = ("--connect", endpoint, "--mode", "client")
        all_up = [start(*engage, "up", "--robot", name(one), *where, *WAYS[way]) for one in range(robots)]
        for each in all_up:
            heard(each, "all services are up")
        up = time.monotonic() - began
        time.sleep(3.0)
        families = [family(each.pid) for each in all_up]
        pids = [pid for each in families for pid in each]
        idle = percent(pids, min(seconds, 10.0))
        firsts = range(0, watchers, TOGETHER)
        counts = [str(min(TOGETHER, watchers - first)) for first in firsts]
        crowd = [
            start(sys.executable, __file__, "--follow", endpoint, str(robots), str(first), count, errors=None)
            for first, count in zip(firsts, counts, strict=True)
        ]
        for each in crowd:
            heard(each, "there")
        managers = start(sys.executable, __file__, "--talk", endpoint, str(robots), str(seconds), errors=None)
        heard(managers, "talking")
        time.sleep(ROUND)
        before = processor_seconds(family(router.pid))
        talking = percent(pids, seconds)
        routed = 100 * (processor_seconds(family(router.pid)) - before) / seconds
        told = json.loads(heard(managers, "{"))
        if crowd:
            time.sleep(SETTLE)
            for each in crowd:
                each.terminate()
            got = [number for each in crowd for number in json.loads(heard(each, "["))]
            told |= {"watchers": watchers, "least_heard": min(got), "most_heard": max(got)}
        return {
            "robots": robots, "processes": len(pids) / robots, "all_up_s": up,
            "idle_percent": idle / robots, "talking_percent": talking / robots, "router_percent": routed / robots,
            "Rss_MB": mean(megabytes(each, "Rss") for each in families),
            "Pss_MB": mean(megabytes(each, "Pss") for each in families),
            "router_MB": megabytes(family(router.pid), "Rss"), **told,
        }  # fmt: skip


async def follow(endpoint: str, robots: int, first: int, count: int) -> None:
    """Be watchers, and tell how many messages each has got when told to end."""
    heard = [0] * count
    ended = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)

    async def listen(number: int, tap: Tap) -> None:
        async for _ in tap:
            heard[number] += 1

    async with AsyncExitStack() as stack:
        for number in range(count):
            robot = name((first + number) % robots)
            hub = await stack.enter_async_context(await open_hub(robot, connect=[endpoint], mode="client"))
            watcher = hub.join(f"watcher-{first + number}")
            tap = stack.enter_context(watcher.tap(keys.SYNC_POINT, keys.ANY_CONNECTION_EVENT))
            stack.callback(asyncio.create_task(listen(number, tap)).cancel)
        print("there", flush=True)
        await ended.wait()
    print(json.dumps(heard), flush=True)


async def talk(endpoint: str, robots: int, seconds: Seconds) -> None:
    """Be the managers of all robots, and tell on standard output what became of it."""
    delays: list[Seconds] = []
    ends = {"done": 0, "not_done": 0}
    async with AsyncExitStack() as stack:
        buses = []
        for number in range(robots):
            hub = await stack.enter_async_context(await open_hub(name(number), connect=[endpoint], mode="client"))
            buses.append(hub.join("manager"))
            with buses[-1].subscribe(keys.ANY_ALIVE) as who:
                missing = {*ROBOT}
                while missing:
                    received = await who.next()
                    assert received is not None
                    missing.discard(getattr(received.message, "participant", ""))
        watching = [asyncio.create_task(watch(bus, delays)) for bus in buses]
        print("talking", flush=True)
        async with asyncio.TaskGroup() as group:
            for number, bus in enumerate(buses):
                # Real managers do not begin in one instant: they are spread over about the time of one round.
                wait = ROUND * number / robots
                group.create_task(manage(bus, wait, bus.now() + wait + seconds, ends))
        for task in watching:
            task.cancel()
    known = {f"p{p}_ms": 1000 * percentile(delays, p) for p in (50, 99)}
    print(json.dumps({**ends, "delays": len(delays), **known, "worst_ms": 1000 * max(delays)}), flush=True)


async def manage(bus: Bus, wait: Seconds, until: Seconds, ends: dict[str, int]) -> None:
    await asyncio.sleep(wait)
    async with Robot.on(bus) as robot:
        number = 0
        while bus.now() < until:
            for work in (robot.perform(FRAGMENT), robot.realize(CHAIN.format(id=f"chain-{number}"))):
                try:
                    async with asyncio.timeout(60.0):
                        status: str = (await work).status
                except (EngageError, TimeoutError) as error:
                    status = str(error)
                ends["done" if status == "done" else "not_done"] += 1
                if status != "done":
                    print(bus.robot, status, file=sys.stderr)
            number += 1


async def watch(bus: Bus, delays: list[Seconds]) -> None:
    """Note how soon each speech of a chain is asked for after the one before has ended."""
    ended: dict[tuple[str, str], Seconds] = {}
    with bus.tap(keys.SYNC_POINT, keys.BEHAVIOR) as tap:
        async for sample in tap:
            match decode(sample.payload, sample.encoding):
                case SyncPointReached(block=block, behavior=behavior, sync="end") if block.startswith("chain-"):
                    ended[block, f"s{int(behavior[1:]) + 1}"] = sample.sent
                case PerformBehavior(block=block, behavior=each) if (block, each.id) in ended:
                    delays.append(sample.sent - ended.pop((block, each.id)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=10)
    parser.add_argument("--seconds", type=float, default=20.0, help="between two looks")
    parser.add_argument("--way", choices=WAYS, action="append", help="may be repeated; without it all of them")
    parser.add_argument("--watchers", type=int, default=0)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--follow", nargs=4, metavar=("ENDPOINT", "ROBOTS", "FIRST", "COUNT"), help=argparse.SUPPRESS)
    parser.add_argument("--talk", nargs=3, metavar=("ENDPOINT", "ROBOTS", "SECONDS"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.talk:
        endpoint, robots, seconds = options.talk
        run(talk(endpoint, int(robots), float(seconds)))
        return
    if options.follow:
        endpoint, *numbers = options.follow
        run(follow(endpoint, *map(int, numbers)))
        return
    for way in options.way or WAYS:
        found = measure(way, options.robots, options.seconds, options.watchers)
        if options.json:
            print(json.dumps({"way": way, **found}))
        else:
            print(f"{way:10}", "  ".join(f"{key} {value:.4g}" for key, value in found.items()), flush=True)


if __name__ == "__main__":
    main()

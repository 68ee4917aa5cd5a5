"""Clients that come to one robot at once, and leave at once: what each costs the router, and how the robot goes on.

    python benchmarks/joining.py [--clients 1 10 50 100 200 500 1000] [--keys] [--json]

A router and the four services, each a process. For each number so many clients of `connect()` come at once, in
processes of a hundred, wait until they see all services, and go at once. Beside them one more client has short blocks
performed, one after the other. An idle link costs the router the same all the time, for both ends say that they are
there. So the processor time for those who come and go is what is left once idle links and the blocks, looked at
before and in between, are taken off: else a client would cost more the longer a busy machine takes. The last column
says by how much the share of a client, who comes and who goes, has grown for each doubling of their number.

`--keys`: all have certificates, and a hundred clients share one. Linux only.
"""

import argparse
import asyncio
import json
import subprocess
import sys
import tempfile
import time
from contextlib import AsyncExitStack, ExitStack
from math import log2
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bus_roundtrip import free_endpoint
from benchmarks.robots_per_machine import family, megabytes, processor_seconds
from benchmarks.visitors import started
from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Wait
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.keyring import Keys, read_keys
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell.process import run

ROBOT = "robot"
TOGETHER = 100
"""Clients of one process, and of one certificate: a router gives one no more links."""
PATIENCE: Seconds = 300.0
SETTLE: Seconds = 2.0
LOOK: Seconds = 4.0


async def comes(stack: AsyncExitStack, endpoint: str, own: Keys | None, name: str) -> None:
    """Come as a client, and return once all services are in sight."""
    hub = await open_hub(ROBOT, connect=[endpoint], mode="client", keys=own)
    stack.push_async_callback(hub.close)
    await stack.enter_async_context(connect(hub=hub, name=name))
    until = asyncio.get_running_loop().time() + PATIENCE
    while {*keys.SERVICES} - hub.peers.names.keys():
        if not await hub.peers.change(until):
            raise TimeoutError(name)


async def crowd(endpoint: str, ring: str, first: int, count: int) -> None:
    """Come when told to by a line of standard input, tell it, and go at the next line."""
    own = read_keys(ring, f"crowd{first // TOGETHER}") if ring else None
    loop, reader = asyncio.get_running_loop(), asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    print("ready", flush=True)
    await reader.readline()
    async with AsyncExitStack() as stack:
        await asyncio.gather(*(comes(stack, endpoint, own, f"c{first + each}") for each in range(count)))
        print("there", flush=True)
        await reader.readline()
    print("gone", flush=True)


async def performs(robot: Robot, took: list[Seconds], lost: list[str]) -> None:
    """Have blocks performed until cancelled, and note how long each takes, and what went wrong."""
    while True:
        began = time.perf_counter()
        try:
            outcome = await robot.realize(Block(id="b", behaviors=(Wait(id="w", duration=0.1),)), timeout=30.0)
            if outcome.status != "done":
                lost.append(outcome.status)
        except Exception as error:
            lost.append(str(error))
        took.append(time.perf_counter() - began)


async def upkeep(pids: list[int]) -> float:
    """Processor time a second while nobody comes or goes: of links that are idle, and of the blocks."""
    before, began = processor_seconds(pids), time.perf_counter()
    await asyncio.sleep(LOOK)
    return (processor_seconds(pids) - before) / (time.perf_counter() - began)


def crowded(*arguments: str) -> subprocess.Popen[str]:
    """Start a process of clients."""
    command = [sys.executable, __file__, *arguments]
    return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


async def told(children: list[subprocess.Popen[str]], order: str, answer: str) -> None:
    for child in children:
        assert child.stdin is not None
        child.stdin.write(f"{order}\n")
        child.stdin.flush()
    await asyncio.to_thread(_answers, children, answer)


def _answers(children: list[subprocess.Popen[str]], answer: str) -> None:
    for child in children:
        assert child.stdout is not None
        line = child.stdout.readline()
        if line.strip() != answer:
            raise RuntimeError(f"a crowd said {line!r} instead of {answer!r}")


async def measure(numbers: list[int], *, with_keys: bool) -> list[dict[str, Any]]:
    rows: list[dict[str, Any]] = []
    with ExitStack() as stack:
        ring: list[str] = []
        endpoint = free_endpoint()
        if with_keys:
            from engage_hri.services.bus.certificates import initialize

            ring = ["--keys", stack.enter_context(tempfile.TemporaryDirectory()) + "/keys"]
            crowds = [("manager", f"crowd{each}") for each in range(-(-max(numbers) // TOGETHER))]
            initialize(Path(ring[1]), ROBOT, crowds, (), 1)
            endpoint = endpoint.replace("tcp/", "tls/")
        engage = (sys.executable, "-m", "engage_hri")
        router = started(stack, "router is ready", *engage, "router", "--listen", endpoint, *ring)
        for each in keys.SERVICES:
            started(stack, f"{each} is ready", *engage, "run", each, "--mode", "client", "--connect", endpoint, *ring)
        own = read_keys(ring[1], "manager") if ring else None
        pids = family(router)
        hub = await open_hub(ROBOT, connect=[endpoint], mode="client", keys=own)
        async with hub, connect(hub=hub, name="beside") as robot:
            took: list[Seconds] = []
            lost: list[str] = []
            performing = asyncio.create_task(performs(robot, took, lost))
            try:
                for number in numbers:
                    options = ["--crowd", endpoint, "".join(ring[1:])]
                    parts = [(first, min(TOGETHER, number - first)) for first in range(0, number, TOGETHER)]
                    children = [crowded(*options, str(first), str(count)) for first, count in parts]
                    await asyncio.to_thread(_answers, children, "ready")
                    without = await upkeep(pids)
                    took.clear()
                    before, began = processor_seconds(pids), time.perf_counter()
                    await told(children, "come", "there")
                    coming = time.perf_counter() - began
                    # What has come is still being told to others.
                    await asyncio.sleep(SETTLE)
                    there = processor_seconds(pids)
                    idle, memory = await upkeep(pids), megabytes(pids, "Rss")
                    staying, began = processor_seconds(pids), time.perf_counter()
                    await told(children, "go", "gone")
                    leaving = time.perf_counter() - began
                    await asyncio.sleep(SETTLE)
                    gone = processor_seconds(pids)
                    for child in children:
                        child.wait()
                    # The number of links grows, and falls, about evenly.
                    half = (idle + without) / 2
                    rows.append(
                        {
                            "clients": number, "seconds": coming, "leaving": leaving,
                            "router": there - before - coming * half - SETTLE * idle,
                            "router_leaving": gone - staying - leaving * half - SETTLE * without,
                            "idle": idle - without, "all_coming": there - before, "all_leaving": gone - staying,
                            "MB": memory, "blocks": len(took), "slowest": max(took), "lost": len(lost),
                            "restarted": family(router) != pids,
                        }
                    )  # fmt: skip
                    print(json.dumps(rows[-1]), file=sys.stderr, flush=True)
            finally:
                performing.cancel()
    return rows


def grown(before: dict[str, Any], now: dict[str, Any], what: str) -> float:
    """Factor by which the share of a client has grown for each doubling of their number."""
    share, was = now[what] / now["clients"], before[what] / before["clients"]
    doublings = log2(now["clients"] / before["clients"])
    return float((share / was) ** (1 / doublings)) if share > 0.0 and was > 0.0 else float("nan")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--clients", type=int, nargs="+", default=[1, 10, 50, 100, 200, 500, 1000])
    parser.add_argument("--keys", action="store_true")
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--crowd", nargs=4, metavar=("ENDPOINT", "KEYS", "FIRST", "COUNT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.crowd:
        endpoint, ring, first, count = options.crowd
        run(crowd(endpoint, ring, int(first), int(count)))
        return
    rows = run(measure(options.clients, with_keys=options.keys))
    if options.json:
        print(json.dumps(rows))
        return
    print("clients  all there  router s  MB   gone in  router s  idle, of a core  blocks  slowest  lost  doubled")
    for before, row in zip([None, *rows], rows, strict=False):
        costs = ("router", "router_leaving")
        growth = ", ".join(f"{grown(before, row, cost):.2f}" for cost in costs) if before else ""
        print(
            f"{row['clients']:7} {row['seconds']:8.1f} s {row['router']:8.2f} {row['MB']:4.0f}"
            f" {row['leaving']:7.1f} s {row['router_leaving']:8.2f} {row['idle']:14.1%}"
            f"  {row['blocks']:7} {row['slowest']:6.2f} s"
            f" {row['lost']:5}  {growth}{'  restarted' if row['restarted'] else ''}"
        )


if __name__ == "__main__":
    main()

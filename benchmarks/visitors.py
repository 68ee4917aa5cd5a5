"""Clients that come and go: what each leaves behind in the processes of a robot, and what of that is Zenoh's own.

    python benchmarks/visitors.py [--visitors 1000] [--json]

A router and the four services, each a process, all clients of the router. Visitors come one after the other, and go:
those of `connect()`, who ask nothing; those who have a block performed; and plain Zenoh sessions, which show two
tokens of the same length and run no line of ours, seen by a process that does nothing but listen for them, which runs
none either. Memory is private memory (RssAnon), after as many visitors of the kind as were counted then. Linux only.
"""

import argparse
import asyncio
import json
import subprocess
import sys
from collections.abc import Callable, Coroutine
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import zenoh

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bus_roundtrip import free_endpoint
from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Wait
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.zenoh.session import open_client
from engage_hri.services.client.robot import connect
from engage_hri.services.commandline.shell.process import run

ROBOT = "visited"
SERVICES = ("control", "realizer", "recognition", "generation")
SETTLES: Seconds = 3.0
Visit = Callable[[str], Coroutine[Any, Any, None]]


def started(stack: ExitStack, ready: str, *command: str) -> int:
    """Start a process that ends with the stack; returns its id once it has printed that line."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    stack.callback(process.wait)
    stack.callback(process.kill)
    assert process.stderr is not None
    for line in process.stderr:
        if ready in line:
            return process.pid
    raise RuntimeError(f"{command} did not start")


def private(process: int) -> int:
    """Private memory of a process and its children, in bytes."""
    status = Path(f"/proc/{process}/status").read_text()
    own = 1024 * int(next(line for line in status.splitlines() if line.startswith("RssAnon")).split()[1])
    return own + sum(map(private, map(int, Path(f"/proc/{process}/task/{process}/children").read_text().split())))


async def comes(endpoint: str) -> None:
    async with connect(ROBOT, connect=[endpoint], mode="client"):
        pass


async def asks(endpoint: str) -> None:
    async with connect(ROBOT, connect=[endpoint], mode="client") as robot:
        await robot.realize(Block(id="b", behaviors=(Wait(id="w", duration=0.02),)))


async def plain(endpoint: str) -> None:
    session: Any = await open_client("others", [endpoint])
    run, name = str(session.zid()), f"client-{str(session.zid())[:8]}"
    tokens = [
        session.liveliness().declare_token(keys.own(run, subject))
        for subject in (f"alive/client/{name}/{run}", "log/commands")
    ]
    for token in tokens:
        token.undeclare()
    session.close()


VISITORS: dict[str, Visit] = {
    "comes and goes": comes,
    "has a block performed": asks,
    "plain Zenoh, two tokens": plain,
}


async def listen(endpoint: str) -> None:
    """Serve as the process that only listens for tokens."""
    session: Any = await open_client("others", [endpoint])
    session.liveliness().declare_subscriber(
        keys.ANY_OWN, zenoh.handlers.Callback(lambda sample: None, indirect=False)
    )
    print("stands", file=sys.stderr, flush=True)
    await asyncio.get_running_loop().create_future()


async def measure(visitors: int) -> dict[str, dict[str, float]]:
    """Bytes that a visitor leaves behind, by kind and process."""
    endpoint = free_endpoint()
    engage = (sys.executable, "-m", "engage_hri")
    with ExitStack() as stack:
        processes = {"router": started(stack, "router is ready", *engage, "router", "--listen", endpoint)}
        where = ("--robot", ROBOT, "--connect", endpoint, "--mode", "client")
        for name in SERVICES:
            processes[name] = started(stack, f"{name} is ready", *engage, "run", name, *where)
        processes["listener"] = started(stack, "stands", sys.executable, __file__, "--serve", endpoint)
        left: dict[str, dict[str, float]] = {}
        for kind, visit in VISITORS.items():
            seen: list[dict[str, int]] = []
            for count in (visitors // 10, visitors):  # the first show only what a process takes once
                for _ in range(count):
                    await visit(endpoint)
                await asyncio.sleep(SETTLES)
                seen.append({name: private(process) for name, process in processes.items()})
            left[kind] = {name: (seen[1][name] - seen[0][name]) / visitors for name in processes}
        return left


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--visitors", type=int, default=1000)
    options.add_argument("--json", action="store_true")
    options.add_argument("--serve", help=argparse.SUPPRESS)
    given = options.parse_args()
    if given.serve:
        asyncio.run(listen(given.serve))
        return
    left = run(measure(given.visitors))
    if given.json:
        print(json.dumps(left))
        return
    names = list(next(iter(left.values())))
    print("kB that a visitor leaves behind")
    print(f"{'':26}", *(f"{name:>12}" for name in names))
    for kind, row in left.items():
        print(f"{kind:26}", *(f"{row[name] / 1000:12.1f}" for name in names))


if __name__ == "__main__":
    main()

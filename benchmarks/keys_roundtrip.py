"""There and back with keys and without: our bus between two processes, directly and through routers, in one run.

    python benchmarks/keys_roundtrip.py [--laps 10] [--trips 200] [--json]

A command goes there, a sync point comes back, as between realizer and control. The yardstick is the open router.
"""

import argparse
import asyncio
import sys
import tempfile
from contextlib import AsyncExitStack, ExitStack
from pathlib import Path
from time import perf_counter

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.bus_roundtrip import CHEER, free_endpoint
from benchmarks.harness import Contender, OtherSide, compare, report, stands
from engage_hri.schemas import keys
from engage_hri.schemas.access import ROUTER
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Hub
from engage_hri.services.bus.keyring import read_keys
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.bus.zenoh.router import routing
from engage_hri.services.bus.zenoh.rules import access_control
from engage_hri.services.bus.zenoh.session import encrypted, open_router
from engage_hri.services.commandline.shell.process import run, run_until_signal

PING_KEY = keys.command(keys.BEHAVIOR, "realizer", "realizer")
PONG_KEY = keys.SYNC_POINT
OPEN, DIRECT = "open router", "no router, open"
ENCRYPTED, QUIET, CLOSED = "router, TLS", "router, TLS and rules, refusals not told", "router, TLS and rules"
WITH_KEYS = (ENCRYPTED, QUIET, CLOSED)


class Pings:
    """Our bus, at both ends."""

    def __init__(self, name: str, bus: Bus) -> None:
        self.name = name
        self._bus = bus
        self._inbox = bus.subscribe(PONG_KEY)

    async def lap(self, count: int) -> list[Seconds]:
        seconds = []  # not by the loop's clock: that of uvloop has whole milliseconds
        for _ in range(count):
            sent = perf_counter()
            self._bus.publish(PING_KEY, CHEER)
            await self._inbox.next()
            seconds.append(perf_counter() - sent)
        return seconds


async def hub_of(kind: str, holder: str, endpoint: str, ring: str) -> Hub:
    if kind == DIRECT:
        listens = holder == "control"
        return await open_hub("robot", listen=[endpoint] * listens, connect=[endpoint] * (not listens), mode="peer")
    own = read_keys(ring, holder) if kind in WITH_KEYS else None
    return await open_hub("robot", connect=[endpoint], mode="client", keys=own)


async def serve(kind: str, endpoint: str, ring: str) -> None:
    async with await hub_of(kind, "control", endpoint, ring) as hub:
        bus = hub.join("control", "control")
        with bus.subscribe(keys.commands("control")) as inbox:
            bus.declare_alive()
            stands()
            async for _ in inbox:
                bus.publish(PONG_KEY, CHEER)


async def route(kind: str, endpoint: str, ring: str) -> None:
    def tell(line: str) -> None:
        print(line, file=sys.stderr)

    if kind in (ENCRYPTED, QUIET):  # what `engage router` never does: to tell what costs how much
        own = read_keys(ring, ROUTER)
        rules = {"access_control": access_control(own.holders())} if kind == QUIET else {}
        session = open_router((), [endpoint], {**encrypted(own), **rules})
        stands()
        await asyncio.Event().wait()
        session.close()  # type: ignore[no-untyped-call]
    async with routing([endpoint], [], tell, read_keys(ring, ROUTER) if kind == CLOSED else None):
        stands()
        await asyncio.Event().wait()


async def measure(laps: int, trips: int, as_json: bool) -> None:
    from engage_hri.services.bus.certificates import initialize

    with ExitStack() as processes, tempfile.TemporaryDirectory() as folder:
        ring = str(Path(folder, "keys"))
        initialize(Path(ring), "robot", (), (), 1)
        async with AsyncExitStack() as hubs:
            contenders: list[Contender] = []
            for kind in (OPEN, *WITH_KEYS, DIRECT):
                port = free_endpoint().rpartition(":")[2]
                endpoint = f"{'tls' if kind in WITH_KEYS else 'tcp'}/127.0.0.1:{port}"
                if kind != DIRECT:
                    processes.enter_context(OtherSide(__file__, f"route {kind}", endpoint, ring))
                processes.enter_context(OtherSide(__file__, f"serve {kind}", endpoint, ring))
                hub = await hubs.enter_async_context(await hub_of(kind, "realizer", endpoint, ring))
                bus = hub.join("realizer", "realizer")
                with bus.subscribe(keys.ANY_ROBOT_ALIVE) as who:
                    await who.next()
                contenders.append(Pings(kind, bus))
            report(await compare(contenders, laps, trips), as_json)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laps", type=int, default=10)
    parser.add_argument("--trips", type=int, default=200)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--serve", nargs=3, metavar=("ROLE", "ENDPOINT", "KEYS"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        role, endpoint, ring = options.serve
        does, _, kind = role.partition(" ")
        run_until_signal({"serve": serve, "route": route}[does](kind, endpoint, ring))
    else:
        run(measure(options.laps, options.trips, options.json))


if __name__ == "__main__":
    main()

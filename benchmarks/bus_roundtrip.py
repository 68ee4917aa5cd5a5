"""There and back between two processes: raw Zenoh, Zenoh under asyncio, and our bus, in one run.

    python benchmarks/bus_roundtrip.py [--laps 10] [--trips 200] [--json]

The payload is a real one, a `SyncPointReached` of some 130 bytes. The first row is the yardstick.
"""

import argparse
import asyncio
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from time import perf_counter
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import zenoh

from benchmarks.harness import Contender, OtherSide, compare, report, stands
from engage_hri.schemas import keys
from engage_hri.schemas.body import SyncPointReached
from engage_hri.schemas.messages import encode
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.bus.zenoh.session import QOS, open_session
from engage_hri.services.commandline.shell.process import run, run_until_signal

ROBOT = "benchmark"
PING, PONG = "raw/ping", "raw/pong"
PING_KEY, PONG_KEY = keys.fault("this"), keys.fault("other")
"""Of the class that sync points have, and nobody else's."""
CHEER = SyncPointReached(
    id="block-1/point-1", block="block-1", behavior="point-1", sync="stroke_start",
    at=Stamp("boot-00000000", 1234.5678), arrived=Stamp("boot-00000000", 1234.5678),
)  # fmt: skip
PAYLOAD = encode(CHEER)


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def direct(callback: Callable[[Any], object]) -> Any:
    return zenoh.handlers.Callback(callback, indirect=False)


class RawPings:
    """Zenoh and nothing else: each callback publishes the next message."""

    name = "raw Zenoh, callbacks"

    def __init__(self, session: zenoh.Session) -> None:
        self._loop = asyncio.get_running_loop()
        self._publisher = session.declare_publisher(PING, **QOS)
        session.declare_subscriber(PONG, direct(self._pong))
        self._seconds: list[Seconds] = []
        self._left = 0

    async def lap(self, count: int) -> list[Seconds]:
        self._seconds, self._left = [], count
        self._done = self._loop.create_future()
        self._ping()
        await self._done
        return self._seconds

    def _ping(self) -> None:
        self._left -= 1
        self._sent = perf_counter()
        self._publisher.put(PAYLOAD)

    def _pong(self, sample: zenoh.Sample) -> None:
        self._seconds.append(perf_counter() - self._sent)
        if self._left:
            self._ping()
        else:
            self._loop.call_soon_threadsafe(self._done.set_result, None)


class LoopPings(RawPings):
    """The same, but this side and the other answer from their loops, as a service must."""

    name = "raw Zenoh, handed to asyncio"

    def __init__(self, session: zenoh.Session) -> None:
        self._loop = asyncio.get_running_loop()
        self._publisher = session.declare_publisher("loop/ping", **QOS)
        session.declare_subscriber("loop/pong", direct(self._hand_over))

    def _hand_over(self, sample: zenoh.Sample) -> None:
        self._loop.call_soon_threadsafe(self._pong, sample)

    def _pong(self, sample: zenoh.Sample) -> None:
        self._seconds.append(perf_counter() - self._sent)
        if self._left:
            self._ping()
        else:
            self._done.set_result(None)


class BusPings:
    """Our bus: encoded, numbered, decoded, queued, awaited; at both ends."""

    name = "our bus"

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._inbox = bus.subscribe(PONG_KEY)

    async def lap(self, count: int) -> list[Seconds]:
        seconds = []
        for _ in range(count):
            sent = perf_counter()
            self._bus.publish(PING_KEY, CHEER)
            await self._inbox.next()
            seconds.append(perf_counter() - sent)
        return seconds


async def serve_raw(endpoint: str) -> None:
    session, _ = open_session(ROBOT, [], [endpoint], None)
    raw, through_loop = session.declare_publisher(PONG, **QOS), session.declare_publisher("loop/pong", **QOS)
    loop = asyncio.get_running_loop()
    session.declare_subscriber(PING, direct(lambda sample: raw.put(sample.payload)))
    session.declare_subscriber(
        "loop/ping",
        direct(lambda sample: loop.call_soon_threadsafe(through_loop.put, sample.payload)),
    )
    stands()
    await asyncio.Event().wait()


async def serve_bus(endpoint: str) -> None:
    async with await open_hub(ROBOT, listen=[endpoint]) as hub:
        bus = hub.join("other")
        with bus.subscribe(PING_KEY) as inbox:
            bus.declare_alive()
            stands()
            async for received in inbox:
                bus.publish(PONG_KEY, received.message)


SERVERS = {"raw": serve_raw, "bus": serve_bus}


async def connected(endpoint: str) -> zenoh.Session:
    """A session that reaches the raw server: its subscriptions are known."""
    session, _ = open_session(ROBOT, [endpoint], [], None)
    loop, matched = asyncio.get_running_loop(), asyncio.Event()
    probe: Any = session.declare_publisher(PING)  # its stub says that the status is a bool
    probe.declare_matching_listener(direct(lambda status: loop.call_soon_threadsafe(matched.set)))
    if not probe.matching_status.matching:
        await matched.wait()
    return session


async def measure(laps: int, trips: int, as_json: bool) -> None:
    raw_end, bus_end = free_endpoint(), free_endpoint()
    with OtherSide(__file__, "raw", raw_end), OtherSide(__file__, "bus", bus_end):
        session = await connected(raw_end)
        async with await open_hub(ROBOT, connect=[bus_end]) as hub:
            bus = hub.join("this")
            with bus.subscribe(keys.ANY_ALIVE) as who:
                await who.next()
            contenders: list[Contender] = [RawPings(session), LoopPings(session), BusPings(bus)]
            report(await compare(contenders, laps, trips), as_json)
        session.close()  # type: ignore[no-untyped-call]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--laps", type=int, default=10)
    parser.add_argument("--trips", type=int, default=200)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--serve", nargs=2, metavar=("ROLE", "ENDPOINT"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.serve:
        role, endpoint = options.serve
        run_until_signal(SERVERS[role](endpoint))
    else:
        run(measure(options.laps, options.trips, options.json))


if __name__ == "__main__":
    main()

"""Order, history and recovery: Zenoh's advanced publishers and subscribers beside our numbering (decision 0005).

    python benchmarks/bus_order.py [--rounds 20] [--only SCENARIO] [--json]

One process publishes numbered messages on several keys, another follows them all with one wildcard. A message is
overtaken when a later one of the same publisher comes before it. Each round opens fresh sessions, over TCP:

- new keys: the subscriber stands; 20 times the first message of a new key, then one of a known key;
- known keys: the same, but each key has had a message before;
- late joiner: 200 messages on 5 keys are out, within the 2 s of history, when the subscriber comes;
- joining amid: the same, and 200 more follow while it catches up;
- cut: the link is cut, 200 messages are published, the link comes back after 0.3 s.
"""

import argparse
import asyncio
import json
import sys
from collections.abc import Awaitable, Callable, Sequence
from pathlib import Path
from statistics import median
from typing import Any, Protocol

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import zenoh
import zenoh.ext
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.requests import Accepted
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.zenoh.hub import ZenohHub, open_hub
from engage_hri.services.bus.zenoh.session import QOS, open_session
from tests.bus.cable import Cable
from tests.bus.places import acquainted, free_endpoint

ROBOT = "benchmark"
PATIENCE: Seconds = 8.0
"""What has not come by then is lost."""
KNOWN = keys.fault("known")
CUT: Seconds = 0.3
"""How long; more than the first pause of Zenoh's retries, so that both sides need the second."""
WAYS = tuple(keys.fault(f"service-{number}") for number in range(20))


class Pair(Protocol):
    """A publisher and a subscriber in sessions of their own, joined by a cable."""

    name: str

    async def open(self, end: str, cable: Cable) -> None: ...

    def publish(self, key: str, number: int) -> None: ...

    async def listen(self) -> None:
        """Subscribe, and wait until the publishing side knows."""

    async def next(self, deadline: Seconds) -> int | None: ...

    async def close(self) -> None: ...


class Ours:
    name = "ours"

    async def open(self, end: str, cable: Cable) -> None:
        self._there: ZenohHub = await open_hub(ROBOT, listen=[end])
        self._here: ZenohHub = await open_hub(ROBOT, connect=[cable.endpoint])
        await acquainted(self._there, self._here)
        self._bus, self._ear = self._there.join("there"), self._here.join("here")

    def publish(self, key: str, number: int) -> None:
        self._bus.publish(key, Accepted(id=str(number)))

    async def listen(self) -> None:
        self._inbox = self._ear.subscribe(keys.ANY_FAULT)

    async def next(self, deadline: Seconds) -> int | None:
        received = await self._inbox.next(deadline)
        return None if received is None else int(received.message.id)  # type: ignore[union-attr]

    async def close(self) -> None:
        await self._here.close()
        await self._there.close()


class Advanced:
    """`zenoh.ext` as the bus would need it: cache, history of 2 s, recovery by heartbeat, late publishers found."""

    name = "zenoh.ext"

    async def open(self, end: str, cable: Cable) -> None:
        self._loop = asyncio.get_running_loop()
        self._came: asyncio.Queue[int] = asyncio.Queue()
        self._publishers: dict[str, Any] = {}
        self._there, _ = open_session(ROBOT, [], [end], None)
        self._here, _ = open_session(ROBOT, [cable.endpoint], [], None)
        linked = asyncio.Event()
        events: Any = self._direct(lambda _: linked.set())
        listener: Any = self._here.info.declare_transport_events_listener(events, history=True)
        await asyncio.wait_for(linked.wait(), PATIENCE)
        listener.undeclare()

    def _direct(self, call: Callable[[Any], None]) -> Any:
        return zenoh.handlers.Callback(lambda it: self._loop.call_soon_threadsafe(call, it), indirect=False)

    def _publisher(self, key: str) -> Any:
        if key not in self._publishers:
            self._publishers[key] = zenoh.ext.declare_advanced_publisher(
                self._there, key,
                cache=zenoh.ext.CacheConfig(4096),
                sample_miss_detection=zenoh.ext.MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.25),
                publisher_detection=True,
                **QOS,
            )  # fmt: skip
        return self._publishers[key]

    def publish(self, key: str, number: int) -> None:
        self._publisher(key).put(str(number))

    async def listen(self) -> None:
        self._subscriber: Any = zenoh.ext.declare_advanced_subscriber(
            self._here, keys.ANY_FAULT, self._direct(self._arrived),
            history=zenoh.ext.HistoryConfig(
                detect_late_publishers=True, max_age=keys.HISTORY_MAX_AGE, max_samples=4096
            ),
            recovery=zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True),
            subscriber_detection=True,
        )  # fmt: skip

    def _arrived(self, sample: zenoh.Sample) -> None:
        self._came.put_nowait(int(sample.payload.to_string()))

    async def next(self, deadline: Seconds) -> int | None:
        try:
            async with asyncio.timeout_at(deadline):
                return await self._came.get()
        except TimeoutError:
            return None

    async def close(self) -> None:
        for session in (self._here, self._there):
            session.close()  # type: ignore[no-untyped-call]


class Seen(Struct):
    """One round. seconds: from the first publication, the subscription or the cut to the last arrival."""

    overtaken: int
    lost: int
    doubled: int
    seconds: Seconds


async def follow(pair: Pair, count: int, since: Seconds) -> Seen:
    """Take what comes until all has come, or nothing more does."""
    loop = asyncio.get_running_loop()
    came: list[int] = []
    last = since
    while len(set(came)) < count and (number := await pair.next(since + PATIENCE)) is not None:
        came.append(number)
        last = loop.time()
    overtaken, highest = 0, -1
    for number in came:
        overtaken += number < highest
        highest = max(highest, number)
    return Seen(overtaken, count - len(set(came)), len(came) - len(set(came)), last - since)


Scenario = Callable[[Pair, Cable], Awaitable[Seen]]


def publish(pair: Pair, numbers: range, ways: Sequence[str]) -> None:
    for number in numbers:
        pair.publish(ways[number % len(ways)], number)


async def new_keys(pair: Pair, cable: Cable) -> Seen:
    await pair.listen()
    await stands(pair)
    return await _in_turns(pair)


async def known_keys(pair: Pair, cable: Cable) -> Seen:
    await pair.listen()
    for key in (KNOWN, *WAYS):
        await stands(pair, key)
    return await _in_turns(pair)


async def _in_turns(pair: Pair) -> Seen:
    since = asyncio.get_running_loop().time()
    for number in range(2 * len(WAYS)):
        pair.publish(KNOWN if number % 2 else WAYS[number // 2], number)
    return await follow(pair, 2 * len(WAYS), since)


async def stands(pair: Pair, key: str = KNOWN) -> None:
    """Wait until the subscription is in use: a message has come."""
    pair.publish(key, -1)
    assert await pair.next(asyncio.get_running_loop().time() + PATIENCE) == -1


async def late_joiner(pair: Pair, cable: Cable) -> Seen:
    publish(pair, range(200), WAYS[:5])
    since = asyncio.get_running_loop().time()
    await pair.listen()
    return await follow(pair, 200, since)


async def joining_amid(pair: Pair, cable: Cable) -> Seen:
    publish(pair, range(200), WAYS[:5])
    since = asyncio.get_running_loop().time()
    await pair.listen()
    for first in range(200, 400, 10):
        publish(pair, range(first, first + 10), WAYS[:5])
        await asyncio.sleep(0.001)
    return await follow(pair, 400, since)


async def cut(pair: Pair, cable: Cable) -> Seen:
    await pair.listen()
    await stands(pair)
    for key in WAYS[:5]:
        await stands(pair, key)
    since = asyncio.get_running_loop().time()
    await cable.cut()
    publish(pair, range(200), WAYS[:5])
    await asyncio.sleep(since + CUT - asyncio.get_running_loop().time())
    await cable.join()
    publish(pair, range(200, 205), WAYS[:5])
    return await follow(pair, 205, since)


SCENARIOS: dict[str, Scenario] = {
    "new keys": new_keys,
    "known keys": known_keys,
    "late joiner": late_joiner,
    "joining amid": joining_amid,
    "cut": cut,
}


async def one_round(kind: type[Ours] | type[Advanced], scenario: Scenario) -> Seen:
    pair: Pair = kind()
    end = free_endpoint()
    cable = Cable(end)
    await cable.join()
    await pair.open(end, cable)
    try:
        return await scenario(pair, cable)
    finally:
        await pair.close()
        await cable.cut()


async def measure(rounds: int, names: Sequence[str]) -> list[dict[str, Any]]:
    rows = []
    for name in names:
        taken: dict[str, list[Seen]] = {Advanced.name: [], Ours.name: []}
        for _ in range(rounds):
            for kind in (Advanced, Ours):
                taken[kind.name].append(await one_round(kind, SCENARIOS[name]))
        for who, seen in taken.items():
            rows.append(
                {
                    "scenario": name,
                    "bus": who,
                    "rounds": rounds,
                    "rounds_out_of_order": sum(one.overtaken > 0 for one in seen),
                    "overtaken": sum(one.overtaken for one in seen),
                    "lost": sum(one.lost for one in seen),
                    "doubled": sum(one.doubled for one in seen),
                    "median_ms": round(1000 * median(one.seconds for one in seen), 1),
                    "max_ms": round(1000 * max(one.seconds for one in seen), 1),
                }
            )
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=20)
    parser.add_argument("--json", action="store_true")
    parser.add_argument("--only", choices=SCENARIOS, help="one of the scenarios")
    options = parser.parse_args()
    rows = asyncio.run(measure(options.rounds, [options.only] if options.only else list(SCENARIOS)))
    if options.json:
        print(json.dumps(rows, indent=2))
        return
    print("| scenario | bus | rounds out of order | overtaken | lost | doubled | median ms | max ms |")
    print("|---|---|---|---|---|---|---|---|")
    for row in rows:
        out = f"{row['rounds_out_of_order']}/{row['rounds']}"
        rest = " | ".join(str(row[name]) for name in ("overtaken", "lost", "doubled", "median_ms", "max_ms"))
        print(f"| {row['scenario']} | {row['bus']} | {out} | {rest} |")


if __name__ == "__main__":
    main()

"""Each row of the table of access at its size and one byte more: what an independent program gets of it.

The senders are plain Zenoh, with Zenoh's own limits; the oracle is what comes to a plain Zenoh subscriber.
"""

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from itertools import chain
from typing import Any

import pytest
import pytest_asyncio
import zenoh

from engage_hri.schemas import access, keys
from engage_hri.schemas.access import OWN, Holder
from engage_hri.schemas.limits import BESIDE, LARGEST, MOST_PULSES, most
from engage_hri.services.bus.zenoh.router import routing
from engage_hri.services.bus.zenoh.session import open_router
from engage_hri.services.bus.zenoh.sizes import MOST_IN_PARTS, bounded, paced
from tests.bus.places import PATIENCE, free_endpoint

BLOCK = zenoh.CongestionControl.BLOCK
OF_THE_BUS = tuple(keys.own("e0001234", subject) for subject in ("pulse", "past", "counts", "clock", "flush"))
SENT = sorted({row.key.replace(OWN, "ann").replace("*", "ann") for row in access.TABLE if row.does != "subscribes"})


def plain(endpoint: str, **more: object) -> zenoh.Session:
    """A program that knows nothing of ours, and takes whatever comes."""
    config = zenoh.Config()
    settings = {
        "mode": "client", "connect/endpoints": [endpoint], "scouting/multicast/enabled": False, "namespace": "robot",
    }  # fmt: skip
    for key, value in {**settings, **more}.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


class Witness:
    """What comes to a plain session: key and size of each message, question and answer."""

    def __init__(self, session: zenoh.Session) -> None:
        self.session: Any = session
        self.came: list[tuple[str, str, int]] = []
        self._loop = asyncio.get_running_loop()

    def hear(self, what: str) -> Any:
        def note(item: Any) -> None:
            size = len(item.payload.to_bytes()) if item.payload else 0
            came = (what, str(item.key_expr), size)
            self._loop.call_soon_threadsafe(self.came.append, came)
            if what == "query":
                item.drop()

        return zenoh.handlers.Callback(note, indirect=False)

    async def wait(self, holds: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not holds():
                await asyncio.sleep(0.01)


@pytest_asyncio.fixture
async def sides() -> AsyncIterator[tuple[zenoh.Session, Witness]]:
    """A sender and a witness, plain Zenoh both, at a router of ours without keys."""
    endpoint = free_endpoint()
    async with routing([endpoint], (), lambda line: None):
        sender, witness = plain(endpoint), Witness(plain(endpoint))
        yield sender, witness
        sender.close()
        witness.session.close()


pytestmark = pytest.mark.real_time


async def test_each_row_is_passed_on_at_its_size_and_dropped_with_one_byte_more(
    sides: tuple[zenoh.Session, Witness],
) -> None:
    sender, witness = sides
    all_keys = (*SENT, *OF_THE_BUS)
    for pattern in ("**", f"{keys.PREFIX}/@bus/**"):
        witness.session.declare_subscriber(pattern, witness.hear("put"))
    sender.put("begun", b"")
    while not witness.came:
        sender.put("begun", b"")
        await asyncio.sleep(0.02)
    witness.came.clear()

    for key in all_keys:
        for size in (most(key) + BESIDE, most(key) + BESIDE + 1):
            sender.put(key, bytes(size), congestion_control=BLOCK)
    sender.put("over", b"", congestion_control=BLOCK)
    await witness.wait(lambda: ("put", "over", 0) in witness.came)

    came = [each for each in witness.came if each[1] not in ("begun", "over")]
    assert came == [("put", key, most(key) + BESIDE) for key in all_keys]

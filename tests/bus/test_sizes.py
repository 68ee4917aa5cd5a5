"""Each row of the table of access at its size and one byte more: what an independent program gets of it.

The senders are plain Zenoh, with Zenoh's own limits; the oracle is what comes to a plain Zenoh subscriber.
"""

import asyncio
import json
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from typing import Any

import pytest
import pytest_asyncio
import zenoh

from engage_hri.schemas import access, keys
from engage_hri.schemas.access import BESIDE, LARGEST, MOST_PULSES, OWN, Holder, most
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.bus.zenoh.router import routing
from engage_hri.services.bus.zenoh.rules import MOST_IN_PARTS, bounded, paced
from engage_hri.services.bus.zenoh.session import open_router
from tests.bus.places import PATIENCE, free_endpoint

BLOCK = zenoh.CongestionControl.BLOCK
OF_THE_BUS = tuple(
    keys.own("e0001234", subject) for subject in ("pulse/news", "past", "counts", "clock", "flush/commands")
)
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
        self.news = asyncio.Event()
        self._loop = asyncio.get_running_loop()

    def hear(self, what: str) -> Any:
        def note(item: Any) -> None:
            size = len(item.payload.to_bytes()) if item.payload else 0
            came = (what, str(item.key_expr), size)
            self._loop.call_soon_threadsafe(self._take, came)
            if what == "query":
                item.drop()

        return zenoh.handlers.Callback(note, indirect=False)

    def _take(self, came: tuple[str, str, int]) -> None:
        self.came.append(came)
        self.news.set()

    async def next(self, patience: float) -> None:
        """Wait for news, for some seconds at most: what Zenoh does with time, it does in real time."""
        self.news.clear()
        with suppress(TimeoutError):
            await asyncio.wait_for(self.news.wait(), patience)

    async def wait(self, holds: Callable[[], bool]) -> None:
        async with asyncio.timeout(PATIENCE):
            while not holds():
                await self.next(0.05)


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
    for pattern in ("**", f"{keys.PREFIX}/@bus/**", f"{keys.PREFIX}/stream/*/@sound/**"):
        witness.session.declare_subscriber(pattern, witness.hear("put"))
    sender.put("begun", b"")
    while not witness.came:
        sender.put("begun", b"")
        await witness.next(0.02)
    witness.came.clear()

    for number, key in enumerate(all_keys):
        for size in (most(key) + BESIDE + 1, most(key) + BESIDE):
            sender.put(key, bytes(size), congestion_control=BLOCK)
        sender.put(f"over/{number}", b"", congestion_control=BLOCK)
        await witness.wait(
            lambda number=number: witness.came[-1:] == [("put", f"over/{number}", 0)]
        )  # a full link is closed

    came = [each for each in witness.came if not each[1].startswith(("begun", "over/"))]
    assert came == [("put", key, most(key) + BESIDE) for key in all_keys]


async def test_questions_and_answers_are_bounded_as_their_key_is(sides: tuple[zenoh.Session, Witness]) -> None:
    sender, witness = sides
    asked = {row.key.replace(OWN, "ann").replace("*", "ann") for row in access.TABLE if row.does == "asks"}
    all_keys = sorted({*asked, *OF_THE_BUS})
    heard: list[tuple[str, int]] = []
    answers: list[tuple[str, int]] = []
    ends: list[str] = []

    def reply(query: zenoh.Query) -> None:
        heard.append((str(query.key_expr), len(query.payload.to_bytes()) if query.payload else 0))
        query.reply(query.key_expr, bytes(int(query.parameters.get("size") or 0)))
        query.drop()  # type: ignore[no-untyped-call]

    def answered(got: zenoh.Reply) -> None:
        if got.ok is not None:
            answers.append((str(got.ok.key_expr), len(got.ok.payload.to_bytes())))

    def ask(key: str, question: int, answer: int, patience: float = PATIENCE) -> None:
        handler = zenoh.handlers.Callback(answered, lambda: ends.append(key), indirect=False)
        sender.get(f"{key}?size={answer}", handler, payload=bytes(question), timeout=patience)

    for key in all_keys:
        witness.session.declare_queryable(key, zenoh.handlers.Callback(reply, indirect=False))
    ask(all_keys[-1], 0, 0, PATIENCE / 20)
    while not answers:
        await witness.wait(lambda: bool(ends))
        ends.clear()
        ask(all_keys[-1], 0, 0, PATIENCE / 20)
    await witness.wait(lambda: bool(ends))
    for list_of in (heard, answers, ends):
        list_of.clear()  # type: ignore[attr-defined]

    for key in all_keys:
        most_of_all = most(key) + BESIDE
        for number, (question, answer) in enumerate(((most_of_all, 0), (0, most_of_all)), 1):
            ask(key, question, answer)  # one after the other: a link that is full for long is closed
            await witness.wait(lambda key=key, number=number: [each[0] for each in answers].count(key) == number)
        for question, answer in ((most_of_all + 1, 0), (0, most_of_all + 1)):
            ask(key, question, answer, PATIENCE / 20)
    await witness.wait(lambda: len(ends) == 4 * len(all_keys))

    assert sorted(heard) == sorted((key, size) for key in all_keys for size in (0, 0, most(key) + BESIDE))
    assert sorted(answers) == sorted((key, size) for key in all_keys for size in (0, most(key) + BESIDE))


async def test_what_is_in_no_row_has_the_greatest_bound_and_never_closes_the_link(
    sides: tuple[zenoh.Session, Witness],
) -> None:
    sender, witness = sides
    witness.session.declare_subscriber("**", witness.hear("put"))
    while not witness.came:
        sender.put("begun", b"")
        await witness.next(0.02)

    for size in (LARGEST + BESIDE, LARGEST + BESIDE + 1, MOST_IN_PARTS, 2 * MOST_IN_PARTS, 30_000_000):
        sender.put("elsewhere", bytes(size), congestion_control=BLOCK)
        sender.put(f"after/{size}", b"", congestion_control=BLOCK)
    await witness.wait(lambda: ("put", "after/30000000", 0) in witness.came)

    came = [each for each in witness.came if each[1] != "begun"]
    assert [each for each in came if each[1] == "elsewhere"] == [("put", "elsewhere", LARGEST + BESIDE)]
    assert len(came) == 6


@pytest.mark.parametrize("mode", ["peer", "client"])
async def test_a_process_drops_what_a_link_without_a_router_of_ours_brings_in(mode: str) -> None:
    """Peers link directly; and a client may have a router that knows no bounds."""
    endpoint = free_endpoint()
    bare = plain(endpoint, **{"mode": "router", "connect/endpoints": [], "listen/endpoints": [endpoint]})
    hub = await open_hub("robot", connect=[endpoint], mode="peer" if mode == "peer" else "client")
    try:
        inbox = hub.join("here").tap(keys.WORLD, keys.FEEDBACK)
        publisher: Any = bare.declare_publisher(keys.WORLD, congestion_control=BLOCK)
        await Witness(bare).wait(lambda: publisher.matching_status.matching)
        for key in (keys.WORLD, keys.FEEDBACK):
            for size in (most(key) + BESIDE + 1, most(key) + BESIDE):
                bare.put(key, bytes(size), congestion_control=BLOCK)
        came = [await inbox.next(hub._loop.time() + PATIENCE) for _ in range(2)]
        assert [(each.key, len(each.payload)) for each in came if each] == [
            (key, most(key) + BESIDE) for key in (keys.WORLD, keys.FEEDBACK)
        ]
    finally:
        await hub.close()
        bare.close()  # type: ignore[no-untyped-call]


async def test_a_router_passes_on_pulses_of_a_holder_at_their_rate_and_no_more() -> None:
    """The pulses of ours come through, and a flood of one process costs no other holder a pulse."""
    alice, bob = (Holder(robot="robot", role="manager", name=name) for name in ("alice", "bob"))
    endpoint = free_endpoint()
    router = open_router((), [endpoint], {"downsampling": paced((alice, bob))})
    loud, quiet, witness = plain(endpoint), plain(endpoint), Witness(plain(endpoint))
    spaced = Witness(quiet)  # which hears nothing
    try:
        witness.session.declare_subscriber(keys.own("*", "pulse/news"), witness.hear("put"))
        pulses = {who.name: keys.own(f"{who.mark}{'2' * 24}", "pulse/news") for who in (alice, bob)}
        while not witness.came:
            quiet.put(pulses["bob"], b"")
            await witness.next(0.02)
        await spaced.next(2 / MOST_PULSES)
        witness.came.clear()
        began = time.perf_counter()
        for at in range(4):
            for _ in range(500):
                loud.put(pulses["alice"], b"1", congestion_control=BLOCK)
            quiet.put(pulses["bob"], bytes(at), congestion_control=BLOCK)
            await spaced.next(2 / MOST_PULSES)
        loud.put("engage/v1/state/over", b"", congestion_control=BLOCK)
        took = time.perf_counter() - began
        await witness.wait(lambda: ("put", pulses["bob"], 3) in witness.came)
        of = Counter(key for _, key, _ in witness.came)
        assert [size for _, key, size in witness.came if key == pulses["bob"]] == [0, 1, 2, 3]
        assert 1 <= of[pulses["alice"]] <= took * MOST_PULSES + 1
    finally:
        for session in (loud, quiet, witness.session, router):
            session.close()  # type: ignore[no-untyped-call]


def test_a_rows_bound_is_that_of_zenoh() -> None:
    """Zenoh takes the smallest limit of all expressions that include a key: so none may include one of a larger."""
    filters: Any = bounded()["low_pass_filter"]
    limits = {key: each["size_limit"] for each in filters for key in each["key_exprs"]}
    for row in access.TABLE:
        if row.does != "subscribes":
            key = zenoh.KeyExpr(f"robot/{row.key.replace(OWN, 'ann')}")
            found = min(size for each, size in limits.items() if zenoh.KeyExpr(each).includes(key))
            assert found == row.most + BESIDE, row

"""The door of a router: who takes too much is cut and named, nobody else. Why there is no link is told as it is."""

import asyncio
import json
from typing import Any

import pytest
import zenoh

from engage_hri.schemas import keys
from engage_hri.services.bus.zenoh import session as module
from engage_hri.services.bus.zenoh.router import MOST_TOKENS, routing
from tests.bus.places import PATIENCE, free_endpoint

pytestmark = pytest.mark.real_time


def visitor(endpoint: str) -> Any:
    settings = {"mode": "client", "connect/endpoints": [endpoint], "scouting/multicast/enabled": False}
    config = zenoh.Config()
    for key, value in {**settings, "namespace": "robot"}.items():
        config.insert_json5(key, json.dumps(value))
    return zenoh.open(config)


async def test_who_shows_too_many_tokens_is_cut_and_nobody_else() -> None:
    endpoint, lines = free_endpoint(), asyncio.Queue[str]()
    loop = asyncio.get_running_loop()
    async with routing([endpoint], [], lines.put_nowait):
        loud, quiet = visitor(endpoint), visitor(endpoint)
        broken: dict[str, asyncio.Event] = {}
        for name, each in (("loud", loud), ("quiet", quiet)):
            gone = broken[name] = asyncio.Event()

            def changed(event: zenoh.TransportEvent, gone: asyncio.Event = gone) -> None:
                if event.kind == zenoh.SampleKind.DELETE:
                    loop.call_soon_threadsafe(gone.set)

            each.info.declare_transport_events_listener(zenoh.handlers.Callback(changed, indirect=False))
        run = str(loud.zid())
        tokens = [
            loud.liveliness().declare_token(keys.own(run, f"log/{number}")) for number in range(MOST_TOKENS + 1)
        ]
        async with asyncio.timeout(PATIENCE):
            line = await lines.get()
            await broken["loud"].wait()

        assert line.startswith(f"too many: process {run} has more than {MOST_TOKENS} tokens")
        assert not broken["quiet"].is_set()
        tokens.clear()
        for each in (loud, quiet):
            each.close()


async def test_who_is_kept_out_and_calls_again_is_turned_away_before_it_can_show_anything() -> None:
    endpoint, lines = free_endpoint(), asyncio.Queue[str]()
    loop = asyncio.get_running_loop()
    async with routing([endpoint], [], lines.put_nowait):
        loud, quiet = visitor(endpoint), visitor(endpoint)
        run, seen, calls = str(loud.zid()), list[str](), asyncio.Queue[str]()

        def linked(event: zenoh.TransportEvent) -> None:
            loop.call_soon_threadsafe(calls.put_nowait, str(event.kind))

        listener = loud.info.declare_transport_events_listener(zenoh.handlers.Callback(linked, indirect=False))
        tokens = [
            loud.liveliness().declare_token(keys.own(run, f"log/{number}")) for number in range(MOST_TOKENS + 1)
        ]
        async with asyncio.timeout(PATIENCE):
            assert (await lines.get()).startswith("too many: ")
            for cut in ("SampleKind.DELETE", "SampleKind.PUT", "SampleKind.DELETE"):
                assert await calls.get() == cut  # of its first link the router may still read the rest
            watched = quiet.liveliness().declare_subscriber(
                keys.own(run, "log/*"),
                zenoh.handlers.Callback(lambda one: seen.append(str(one.kind)), indirect=False),
            )
            for _ in range(5):  # it calls by itself, and is cut
                assert [await calls.get(), await calls.get()] == ["SampleKind.PUT", "SampleKind.DELETE"]

        assert "SampleKind.PUT" not in seen
        tokens.clear()
        for each in (watched, listener):
            each.undeclare()
        for session in (loud, quiet):
            session.close()


async def test_that_no_router_answers_is_told_only_where_nobody_listens() -> None:
    nobody, somebody = free_endpoint(), free_endpoint()
    host, _, port = somebody.partition("/")[2].rpartition(":")
    server = await asyncio.start_server(lambda reader, writer: writer.close(), host, int(port))
    try:
        absent, advice = await module._why_no_link([nobody], with_keys=False)
        full, reasons = await module._why_no_link([nobody, somebody], with_keys=True)
    finally:
        server.close()
        await server.wait_closed()

    assert absent == f"no router answers at {nobody}"
    assert "engage router" in advice
    assert full == f"{somebody} is open, but gives no link"
    assert "full" in reasons
    assert "certificate" in reasons

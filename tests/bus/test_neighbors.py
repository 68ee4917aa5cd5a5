"""Who waits for a robot that is not there is told which are: over real sockets."""

import asyncio
import logging

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.participants import BusHealth, ProcessFacts, Reachable, Status
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.zenoh import neighbors
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.bus.zenoh.neighbors import Unseen, hinting, robots, tell_who_is_missing, told, unseen
from engage_hri.services.bus.zenoh.session import open_session
from tests.bus.places import free_endpoint

pytestmark = pytest.mark.real_time


async def test_a_robot_of_another_name_is_named(caplog: pytest.LogCaptureFixture) -> None:
    endpoint = free_endpoint()
    async with (
        await open_hub("melvin", listen=[endpoint]) as there,
        await open_hub("robot", connect=[endpoint]) as here,
    ):
        there.join("generation").declare_alive()
        with caplog.at_level(logging.WARNING, logger="engage"):
            await tell_who_is_missing(here.join("me"), [endpoint], after=0.0)

    assert "no robot 'robot' here yet; there are: 'melvin'; waiting" in caplog.text


async def test_nobody_is_named_where_nobody_is_and_nothing_is_said_where_the_robot_is(
    caplog: pytest.LogCaptureFixture,
) -> None:
    endpoint = free_endpoint()
    assert await robots([free_endpoint()]) == ()
    async with await open_hub("robot", listen=[endpoint]) as hub:
        for name in keys.SERVICES:
            hub.join(name).declare_alive()
        with caplog.at_level(logging.WARNING, logger="engage"):
            await tell_who_is_missing(hub.join("me"), [endpoint], after=0.2)

    assert caplog.text == ""


async def test_who_speaks_another_version_of_the_protocol_is_named_and_whoever_shows_it_is_told(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """A process of a later Engage: all that ours can see of it are its tokens."""
    endpoint, lines = free_endpoint(), list[str]()
    async with await open_hub("robot", listen=[endpoint]) as here:
        later, _ = open_session(None, (endpoint,), (), None)
        tokens = [
            later.liveliness().declare_token(f"robot/engage/v2/@bus/1/{each}")
            for each in ("process/c", "alive/generation")
        ]
        try:
            with caplog.at_level(logging.WARNING, logger="engage"):
                await tell_who_is_missing(here.join("me"), [endpoint], after=0.5, tell=lines.append)
            here.join("control").declare_alive()
            await tell_who_is_missing(here.join("other"), [endpoint], after=0.0, tell=lines.append)
        finally:
            for token in tokens:
                token.undeclare()
            later.close()  # type: ignore[no-untyped-call]

    nobody, first, unseen_here, second = lines
    assert nobody == "no robot 'robot' here yet; waiting (`engage up --robot robot` starts one)"
    assert unseen_here == "nobody here sees generation, realizer, recognition; waiting"
    assert (
        first
        == second
        == (
            "somebody of robot 'robot' speaks engage/v2, which nobody hears who speaks engage/v1: "
            "bring all machines to one version of Engage"
        )
    )
    assert first in caplog.text


async def test_who_waits_at_an_encrypted_endpoint_is_told_of_keys(caplog: pytest.LogCaptureFixture) -> None:
    async with await open_hub("robot", listen=[free_endpoint()]) as hub:
        with caplog.at_level(logging.WARNING, logger="engage"):
            await tell_who_is_missing(hub.join("me"), ["tls/localhost:1"], after=0.0)

    assert "the router lets in only --keys that it knows, and shows nothing to revoked ones" in caplog.text


def status(name: str, *peers: str, host: str = "", **places: str) -> Status:
    health = BusHealth(
        peers=(name, *peers), reachable=tuple(Reachable(each, (place,)) for each, place in places.items())
    )
    return Status(
        participant=name,
        run="1",
        version="1",
        at=Stamp("c", 0.0),
        joined=Stamp("c", 0.0),
        bus=health,
        process=ProcessFacts(host=host),
    )


def test_what_others_see_is_told_with_the_reason_why_it_cannot_be_seen_from_here() -> None:
    control = status(
        "control", "realizer", "recognition", realizer="tcp/127.0.0.1:0", recognition="tcp/192.0.2.7:7447"
    )
    missing = unseen(["generation", "realizer", "recognition"], [control, status("simulation", "recognition")])

    assert missing == [
        Unseen("generation"),
        Unseen("realizer", ("control",), ("tcp/127.0.0.1:0",)),
        Unseen("recognition", ("control", "simulation"), ("tcp/192.0.2.7:7447",)),
    ]
    loopback, unreachable, nobody = told(missing)
    assert loopback.startswith(
        "realizer cannot be seen from here, though control can see it: it listens on 127.0.0.1 only;"
    )
    assert "engage router" in loopback
    assert unreachable.endswith("it listens on tcp/192.0.2.7:7447, which cannot be reached from here")
    assert nobody == "nobody here sees generation; waiting"
    assert told([Unseen("control", ("realizer",))]) == [
        "control cannot be seen from here, though realizer can see it: it is a client of a router that this process"
        " has no link to"
    ]


def test_on_one_machine_who_is_not_in_sight_is_only_slow() -> None:
    """As with `engage record` beside `engage up` on a busy machine: all listen on loopback, and can be reached."""
    control = status("control", "realizer", host="here", realizer="tcp/127.0.0.1:41111")

    assert told(unseen(["realizer"], [control], "here")) == [
        "realizer is not in sight, though control can see it; waiting"
    ]
    (elsewhere,) = told(unseen(["realizer"], [control], "there"))
    assert "127.0.0.1 only" in elsewhere


async def test_who_comes_after_all_is_told(caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(neighbors, "LOOK", 0.05)
    lines, missed, come = list[str](), asyncio.Event(), asyncio.Event()

    def take(line: str) -> None:
        lines.append(line)
        missed.set()
        if line.startswith("in sight now"):
            come.set()

    endpoint = free_endpoint()
    async with (
        await open_hub("robot", listen=[endpoint]) as hub,
        hinting(hub.join("me"), [endpoint], ("control",), take),
        asyncio.timeout(20),
    ):
        await missed.wait()
        hub.join("control").declare_alive()
        await come.wait()

    assert lines[-1] == "in sight now: control"

"""News of the router: one line when it is gone and one when it is back, pure and over real sockets."""

import asyncio
import logging
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.services.bus.zenoh.links import SETTLE, RouterNews
from engage_hri.services.client.robot import connect
from tests.bus.places import free_endpoint
from tests.cli.command import start
from tests.cli.test_processes import PATIENCE, line, stopped

HERE, THERE = "tcp/10.0.0.1:7447", "tcp/10.0.0.2:7447"


def news() -> RouterNews:
    """Of a process that has had a router from the start, which is no news."""
    made = RouterNews()
    assert made.came("1", HERE, 0.0) is None
    return made


def test_a_router_that_is_gone_is_told_once_and_once_that_there_is_one_again() -> None:
    told = news()
    assert told.went("1", 10.0) is None
    assert told.deadline == 10.0 + SETTLE
    assert told.due(10.5, 0) is None
    gone = told.due(10.0 + SETTLE, 0)

    assert gone == (
        f"the router at {HERE} is gone: no other process is heard, nor hears this one."
        " This process goes on, and keeps calling it"
    )
    assert told.due(100.0, 0) is None
    assert told.came("2", HERE, 22.5) == f"a router is there again, at {HERE}, after 12.5 s"
    assert told.deadline is None


def test_a_link_that_breaks_for_a_moment_is_no_news() -> None:
    told = news()
    told.went("1", 10.0)

    assert told.came("1", HERE, 10.4) is None
    assert told.due(12.0, 0) is None


def test_another_router_that_takes_over_at_once_is_no_news() -> None:
    told = news()
    assert told.came("2", THERE, 1.0) is None
    told.went("1", 2.0)
    assert told.deadline is None
    told.went("2", 20.0)

    assert told.came("3", HERE, 20.4) is None
    assert told.due(30.0, 0) is None
    assert told.unlinked_at(30.0) == 20.4


def test_who_is_linked_directly_is_still_heard() -> None:
    told = news()
    told.went("1", 0.0)

    assert "of other processes only the 3 with a direct link are heard" in str(told.due(SETTLE, 3))


@given(st.lists(st.tuples(st.sampled_from("abc"), st.booleans(), st.floats(0, 3)), max_size=40))
def test_what_was_told_last_is_how_it_is_and_nothing_is_told_twice(steps: list[tuple[str, bool, float]]) -> None:
    told, now, here, lines = RouterNews(), 0.0, set[str](), list[str]()
    for zid, there, pause in steps:
        now += pause
        if told.deadline is not None and told.deadline <= now:
            lines.append(told.due(told.deadline, 0) or "nothing")
        (here.add if there else here.discard)(zid)
        if not there:
            told.went(zid, now)
        elif (line := told.came(zid, f"tcp/{zid}:1", now)) is not None:
            lines.append(line)
    if told.deadline is not None:
        lines.append(told.due(told.deadline, 0) or "nothing")

    assert "nothing" not in lines
    no_router = ["keeps calling" in line for line in lines]
    assert not any(one and other for one, other in pairwise(no_router))
    if lines:
        assert no_router[-1] == (not here)


@pytest.mark.real_time
async def test_services_and_clients_say_that_the_router_is_gone_and_is_back(
    caplog: pytest.LogCaptureFixture, tmp_path: Path
) -> None:
    endpoint = free_endpoint()
    arguments = ("router", "--listen", endpoint)
    router = await start(*arguments)
    await line(router, "router is ready")
    programs = [
        await start(*command, "--mode", "client", "--connect", endpoint)
        for command in (("run", "realizer"), ("watch",), ("run", "recognition", "--log", tmp_path / "log"))
    ]
    gone = f"the router at {endpoint} is gone: no other process is heard, nor hears this one."
    back = f"a router is there again, at {endpoint}, after "
    heard = asyncio.Event()

    class Ear(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if back in record.getMessage():
                heard.set()

    ear = Ear()
    logging.getLogger("engage").addHandler(ear)
    try:
        await line(programs[0], "realizer is ready")
        await line(programs[2], "recognition is ready")
        async with connect(connect=[endpoint], mode="client"):
            with caplog.at_level(logging.WARNING, logger="engage"):
                await stopped(router, 9)  # type: ignore[arg-type]
                for program in programs:
                    await line(program, gone)
                router = await start(*arguments)
                for program in programs:
                    await line(program, back)
                async with asyncio.timeout(PATIENCE):
                    await heard.wait()

        assert caplog.text.count(gone) == 1
        assert (tmp_path / "log").read_text().count(gone) == 1
    finally:
        logging.getLogger("engage").removeHandler(ear)
        for program in (*programs, router):
            await stopped(program)

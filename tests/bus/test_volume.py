"""Who sends a lot to a router is told, with the name; who answers what it is asked is not."""

import asyncio
import socket
from contextlib import suppress

import pytest
import zenoh

from engage_hri.schemas.access import LOUD, LOUD_ROBOT
from engage_hri.services.bus.zenoh import links
from engage_hri.services.bus.zenoh.links import EXCUSED, FULL, UNREAD, Unread, Volume, Volumes, sockets, volumes
from engage_hri.services.bus.zenoh.router import routing
from engage_hri.services.bus.zenoh.session import open_session
from tests.bus.places import PATIENCE, free_endpoint

NAMES = {"a": "robot/observer/viewer", "c": "robot/control/control"}


@pytest.mark.parametrize(("link", "bound"), [("a", LOUD["observer"]), ("c", LOUD_ROBOT), ("1.2.3.4:5", LOUD_ROBOT)])
def test_a_link_is_told_when_it_begins_to_be_loud_and_again_after_it_was_quiet(link: str, bound: int) -> None:
    kept, total, told = Volumes(0.0), 0, []
    for at, speed in enumerate((0, bound, bound + 1, 9 * bound, 0, 3 * bound)):
        total += speed
        told.append(kept.look({link: Volume(total), "d": Volume(5)}, NAMES, at + 1.0))
    line = f"loud: {NAMES.get(link, link)} sends {{:.1f}} MB a second"
    assert told == [[], [], [line.format((bound + 1) / 1e6)], [], [], [line.format(3 * bound / 1e6)]]


def test_who_answers_what_is_asked_of_it_is_not_loud() -> None:
    kept = Volumes(0.0)
    for second in range(1, 60):
        asked = second * 10 * LOUD["observer"]
        assert kept.look({"a": Volume(EXCUSED * asked, asked)}, NAMES, second) == []


def test_sockets_of_other_kinds_are_passed_over() -> None:
    """The C library opens one to the kernel whenever a name is looked up, which Zenoh's threads do."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        kernel = socket.socket(getattr(socket, "AF_NETLINK"), socket.SOCK_RAW, 0)  # noqa: B009
        with kernel, socket.create_connection(server.getsockname()) as link:
            kernel.bind((0, 0))
            ends = [tuple(f"{host}:{port}" for host, port in (link.getsockname(), link.getpeername()))]
            assert [(own, other) for own, other, each in sockets() if each.fileno() == link.fileno()] == ends


def test_an_address_of_a_local_link_is_spelled_with_its_card_as_zenoh_does() -> None:
    assert links._place(("fe80::1", 41882, 0, 3)) == "[fe80::1%3]:41882"
    assert links._place(("::1", 7447, 0, 0)) == "[::1]:7447"
    assert links._place(("127.0.0.1", 7447)) == "127.0.0.1:7447"


def test_a_full_link_of_which_nothing_is_read_is_to_end_and_one_that_is_read_slowly_is_not() -> None:
    kept, step = Unread(), UNREAD / 3
    ended = []
    for look in range(10):
        links = {
            "frozen": Volume(0, taken=7, waiting=FULL),
            "slow": Volume(0, taken=look // 2, waiting=FULL),
            "idle": Volume(0, taken=7, waiting=FULL - 1),
            "pauses": Volume(0, taken=7, waiting=FULL if look % 3 else 0),
        }
        ended.append(kept.look(links, look * step))
    assert ended == [[]] * 3 + [["frozen"]] * 7
    assert kept.look({"frozen": Volume(0, taken=8, waiting=FULL)}, 10 * step) == []


@pytest.mark.real_time
async def test_the_kernel_says_what_a_link_has_brought() -> None:
    endpoint = free_endpoint()
    async with routing([endpoint], (), lambda line: None):
        sender, _ = open_session("robot", [endpoint], (), None, "client")
        hearer, _ = open_session("robot", [endpoint], (), None, "client")
        loop, heard = asyncio.get_running_loop(), asyncio.Event()
        handler = zenoh.handlers.Callback(lambda sample: loop.call_soon_threadsafe(heard.set), indirect=False)
        hearer.declare_subscriber("a", handler)

        def brought() -> int:
            return sum(each.brought for each in volumes().values())

        before, sent = brought(), 0
        async with asyncio.timeout(PATIENCE):
            while brought() < before + 10_000_000:
                sender.put("a", bytes(1_000_000), congestion_control=zenoh.CongestionControl.BLOCK)
                sent += 1_000_000
                heard.clear()
                with suppress(TimeoutError):  # the first ones go before anybody is known to hear
                    await asyncio.wait_for(heard.wait(), 0.05)
        # Both ends of all links are in this process: each megabyte comes twice, to the router and to who hears it.
        assert brought() - before <= 2.1 * sent
        for session in (sender, hearer):
            session.close()  # type: ignore[no-untyped-call]


@pytest.mark.real_time
@pytest.mark.parametrize(("endpoint", "is_told"), [("tcp/0.0.0.0:0", True), ("tcp/127.0.0.1:0", False)])
def test_who_is_open_to_all_says_so_at_the_start(
    endpoint: str, is_told: bool, caplog: pytest.LogCaptureFixture
) -> None:
    for mode in ("peer", "router"):
        caplog.clear()
        session, _ = open_session("robot", (), (endpoint,), None, mode)
        session.close()  # type: ignore[no-untyped-call]
        told = [line for line in caplog.messages if line.startswith(f"open to all: whoever reaches {endpoint} can")]
        assert len(told) == is_told, mode

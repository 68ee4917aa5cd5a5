"""Who sends a lot is told, with the name, once for each time that it begins."""

import asyncio

import pytest

from engage_hri.services.bus.zenoh.router import routing
from engage_hri.services.bus.zenoh.session import open_session
from engage_hri.services.bus.zenoh.volume import LOUD, Volumes, received
from tests.bus.places import PATIENCE, free_endpoint

NAMES = {"a": "robot/observer/viewer"}


def test_a_link_is_told_when_it_begins_to_be_loud_and_again_after_it_was_quiet() -> None:
    volumes = Volumes()
    total, told = 0, []
    for at, came in enumerate((0, 2 * LOUD, 2 * LOUD + 1, 9 * LOUD, 0, 3 * LOUD)):
        total += came
        told.append(volumes.look({"a": total, "b": 5}, NAMES, 2.0 * (at + 1)))
    megabytes = [(2 * LOUD + 1) / 1e6, 3 * LOUD / 1e6]
    line = "loud: robot/observer/viewer has sent {:.0f} MB in 2.0 s"
    assert told == [[], [], [line.format(megabytes[0])], [], [], [line.format(megabytes[1])]]


def test_a_link_that_is_new_counts_from_its_beginning_and_one_without_a_name_is_its_address() -> None:
    volumes = Volumes()
    volumes.look({}, {}, 10.0)
    assert volumes.look({"b": 3 * LOUD}, {}, 12.0) == [f"loud: b has sent {3 * LOUD / 1e6:.0f} MB in 2.0 s"]


@pytest.mark.real_time
async def test_the_kernel_says_what_a_link_has_brought() -> None:
    endpoint = free_endpoint()
    async with routing([endpoint], (), lambda line: None):
        before = sum(received().values())
        session, _ = open_session("robot", [endpoint], (), None, "client")
        for _ in range(10):
            session.put("a", bytes(1_000_000), congestion_control=1)
        async with asyncio.timeout(PATIENCE):
            while sum(received().values()) < before + 10_000_000:  # noqa: ASYNC110 - the kernel wakes nobody
                await asyncio.sleep(0.01)
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

"""Who sends too much to a router is told, with the name, and loses its links; who answers what is asked does not."""

import asyncio
import random

import pytest
import zenoh

from engage_hri.schemas.limits import MOST_A_SECOND
from engage_hri.services.bus.zenoh.router import routing
from engage_hri.services.bus.zenoh.session import open_session
from engage_hri.services.bus.zenoh.volume import EXCUSED, LOOK, LOUD, SAVED, TO_JOIN, Volume, Volumes, volumes
from tests.bus.places import PATIENCE, free_endpoint

VIEWER, CONTROL = "robot/observer/viewer", "robot/control/control"
NAMES = {"a": VIEWER, "b": VIEWER, "c": CONTROL}
RATE = MOST_A_SECOND["observer"]


def test_a_link_is_told_when_it_begins_to_be_loud_and_again_after_it_was_quiet() -> None:
    kept, total, told = Volumes(0.0), 0, []
    for at, speed in enumerate((0, LOUD, LOUD + 2, 9 * LOUD, 0, 3 * LOUD)):
        total += speed
        told.append(kept.look({"c": Volume(total + TO_JOIN), "d": Volume(5)}, NAMES, at + 1.0).told)
    line = f"loud: {CONTROL} sends {{:.0f}} MB a second"
    assert told == [[], [], [line.format((LOUD + 2) / 1e6)], [], [], [line.format(3 * LOUD / 1e6)]]


def test_a_holder_that_has_sent_too_much_loses_its_loud_links_and_each_new_one_until_it_is_even() -> None:
    kept, most = Volumes(0.0), 2 * RATE
    quiet = {"b": Volume(10), "c": Volume(10**9)}
    assert kept.look({"a": Volume(TO_JOIN), **quiet}, NAMES, 1.0).closed == []
    over = TO_JOIN + int(most * SAVED)
    told, closed = kept.look({"a": Volume(over + RATE), **quiet}, NAMES, 2.0)
    assert closed == ["a"]
    assert told == [
        f"too much: {VIEWER} has sent more than {RATE // 1024} kB a second; its links are closed for 1.0 s"
    ]
    # In debt: the next link of the same holder is closed at once, the quiet one and the other holder's stay.
    back = NAMES | {"a2": VIEWER}
    assert kept.look({"a2": Volume(TO_JOIN), **quiet}, back, 2.1) == ([], ["a2"])
    assert kept.look(quiet, back, 4.0) == ([], [])
    assert kept.look({"a3": Volume(TO_JOIN), **quiet}, back | {"a3": VIEWER}, 5.0) == ([], [])


def test_who_answers_what_is_asked_of_it_is_excused() -> None:
    kept = Volumes(0.0)
    for second in range(1, 60):
        asked = second * 10 * RATE
        assert kept.look({"a": Volume(EXCUSED * asked, asked)}, NAMES, second).closed == []


@pytest.mark.parametrize("seed", range(30))
def test_nobody_is_closed_within_its_bound_and_everybody_beyond_it(seed: int) -> None:
    """The oracle keeps all that was sent: since no instant may it be more than may be sent at once and since then."""
    chance = random.Random(seed)
    kept, total, now = Volumes(0.0), 0, 0.0
    sent: list[tuple[float, int]] = []
    for _ in range(60):
        span = chance.choice((LOOK, LOOK, 3 * LOOK))
        now += span
        size = int(chance.choice((0, 0.4, 1, 3, 8)) * RATE * chance.random())
        total += size
        sent.append((now, size))

        closed = kept.look({"a": Volume(total + TO_JOIN)}, {"a": VIEWER}, now).closed

        since = [sum(size for then, size in sent if then >= at) - RATE * (now - at) for at, _ in sent]
        is_loud = size > RATE * span / 8 or len(sent) == 1
        assert (closed == ["a"]) == (max(since) > RATE * SAVED and is_loud)


@pytest.mark.real_time
async def test_the_kernel_says_what_a_link_has_brought() -> None:
    endpoint = free_endpoint()
    async with routing([endpoint], (), lambda line: None):
        before = sum(each.brought for each in volumes().values())
        session, _ = open_session("robot", [endpoint], (), None, "client")
        for _ in range(10):
            session.put("a", bytes(1_000_000), congestion_control=zenoh.CongestionControl.BLOCK)
        async with asyncio.timeout(PATIENCE):
            while sum(each.brought for each in volumes().values()) < before + 10_000_000:  # noqa: ASYNC110
                await asyncio.sleep(0.01)  # the kernel wakes nobody
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

"""Floods: whoever sends too much delays others by little, and is told of at 1, 10, 100 ... times."""

from collections import Counter, defaultdict
from random import Random

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.requests import Refused, Unreadable
from engage_hri.services.bus.interface import Bus, Subscription
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.samples import CALM, KINDS, MOST, Often
from engage_hri.services.bus.zenoh.bridge import PLACES, Turns
from engage_hri.services.requests.ends import RequestDesk
from tests.random_cases import share_of


def waiting(inbox: Subscription) -> list[object]:
    return [inbox._queue[index].message for index in range(len(inbox))]


# -- turns ----------------------------------------------------------------------------------------------------------


def test_the_items_of_one_sender_keep_their_order_and_none_is_lost() -> None:
    for seed in range(share_of(400)):
        random, turns = Random(seed), Turns[tuple[str | None, int]]()
        came, went = defaultdict[str | None, list[int]](list), defaultdict[str | None, list[int]](list)
        for number in range(random.choice((50, 1000))):
            for _ in range(random.choice((0, 0, 1, 1, 2, 100))):
                sender = random.choice(("loud", "loud", "loud", "quiet", "other", None))
                came[sender].append(number)
                turns.append(sender, (sender, number))
            if turns and random.random() < 0.7:
                who, what = turns.popleft()
                went[who].append(what)
        while turns:
            who, what = turns.popleft()
            went[who].append(what)
        assert went == came
        assert (turns._places, turns._behind) == ({}, {})


def test_the_line_is_as_it_came_while_nobody_has_more_than_its_places() -> None:
    random, turns = Random(1), Turns[int]()
    kept: list[int] = []
    there = Counter[str]()
    senders: dict[int, str] = {}
    for number in range(20_000):
        sender = random.choice("abc")
        if there[sender] < PLACES and random.random() < 0.6:
            turns.append(sender, number)
            kept.append(number)
            there[sender] += 1
            senders[number] = sender
        elif kept:
            first = turns.popleft()
            assert first == kept.pop(0)
            there[senders[first]] -= 1


@pytest.mark.parametrize("floods", [1, 3])
def test_a_flood_stands_before_the_item_of_another_with_its_places_only(floods: int) -> None:
    turns = Turns[str]()
    for number in range(10_000):
        turns.append(f"loud {number % floods}", "loud")
    turns.append("quiet", "quiet")

    before = next(index for index in range(len(turns)) if turns.popleft() == "quiet")

    assert before == floods * PLACES


def test_what_is_of_no_sender_waits_for_what_stands_in_the_line_only() -> None:
    turns = Turns[str]()
    for _ in range(10_000):
        turns.append("loud", "loud")
    turns.append(None, "reply")
    turns.append(None, "end")

    order = [turns.popleft() for _ in range(len(turns))]

    assert (order[PLACES], order[PLACES + 1]) == ("reply", "end")


# -- often ----------------------------------------------------------------------------------------------------------


def test_a_refusal_is_told_at_the_powers_of_ten_and_anew_after_a_calm() -> None:
    often = Often()

    told = [times for number in range(12_345) if (times := often.tell("a", "k", number * 2**-13))]

    assert told == [1, 10, 100, 1000, 10_000]
    assert often.tell("a", "k", 12_344 * 2**-13 + CALM) == 1


def test_a_flood_of_one_sender_hides_no_refusal_of_another() -> None:
    often = Often()
    for number in range(10_000):
        often.tell("loud", f"kind {number}", 0.0)

    assert often.tell("quiet", "kind", 0.0) == 1
    assert len(often) == KINDS + 2


def test_what_is_counted_is_bounded_and_as_a_slow_recount_has_it() -> None:
    for seed in range(share_of(100)):
        random, often, now = Random(seed), Often(), 0.0
        log: list[tuple[str, str, float]] = []
        for _ in range(600):
            now += random.choice((0.0, 2**-10, 0.5, CALM, CALM - 2**-10))
            sender, kind = random.choice("abc"), str(random.randrange(5))
            log.append((sender, kind, now))
            times, last = 0, now
            for who, what, at in reversed(log):
                if (who, what) == (sender, kind):
                    if last - at >= CALM:
                        break
                    times, last = times + 1, at
            assert often.tell(sender, kind, now) == (times if times in (1, 10, 100, 1000) else 0)
        for number in range(3 * MOST):
            often.tell(f"sender {number}", "k", now)
            assert len(often) <= MOST + 1


# -- on the bus -----------------------------------------------------------------------------------------------------

BLOCK = "engage/v1/cmd/realizer/manager/mallory/block"


async def test_a_flood_that_nobody_can_read_is_told_a_few_times_and_not_each() -> None:
    async with MemoryHub() as hub:
        server, watcher = hub.join("realizer"), hub.join("watcher")
        inbox = server.subscribe(*RequestDesk.patterns("realizer"))
        faults = watcher.subscribe(keys.ANY_FAULT)
        for _ in range(2000):
            hub.inject(BLOCK, b"\xc1" * 100, "application/msgpack", "m")

        told = [each.reason for each in waiting(faults) if isinstance(each, Fault)]
        assert len(told) == 4
        assert [each.rpartition(" (")[2] for each in told[1:]] == ["10 times)", "100 times)", "1000 times)"]
        assert len([each for each in waiting(inbox) if isinstance(each, Unreadable)]) == 4


async def test_each_request_with_an_id_that_cannot_be_read_has_its_own_refusal_in_a_flood() -> None:
    async with MemoryHub() as hub:
        server, watcher = hub.join("realizer"), hub.join("watcher")
        inbox = server.subscribe(*RequestDesk.patterns("realizer"))
        answers = watcher.subscribe(keys.request_state("realizer"))
        desk = RequestDesk(server, "realizer", lambda cancel: None)
        for number in range(500):
            text = b'{"type": "perform_block", "id": "r%d", "life": "", "block": 7}' % number
            hub.inject(BLOCK, text, "application/json", "m")
            hub.inject(BLOCK, b"}", "application/json", "m")
        while len(inbox):
            received = await inbox.next()
            assert received is not None
            desk.take(received)
        desk.close()

        refused = [each.id for each in waiting(answers) if isinstance(each, Refused)]
        assert refused == [f"r{number}" for number in range(500)]


async def test_a_flood_of_one_requester_hides_no_fault_of_another() -> None:
    async with MemoryHub() as hub:
        server: Bus = hub.join("realizer")
        watcher = hub.join("watcher")
        server.subscribe(*RequestDesk.patterns("realizer"))
        faults = watcher.subscribe(keys.ANY_FAULT)
        for _ in range(50):
            hub.inject(BLOCK, b"}", "application/json", "router")
        hub.inject(BLOCK.replace("mallory", "bob"), b"}", "application/json", "router")

        told = [each.where for each in waiting(faults) if isinstance(each, Fault)]
        assert len(told) == 3
        assert "/bob/" in told[-1]

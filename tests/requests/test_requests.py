"""Both ends of a long request, over a memory bus that loses, repeats, delays, is cut, and whose ends die."""

import asyncio
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BlockOutcome
from engage_hri.schemas.faults import EngageError, Fault, RunFailed
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.requests import Accepted, Cancel, Refused, Request
from engage_hri.services.bus.interface import Received
from engage_hri.services.bus.memory import MemoryBus, MemoryHub
from engage_hri.services.requests.ends import Patience, RequestDesk, Requester, RequestRefused
from engage_hri.services.requests.serving import EACH, GRACE, MOST
from engage_hri.services.requests.serving_table import LONGEST
from tests.bus.performer import Server, answered, bare, block, extent
from tests.commanding import command, key_of


@contextmanager
def requester_of(bus: MemoryBus) -> Iterator[Requester]:
    """A requester that is fed at the instant of arrival, without a task."""
    requester = Requester(bus)
    inbox = bus.subscribe(*Requester.PATTERNS)
    offer = inbox.offer
    inbox.offer = lambda received: (offer(received), requester.feed(received))[0]  # type: ignore[method-assign]
    yield requester
    requester.close()


async def test_a_request_is_accepted_and_ends(hub: MemoryHub):
    server = Server(hub)
    async with Requester(hub.join("client")) as requests:
        pending = requests.send(keys.BLOCK, block())
        await pending.accepted

        outcome = await pending.outcome

    assert outcome == answered(pending, BlockOutcome(id="b", block="b", status="done"))
    assert asyncio.get_running_loop().time() == 0.5
    await server.die(hub)


async def test_a_requester_subscribes_with_its_first_request_and_knows_then_which_servers_are_there(hub: MemoryHub):
    server = Server(hub)
    client = hub.join("client")
    subscribed: list[tuple[str, ...]] = []
    subscribe = client.subscribe
    client.subscribe = lambda *patterns: (subscribed.append(patterns), subscribe(*patterns))[1]  # type: ignore
    async with Requester(client) as requests:
        await asyncio.sleep(1.0)
        assert subscribed == []

        pendings = [requests.send(keys.BLOCK, block(name)) for name in ("b", "c")]
        await asyncio.gather(*(pending.outcome for pending in pendings))

    assert subscribed == [Requester.PATTERNS]
    assert server.taken == [block("b"), block("c")]
    await server.die(hub)


async def test_a_first_request_of_who_has_left_the_bus_ends_at_once(hub: MemoryHub):
    client = hub.join("client")
    async with Requester(client) as requests:
        await client.leave()

        pending = requests.send(keys.BLOCK, block())

        with pytest.raises(EngageError, match="it has left the bus"):
            await pending.outcome


async def test_a_server_that_comes_late_gets_the_request_at_once_and_once(hub: MemoryHub):
    client = hub.join("client")
    client.declare_alive()
    async with Requester(client) as requests:
        pending = requests.send(keys.BLOCK, block())
        await asyncio.sleep(60.0)
        server = Server(hub)

        await pending.outcome

    assert asyncio.get_running_loop().time() == 60.5
    assert server.taken == [block()]
    await server.die(hub)


async def test_a_refusal_ends_both_futures_with_the_servers_fault(hub: MemoryHub):
    server = hub.join("realizer")
    desk = RequestDesk(server, "realizer", lambda cancel: None)
    inbox = server.subscribe(*RequestDesk.patterns("realizer"))
    async with Requester(hub.join("client")) as requests:
        pending = requests.send(keys.BLOCK, block())
        received = await inbox.next()
        assert received is not None
        taken = desk.take(received)
        assert taken is not None
        assert bare(taken) == block()
        desk.refuse("b", Fault(reason="no such target"))

        for future in (pending.accepted, pending.outcome):
            with pytest.raises(RequestRefused, match="no such target"):
                await future


async def test_an_answer_that_is_given_again_has_one_line_in_the_log(
    hub: MemoryHub, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("WARNING", logger="engage.realizer")
    server, client = hub.join("realizer"), hub.join("client")
    desk = RequestDesk(server, "realizer", lambda cancel: None)
    inbox = server.subscribe(*RequestDesk.patterns("realizer"))
    answers = client.subscribe(keys.request_state("realizer"))
    for _ in range(3):
        command(client, keys.BLOCK, block())
        received = await inbox.next()
        assert received is not None
        if desk.take(received) is not None:
            desk.refuse("b", Fault(reason="no such target"))
        answer = await answers.next()
        assert answer is not None
        assert isinstance(answer.message, Refused)

    assert [record.message for record in caplog.records] == [
        "refused perform_block b of client: no such target",
    ]


async def test_a_cancelled_request_ends_as_interrupted(hub: MemoryHub):
    server = Server(hub)
    async with Requester(hub.join("client")) as requests:
        pending = requests.send(keys.BLOCK, block())
        await pending.accepted
        requests.cancel("b", "changed my mind")
        requests.cancel("b", "really")

        outcome = await pending.outcome

    assert outcome == answered(pending, BlockOutcome(id="b", block="b", status="interrupted"))
    cancel = Cancel(id="b", requester="client", of="perform_block", reason="changed my mind")
    assert server.taken == [block(), cancel]
    await server.die(hub)


async def test_cancelling_what_the_server_never_got_ends_as_refused_and_it_is_never_performed(hub: MemoryHub):
    server = Server(hub)
    client = hub.join("client")
    async with Requester(client) as requests:
        hub.partition("client")
        pending = requests.send(keys.BLOCK, block())
        hub.heal()
        requests.cancel("b")

        with pytest.raises(RequestRefused, match="cancelled before realizer had heard"):
            await pending.outcome

    command(client, keys.BLOCK, pending.request)
    await asyncio.sleep(1.0)
    assert server.taken == []
    await server.die(hub)


async def test_a_killed_server_fails_the_request_after_the_grace(hub: MemoryHub):
    server = Server(hub, seconds=100.0)
    async with Requester(hub.join("client")) as requests:
        pending = requests.send(keys.BLOCK, block())
        await pending.accepted
        await asyncio.sleep(1.0)
        await server.die(hub)

        with pytest.raises(RunFailed, match="realizer has not been seen for 4"):
            await pending.outcome

    assert asyncio.get_running_loop().time() == 1.0 + 4.0  # as bus.md says


async def test_a_restarted_server_does_not_perform_again_what_it_had_accepted(hub: MemoryHub):
    server = Server(hub, seconds=100.0)
    client = hub.join("client")
    client.declare_alive()
    async with Requester(client) as requests:
        pending = requests.send(keys.BLOCK, block())
        await pending.accepted
        await server.die(hub)
        again = Server(hub)

        with pytest.raises(RunFailed, match="restarted"):
            await pending.outcome
        await asyncio.sleep(10.0)

    assert again.taken == []
    await again.die(hub)


async def test_a_request_that_died_with_its_server_unaccepted_is_performed_by_the_next(hub: MemoryHub):
    server = Server(hub)
    async with Requester(hub.join("client")) as requests:
        hub.partition("client")
        pending = requests.send(keys.BLOCK, block())
        await server.die(hub)
        hub.heal()
        again = Server(hub)

        assert (await pending.outcome).id == "b"

    assert (server.taken, again.taken) == ([], [block()])
    await again.die(hub)


async def test_a_request_that_may_have_begun_unaccepted_is_not_begun_again_by_the_next(hub: MemoryHub):
    server = Server(hub, accepts=False, seconds=100.0)
    async with Requester(hub.join("client")) as requests:
        pending = requests.send(keys.BLOCK, block())
        await asyncio.sleep(0.1)
        await server.die(hub)
        again = Server(hub)

        with pytest.raises(RunFailed, match="restarted"):
            await pending.outcome

    assert (server.taken, again.taken) == ([block()], [])
    assert not pending.accepted.done() or pending.accepted.exception()
    await again.die(hub)


async def test_a_server_that_is_there_and_says_nothing_fails_the_request_after_half_a_minute(hub: MemoryHub):
    mute = hub.join("realizer")
    mute.declare_alive()
    with mute.subscribe(keys.cancel("realizer")) as cancels:
        async with Requester(hub.join("client")) as requests:
            pending = requests.send(keys.BLOCK, block())

            with pytest.raises(RunFailed, match="realizer is there, but has not answered for 30"):
                await pending.outcome
            assert asyncio.get_running_loop().time() == 30.0
            received = await cancels.next()

    assert received is not None
    assert received.message.id == "b"


def test_the_limits_are_those_that_the_page_tells():
    page = Path(__file__).parents[2].joinpath("docs/bus.md").read_text()
    patience = Patience()
    for words, limits in (
        (r"sent again after ([\d.]+) s, doubling to ([\d.]+) s", (patience.first_resend, patience.longest_resend)),
        (r"(\d+) requests to one server are on their way", (patience.window,)),
        (r"server gone for ([\d.]+) s", (patience.grace,)),
        (r"server there, but without any answer for ([\d.]+) s", (patience.silence,)),
        (r"requester gone for ([\d.]+) s", (GRACE,)),
    ):
        told = re.search(words, page)
        assert told, words
        assert tuple(map(float, told.groups())) == limits


async def test_a_short_absence_of_the_server_is_harmless(hub: MemoryHub):
    server = Server(hub, seconds=5.0)
    async with Requester(hub.join("client")) as requests:
        pending = requests.send(keys.BLOCK, block())
        await pending.accepted
        hub.announce(PeerGone(participant="realizer"))
        await asyncio.sleep(GRACE - 0.1)
        hub.announce(PeerAlive(participant="realizer", run=server.bus.run))

        assert (await pending.outcome).id == "b"

    assert asyncio.get_running_loop().time() == 5.0
    await server.die(hub)


async def test_a_dead_requester_ends_its_requests_after_the_grace(hub: MemoryHub):
    server = Server(hub, seconds=100.0)
    await asyncio.sleep(0)
    client, other = hub.join("client"), hub.join("other")
    for bus in (client, other):
        bus.declare_alive()
    command(client, keys.BLOCK, block("mine"))
    command(other, keys.BLOCK, block("others", "other"))
    await asyncio.sleep(1.0)

    hub.kill("client")
    await asyncio.sleep(GRACE + 0.001)

    assert server.ended == ["mine interrupted"]
    assert server.desk.is_live("others")
    await server.die(hub)


async def test_a_requester_that_is_back_within_the_grace_keeps_its_requests(hub: MemoryHub):
    server = Server(hub, seconds=100.0)
    await asyncio.sleep(0)
    client = hub.join("client")
    client.declare_alive()
    command(client, keys.BLOCK, block())
    hub.announce(PeerGone(participant="client"))
    await asyncio.sleep(GRACE - 0.001)
    hub.announce(PeerAlive(participant="client", run=client.run))

    await asyncio.sleep(2 * GRACE)

    assert server.ended == []
    await server.die(hub)


async def test_a_restarted_requester_has_forgotten_its_requests_so_they_end_at_once(hub: MemoryHub):
    server = Server(hub, seconds=100.0)
    await asyncio.sleep(0)
    client = hub.join("client")
    client.declare_alive()
    command(client, keys.BLOCK, block())
    await asyncio.sleep(1.0)
    hub.kill("client")
    hub.join("client").declare_alive()
    await asyncio.sleep(0)

    assert server.ended == ["b interrupted"]
    await server.die(hub)


async def test_a_duplicate_is_answered_with_the_last_state(hub: MemoryHub):
    server = Server(hub)
    client = hub.join("client")
    states = client.subscribe(keys.ANY_REQUEST_STATE)
    for _ in range(2):
        command(client, keys.BLOCK, block())
    await asyncio.sleep(1.0)
    command(client, keys.BLOCK, block())
    await asyncio.sleep(0)

    told = [await states.next() for _ in range(4)]
    assert [type(each.message) for each in told if each] == [Accepted, Accepted, BlockOutcome, BlockOutcome]
    assert {(each.message.id, each.message.requester) for each in told if each} == {("b", "client")}  # type: ignore[union-attr]
    assert server.taken == [block()]
    await server.die(hub)


async def test_an_older_content_never_replaces_a_newer(hub: MemoryHub):
    server = Server(hub, name="control")
    await asyncio.sleep(0)  # it listens
    client = hub.join("client")
    with requester_of(client) as requests:
        first = requests.send(keys.BEHAVIOR, extent("start")).request
        requests.send(keys.BEHAVIOR, extent("stroke_start"))
        newest = requests.send(keys.BEHAVIOR, extent("stroke_end")).request
        command(client, keys.BEHAVIOR, first)
        await asyncio.sleep(0.4)

        assert [request.through for request in server.taken] == ["start", "stroke_start", "stroke_end"]  # type: ignore[attr-defined]
        assert newest.revision == 2
    await server.die(hub)


async def test_an_update_after_the_cancellation_is_void(hub: MemoryHub):
    bus = hub.join("control")
    desk = RequestDesk(bus, "control", lambda cancel: None)

    def take(message: Any) -> Request | None:
        return desk.take(Received(key_of(bus, keys.BEHAVIOR), message, "client", 0.0))

    assert take(extent("start")) is not None
    assert take(Cancel(id="b", requester="client")) is not None
    assert take(extent("end")) is None
    assert take(Cancel(id="b", requester="client")) is None


async def test_an_id_used_again_by_somebody_else_is_a_new_request(hub: MemoryHub):
    server = Server(hub)
    command(hub.join("client"), keys.BLOCK, block("b", "client"))
    await asyncio.sleep(1.0)

    command(hub.join("another"), keys.BLOCK, block("b", "another"))
    await asyncio.sleep(0)

    assert server.taken == [block("b", "client"), block("b~2", "another", of="b")]
    await server.die(hub)


@pytest.mark.contained
async def test_a_server_that_ends_a_request_twice_has_a_bug(hub: MemoryHub):
    server = Server(hub)
    hub.join("client").publish(keys.BLOCK, block())
    await asyncio.sleep(1.0)

    with hub.join("ear").subscribe(keys.ANY_FAULT) as faults:
        server.desk.end(BlockOutcome(id="b", block="b", status="done"))
        server.desk.accept("x")
        told = [await faults.next(), await faults.next()]

    reasons = [each.message.reason for each in told if each and isinstance(each.message, Fault)]
    assert reasons[0].startswith("request b has ended already, with BlockOutcome(")
    assert reasons[1] == "request x was never made; now Accepted"
    assert server.bus.health.failures == 2
    await server.die(hub)


@pytest.mark.parametrize("is_huge", [False, True])
async def test_a_desk_forgets_the_oldest_ended_requests_of_who_sends_many_and_no_live_one(
    hub: MemoryHub, is_huge: bool
):
    """Nobody can have it forget what another has sent. is_huge: few requests, of many bytes."""
    bus, quiet = hub.join("realizer"), hub.join("quiet")
    desk = RequestDesk(bus, "realizer", lambda cancel: None)
    inbox = bus.subscribe(*RequestDesk.patterns("realizer"))
    states = bus.subscribe(keys.ANY_REQUEST_STATE, capacity=100_000)

    def is_new(sender: MemoryBus, id: str, of: str = "") -> bool:
        key = key_of(sender, keys.BLOCK)
        return desk.take(Received(key, block(id, of=of), sender.name, 0.0, life=sender.run)) is not None

    assert is_new(quiet, "mine")
    desk.refuse("mine", Fault(reason="no"))
    size = 2**20 if is_huge else 0
    number = 2 * MOST // (EACH + size)
    for each in range(number):
        assert is_new(bus, str(each), of="x" * size)
        if each:
            desk.refuse(str(each), Fault(reason="no"))

    assert desk.is_live("0")
    assert is_new(bus, "1", of="x" * size)
    assert not is_new(bus, str(number - 1), of="x" * size)
    assert not is_new(quiet, "mine")
    assert len(inbox) == 0
    assert len(states) == number + 2


async def test_what_cannot_be_encoded_is_refused_alone(hub: MemoryHub):
    server = Server(hub)
    client = hub.join("client")
    async with Requester(client) as requests:
        broken = requests.send(keys.BLOCK, block("half", of="\udcff"))
        whole = requests.send(keys.BLOCK, block("whole"))

        with pytest.raises(RequestRefused):
            await broken.outcome
        assert (await whole.outcome).id == "whole"

    assert server.taken == [block("whole")]
    await server.die(hub)


async def test_ten_thousand_requests_at_once_come_as_the_server_keeps_up_each_once_and_in_order(hub: MemoryHub):
    """Also beside those that have no encoded form, and those that are cancelled while they wait."""
    server = Server(hub)
    async with Requester(hub.join("client")) as requests:
        before = hub.sent
        asked = [
            requests.send(keys.BLOCK, block(f"b{number}", of="" if number % 100 != 7 else "\ud800"))
            for number in range(10_000)
        ]
        first = hub.sent - before
        for number in range(9_000, 9_100):
            requests.cancel(f"b{number}")
        ends = await asyncio.gather(*(pending.outcome for pending in asked), return_exceptions=True)

    refused = {number for number, end in enumerate(ends) if isinstance(end, RequestRefused)}
    assert refused == {*range(7, 10_000, 100), *range(9_000, 9_100)}
    assert first == Patience().window
    assert server.taken == [block(f"b{number}") for number in range(10_000) if number not in refused]
    await server.die(hub)


async def test_an_id_that_is_too_long_is_refused_and_not_remembered(hub: MemoryHub):
    """Our own requester does not even send it."""
    server, client, long = Server(hub), hub.join("client"), "x" * (LONGEST + 1)
    states = client.subscribe(keys.ANY_REQUEST_STATE)
    async with Requester(client) as requests:
        with pytest.raises(RequestRefused, match=f"an id of {LONGEST + 1} letters; at most {LONGEST}"):
            await (pending := requests.send(keys.BLOCK, block(long))).outcome
    assert (pending.key, pending.request) == (keys.BLOCK, block(long))  # who logs the refusal says what was refused
    assert len(states) == 0

    command(client, keys.BLOCK, block(long))
    told = await states.next()

    assert told is not None
    assert isinstance(told.message, Refused)
    assert told.message.id == long
    assert server.desk._serving._known == {}
    await server.die(hub)

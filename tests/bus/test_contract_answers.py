"""The contract, second part: questions and their answers, and payloads that are none."""

import asyncio

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import Block, PerformBlock
from engage_hri.schemas.faults import Fault, InputRefused, NoReply
from engage_hri.schemas.messages import encode, encode_json, encoding_of
from engage_hri.schemas.requests import Accepted, Cancel, KeepAlive, Kept, Request
from engage_hri.services.bus.interface import Bus, Received, Subscription
from engage_hri.services.requests.ends import RequestDesk
from tests.bus.places import Place, echo, messages, numbers, state, take

pytestmark = pytest.mark.each_bus


@pytest.mark.parametrize("apart", [True, False])
async def test_a_question_is_answered_or_refused_with_the_servers_fault(place: Place, apart: bool):
    process = await place.process()
    server = process.join("server")
    client = (await place.process() if apart else process).join("client")
    server.answer(keys.DESCRIBE, echo)

    assert await client.query(keys.DESCRIBE, Accepted(id="a")) == Accepted(id="a!")
    with pytest.raises(InputRefused) as refused:
        await client.query(keys.DESCRIBE, Accepted(id="bad"))
    assert refused.value.fault == Fault(reason="bad indeed", where="here")


async def test_a_question_nobody_answers_fails_at_its_timeout(place: Place):
    client = (await place.process()).join("client")
    await place.process()
    asked = client.now()

    with pytest.raises(NoReply, match="describe"):
        await client.query(keys.DESCRIBE, Accepted(id="a"), timeout=0.2)

    assert client.now() - asked == pytest.approx(0.2, abs=0.1 if place.is_real else 1e-9)


async def test_a_question_asked_too_early_is_answered_once_the_server_stands(place: Place):
    client, server = (await place.process()).join("client"), (await place.process()).join("server")

    asking = asyncio.create_task(client.query(keys.DESCRIBE, Accepted(id="a"), timeout=5.0), name="asking")
    await asyncio.sleep(0)
    server.answer(keys.DESCRIBE, echo)

    assert await asking == Accepted(id="a!")


async def test_a_server_that_has_left_answers_no_more(place: Place):
    client, server = (await place.process()).join("client"), (await place.process()).join("server")
    server.answer(keys.DESCRIBE, echo)
    assert await client.query(keys.DESCRIBE, Accepted(id="a")) == Accepted(id="a!")

    await server.leave()

    with pytest.raises(NoReply):
        await client.query(keys.DESCRIBE, Accepted(id="a"), timeout=0.2)


@pytest.mark.parametrize(
    ("payload", "encoding"),
    [
        (b"\xc1garbage", "application/msgpack"),
        (b"{", "application/json"),
        (b'{"type":"accepted"}', "application/json"),
        (b'{"type":"no such thing"}', "application/json"),
        (encode(Accepted(id="x")), "application/msgpack;engage.Accepted/2"),
        (encode(Accepted(id="x")), "image/png"),
        (b"", "zenoh/bytes"),
        (b"<bml><speech", "application/xml"),
        (b"<html/>", "text/xml"),
    ],
)
async def test_a_bad_payload_is_answered_with_a_fault_and_harms_nobody(place: Place, payload: bytes, encoding: str):
    here = (await place.process()).join("here")
    await place.process()
    inbox, faults = here.subscribe(keys.BLOCK), here.subscribe(keys.ANY_FAULT)

    await place.inject(keys.BLOCK, payload, encoding)
    [fault] = await messages(faults)
    await place.inject(keys.BLOCK, encode(state(1)), encoding_of(state(1)))

    assert numbers(await messages(inbox)) == [1]
    assert isinstance(fault, Fault)
    assert fault.service == "here"
    assert keys.BLOCK in fault.where


async def test_other_programs_may_speak_json_without_saying_who_they_are(place: Place):
    here = (await place.process()).join("here")
    await place.process()
    inbox = here.subscribe(keys.commands("realizer"))

    await place.inject(keys.cancel("realizer"), encode_json(Cancel(id="a", requester="me")), "application/json")

    [received] = await take(inbox)
    assert received.message == Cancel(id="a", requester="me")
    assert received.source == ""


@pytest.mark.parametrize("encoding", ["application/xml", "text/xml;engage.PerformBlock/1"])
async def test_other_programs_may_send_bml_as_it_is(place: Place, encoding: str):
    here = (await place.process()).join("here")
    await place.process()
    inbox = here.subscribe(keys.commands("realizer"))
    bml = b'<bml id="b1"><speech id="s1"><text>Hello.</text></speech></bml>'

    await place.inject(keys.command(keys.BLOCK, "manager", "me"), bml, encoding)

    [request] = await messages(inbox)
    assert isinstance(request, PerformBlock)
    assert (request.id, request.block.id, request.requester) == ("b1", "b1", "me")
    assert [behavior.id for behavior in request.block.behaviors] == ["s1"]


@pytest.mark.each_bus(shared=False)  # a stranger has a session of its own
@pytest.mark.parametrize("copies", [False, True])
async def test_a_request_is_cancelled_changed_and_renewed_only_by_who_has_asked(place: Place, copies: bool):
    """A stranger with a session of its own speaks in the client's name; he may have copied its life, too."""
    server = (await place.process()).join("realizer")
    client, stranger = (await place.process()).join("client"), (await place.process()).join("stranger")
    stopped: list[str] = []
    desk = RequestDesk(server, "realizer", lambda cancel: stopped.append(cancel.id))
    inbox = server.subscribe(*RequestDesk.patterns("realizer"))
    faults = stranger.subscribe(keys.fault("realizer"))
    life = client.new_life() if copies else "monday"
    block = PerformBlock(id="b", requester="client", life=life, lease=60.0, block=Block(id="b"))
    cancel = Cancel(id="b", requester="client", life=life)
    key, stop = (keys.command(each, "manager", "client") for each in (keys.BLOCK, keys.cancel("realizer")))

    asked = await known_to(inbox, client, key, block)
    assert desk.take(asked) == block
    await known_to(
        inbox, stranger, keys.command(keys.BLOCK, "manager", "stranger"), PerformBlock(id="s", block=Block(id="s"))
    )
    stranger.publish(stop, cancel)
    stranger.publish(key, replace(block, block=Block(id="c")))
    stranger.publish(keys.command(keys.keep_alive("realizer"), "manager", "client"), kept(life, stranger))
    assert [desk.take(received) for received in await take(inbox, 3)] == [None] * 3
    for fault in await messages(faults, 3):
        assert "another process" in fault.reason
    assert desk.is_live("b")

    client.publish(stop, cancel)
    [withdrawn] = await take(inbox)
    assert desk.take(withdrawn) == cancel
    desk.close()


async def known_to(inbox: Subscription, bus: Bus, key: str, request: Request) -> Received:
    """Send a request until it is not from the past: who did not know the server yet sends again, as clients do."""
    while True:
        bus.publish(key, request)
        [asked] = await take(inbox)
        if not asked.past:
            return asked


def kept(life: str, bus: Bus) -> KeepAlive:
    live = (Kept("perform_block", "b", 9, "", 1e6),)
    return KeepAlive(live=live, at=bus.stamp(), requester="client", life=life)

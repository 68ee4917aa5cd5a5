"""The serving side by itself: what it knows a request by, what it hands over, and what it answers."""

import asyncio
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Wait
from engage_hri.schemas.blocks import Block, BlockOutcome, InterruptBehavior, PerformBlock
from engage_hri.schemas.body import PerformBehavior
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.messages import encode_json
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.requests import Accepted, Cancel, Heard, KeepAlive, Kept, Outdated, Refused, Request
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.bus.samples import read_payload
from engage_hri.services.requests.asking import Asking, Patience, RequestRefused, TellEnd
from engage_hri.services.requests.asking import PublishCommand as AskedToPublish
from engage_hri.services.requests.serving import LIFELESS_KEPT, Hand, Names, PublishAnswer, Serving, ServingFault
from tests.bus.performer import Server
from tests.commanding import key_of

BLOCK = PerformBlock(id="a", requester="me", life="1", block=Block(id="b"))
OTHER = replace(BLOCK, block=Block(id="c"))
INTERRUPT = InterruptBehavior(id="a", requester="me", life="1", block="b", behavior="w")
BEHAVIOR = PerformBehavior(id="a", requester="me", life="1", block="b", behavior=Wait(id="w"), through="start")
DONE = BlockOutcome(id="a", block="b", status="done")


def handed(effects: list[Any]) -> list[Request]:
    return [each.request for each in effects if isinstance(each, Hand)]


def told(effects: list[Any]) -> list[Any]:
    return [each.answer for each in effects if isinstance(each, PublishAnswer)]


def test_an_answer_names_requester_life_kind_and_id() -> None:
    serving = Serving("realizer")
    serving.take(BLOCK, 0.0)

    for answer in (Accepted(id="a"), DONE):
        (said,) = told(serving.answer("a", answer, 0.0))
        assert (said.requester, said.life, said.kind, said.id) == ("me", "1", "perform_block", "a")


def test_what_comes_again_is_heard_then_answered_with_the_last_state() -> None:
    serving = Serving("realizer")
    assert handed(serving.take(BLOCK, 0.0)) == [BLOCK]
    kinds = []
    for answer in (None, Accepted(id="a"), DONE):
        if answer is not None:
            serving.answer("a", answer, 0.0)
        again = serving.take(replace(BLOCK, revision=3), 0.0)
        assert handed(again) == []
        kinds += [type(each) for each in told(again)]

    assert kinds == [Heard, Accepted, BlockOutcome]


def test_other_content_under_a_live_id_is_ignored_and_told_unless_its_kind_allows_it() -> None:
    serving = Serving("realizer")
    serving.take(BLOCK, 0.0)
    different = serving.take(OTHER, 0.0)
    assert handed(different) == []
    assert [each.fault.reason for each in different if isinstance(each, ServingFault)] == [
        "a live perform_block of this id has other content, and that counts"
    ]

    control = Serving("control")
    control.take(BEHAVIOR, 0.0)
    further = replace(BEHAVIOR, revision=1, through="end")
    assert handed(control.take(further, 0.0)) == [further]
    assert handed(control.take(BEHAVIOR, 0.0)) == []


def test_a_live_id_for_another_kind_is_refused_by_name_and_the_live_one_goes_on() -> None:
    serving = Serving("realizer")
    serving.take(BLOCK, 0.0)

    (refusal,) = told(serving.take(INTERRUPT, 0.0))

    assert (refusal.kind, refusal.fault.reason) == ("interrupt_behavior", "'a' is the id of a live perform_block")
    assert serving.is_live("a")
    (refusal,) = told(serving.take(Cancel(id="a", requester="me", life="1", of="interrupt_behavior"), 0.0))
    assert refusal.kind == "interrupt_behavior"
    assert refusal.fault.advice == "`of` is the kind of what it ends: perform_block"
    assert serving.is_live("a")


def test_what_has_ended_is_remembered_though_its_id_is_used_for_another_kind() -> None:
    serving = Serving("realizer")
    serving.take(BLOCK, 0.0)
    serving.answer("a", DONE, 0.0)
    assert [each.id for each in handed(serving.take(INTERRUPT, 0.0))] == ["a~2"]
    serving.answer("a~2", Refused(id="a~2", fault=Fault(reason="no")), 0.0)
    serving.take(Cancel(id="a", requester="me", life="1", of="nothing"), 0.0)

    (again,) = told(serving.take(BLOCK, 1.0))

    assert isinstance(again, BlockOutcome)


def test_another_requester_and_another_life_are_other_requests_with_names_of_their_own() -> None:
    serving = Serving("realizer")
    names = [
        handed(serving.take(replace(BLOCK, requester=who, life=life), 0.0))[0].id
        for who, life in (("me", "1"), ("you", "1"), ("me", "2"))
    ]
    assert names == ["a", "a~2", "a~3"]
    (said,) = told(serving.answer("a~2", Accepted(id="a~2"), 0.0))
    assert (said.id, said.requester) == ("a", "you")


@pytest.mark.parametrize(("wait", "is_new"), [(LIFELESS_KEPT, False), (LIFELESS_KEPT + 0.1, True)])
def test_without_a_life_an_ended_id_is_new_again_after_a_while(wait: float, is_new: bool) -> None:
    serving = Serving("realizer")
    lifeless = replace(BLOCK, life="")
    serving.take(lifeless, 0.0)
    serving.answer("a", DONE, 5.0)

    assert bool(handed(serving.take(lifeless, 5.0 + wait))) == is_new


def test_without_a_life_other_content_after_the_end_is_a_new_request_and_with_one_it_is_not() -> None:
    for life, is_new in (("", True), ("1", False)):
        serving = Serving("realizer")
        serving.take(replace(BLOCK, life=life), 0.0)
        serving.answer("a", DONE, 0.0)
        assert bool(handed(serving.take(replace(OTHER, life=life), 0.0))) == is_new


@pytest.mark.parametrize("of", ["perform_block", ""])
def test_a_request_whose_cancellation_came_first_is_refused_under_its_own_kind(of: str) -> None:
    serving = Serving("realizer")
    (refusal,) = told(serving.take(Cancel(id="a", requester="me", life="1", of=of), 0.0))
    assert isinstance(refusal, Refused)

    late = serving.take(BLOCK, 0.1)

    assert handed(late) == []
    assert [(type(each), each.kind) for each in told(late)] == [(Refused, "perform_block")]


def keep(*live: Kept) -> KeepAlive:
    return KeepAlive(live=live, at=Stamp("w", 0.0), requester="me", life="1")


def test_a_keep_alive_renews_grants_authority_and_finds_lost_content() -> None:
    serving = Serving("control")
    serving.take(replace(BEHAVIOR, lease=5.0), 0.0)
    serving.answer("a", Accepted(id="a"), 0.0)
    assert serving.deadline == 5.0

    effects = serving.keep_alive(keep(Kept("perform_behavior", "a", 2, "end", 5.0)), 3.0, 3.0)

    assert [each.through for each in handed(effects) if isinstance(each, PerformBehavior)] == ["end"]
    assert [type(each) for each in told(effects)] == [Outdated]
    assert not serving.tick(5.0)
    assert serving.deadline == 8.0
    (cancel,) = handed(serving.tick(8.0))
    assert isinstance(cancel, Cancel)
    assert cancel.cause == "unrenewed"


@pytest.mark.parametrize("kept", [Kept("perform_behavior", "x", 0, "", 5.0), Kept("go_home", "a", 0, "", 5.0)])
def test_a_keep_alive_of_what_is_not_known_is_refused(kept: Kept) -> None:
    serving = Serving("control")
    serving.take(BEHAVIOR, 0.0)

    (refusal,) = told(serving.keep_alive(keep(kept), 0.0, 0.0))

    assert isinstance(refusal, Refused)
    assert (refusal.id, refusal.kind) == (kept.id, kept.kind)


@pytest.mark.parametrize("lease", [0.0, -1.0, float("inf"), float("nan")])
def test_a_request_without_a_lease_has_that_of_its_server(lease: float) -> None:
    serving = Serving("control", 5.0)
    serving.take(replace(BEHAVIOR, lease=lease), 1.0)
    assert serving.deadline == 6.0


def test_names_are_unique_and_forgotten_in_the_order_of_their_use() -> None:
    names = Names(kept=3)
    assert [names.unique(id) for id in ("a", "b", "a", "a~2")] == ["a", "b", "a~2", "a~2~2"]
    for id in "xyz":
        names.unique(id)
    assert names.unique("a") == "a"


def test_an_answer_of_another_server_or_to_somebody_else_is_not_believed() -> None:
    asking = Asking("me", "1", Patience())
    asking.send(keys.BLOCK, PerformBlock(id="a", block=Block(id="b")), 0.0)
    true = Refused(id="a", requester="me", life="1", kind="perform_block", fault=Fault(reason="no"))
    for answer, server in (
        (true, "mallory"),
        (replace(true, requester="you"), "realizer"),
        (replace(true, life="2"), "realizer"),
        (replace(true, kind="interrupt_behavior"), "realizer"),
        (replace(true, id="x"), "realizer"),
    ):
        assert asking.hear(answer, 0.0, server) == []

    (end,) = asking.hear(true, 0.0, "realizer")
    assert isinstance(end, TellEnd)
    assert isinstance(end.end, RequestRefused)


@pytest.mark.parametrize("message", [PeerGone(participant="x"), PeerAlive(participant="x", run="1")])
async def test_presence_is_no_payload(hub: MemoryHub, message: Any) -> None:
    payload = encode_json(message)
    with pytest.raises(InputRefused, match="it is never sent"):
        read_payload(payload, "application/json", key_of(hub.join("me"), keys.BLOCK), "")
    with pytest.raises(TypeError, match="never sent"):
        hub.join("you").publish(keys.WORLD, message)


def test_a_live_name_is_never_given_away() -> None:
    serving = Serving("generation")
    serving.take(BLOCK, 0.0)
    for number in range(5000):
        serving.take(replace(BLOCK, id=f"x{number}"), 0.0)
        serving.answer(f"x{number}", Refused(id="", fault=Fault(reason="no")), 0.0)

    (second,) = handed(serving.take(replace(BLOCK, requester="you"), 0.0))

    assert second.id == "a~2"


def test_a_request_that_takes_longer_than_it_may_is_cancelled_once() -> None:
    asking = Asking("me", "1", Patience())
    asking.send(keys.BLOCK, PerformBlock(id="a", block=Block(id="b")), 0.0, within=2.0)
    asking.hear(Accepted(id="a", requester="me", life="1", kind="perform_block"), 0.1, "realizer")
    effects = [each for tenth in range(2, 21) for each in asking.tick(tenth / 10)]  # it does not stand still
    cancelled = [each.message for each in effects if isinstance(each, AskedToPublish)]

    assert [(type(each), each.reason) for each in cancelled if isinstance(each, Cancel)] == [
        (Cancel, "it has taken too long")
    ]


@pytest.mark.parametrize("lease", [1e-12, 1e-6])
def test_a_tiny_lease_floods_nobody(lease: float) -> None:
    asking = Asking("me", "1", Patience(lease=lease))
    asking.send(keys.BLOCK, PerformBlock(id="a", block=Block(id="b")), 1e6)
    asking.hear(Accepted(id="a", requester="me", life="1", kind="perform_block"), 1e6, "realizer")

    assert len(asking.tick(1e6 + 1.0)) < 30


async def test_a_damaged_repetition_of_a_request_changes_nothing_of_what_became_of_it(hub: MemoryHub) -> None:
    server = Server(hub)
    await asyncio.sleep(0)
    payload = encode_json(PerformBlock(id="b", life="1", block=Block(id="b")))
    damaged = payload.replace(b'"block":{', b'"block":[{').replace(b"}}", b"}]}")
    with hub.join("ear").subscribe(keys.ANY_REQUEST_STATE) as states:
        for content in (damaged, payload, damaged):
            hub.inject(keys.command(keys.BLOCK, "manager", "me"), content, "application/json")
            await asyncio.sleep(0.1)
        await asyncio.sleep(1.0)
        hub.inject(keys.command(keys.BLOCK, "manager", "me"), damaged, "application/json")
        await asyncio.sleep(0.1)
        told = [type((await states.next()).message).__name__ for _ in range(len(states))]  # type: ignore[union-attr]

    assert told == ["Refused", "Accepted", "BlockOutcome", "BlockOutcome"]
    await server.die(hub)


def test_a_cancellation_without_a_kind_means_what_is_live_not_what_was_stopped_long_ago() -> None:
    serving = Serving("realizer")
    stop = Cancel(id="a", requester="me")
    lifeless = replace(BLOCK, life="")
    serving.take(stop, 0.0)
    serving.take(lifeless, 20.0)
    serving.answer("a~2", Accepted(id="a~2"), 20.0)

    (cancel,) = handed(serving.take(stop, 40.0))

    assert (type(cancel), cancel.id) == (Cancel, "a~2")


def test_the_first_request_of_a_new_life_may_come_before_its_token() -> None:
    serving = Serving("realizer")
    serving.requester_there("me", "1", 0.0)
    serving.take(replace(BLOCK, id="old", life="@1.1"), 1.0)
    serving.take(replace(BLOCK, life="@2.1"), 2.0)

    ended = handed(serving.requester_there("me", "2", 2.1))

    assert [each.id for each in ended] == ["old"]
    assert serving.is_live("a")


def test_many_names_that_look_like_ours_are_no_trouble() -> None:
    names = Names()
    taken, id = set(), "x"
    for _ in range(1500):
        taken.add(names.unique(id))
        id += "~2"

    assert names.unique("x") not in taken


async def test_damaged_xml_says_nothing_else_of_a_live_request_than_what_became_of_it(hub: MemoryHub) -> None:
    server = Server(hub)
    await asyncio.sleep(0)
    key, xml = keys.command(keys.BLOCK, "manager", "me"), '<bml id="b"/>'
    with hub.join("ear").subscribe(keys.ANY_REQUEST_STATE) as states:
        for content in (xml, '<bml id="b"><gaze/></gaze></bml>', xml):
            hub.inject(key, content.encode(), "application/xml")
            await asyncio.sleep(0.1)
        await asyncio.sleep(1.0)
        told = [type((await states.next()).message).__name__ for _ in range(len(states))]  # type: ignore[union-attr]

    assert "Refused" not in told
    assert told[-1] == "BlockOutcome"
    await server.die(hub)

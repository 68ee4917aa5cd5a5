"""Requests that have ended: how long they are remembered, what they cost, and that none is performed twice."""

import tracemalloc

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Gaze, Speech
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.faults import OutcomeUnknown
from engage_hri.schemas.messages import decode, encode
from engage_hri.schemas.requests import Accepted
from engage_hri.services.bus.deadlines import FORGOTTEN_AFTER
from engage_hri.services.requests.asking import ASLEEP, Asking, Patience, PublishCommand, TellEnd
from engage_hri.services.requests.serving import Serving
from tests.requests.test_serving import BLOCK, DONE, handed, told


def ended(now: float = 0.0) -> Serving:
    """A server that has performed a block."""
    serving = Serving("realizer")
    serving.take(BLOCK, now)
    serving.answer("a", DONE, now)
    return serving


def test_a_request_that_ended_is_not_performed_again_for_as_long_as_is_stated() -> None:
    serving = ended(0.0)
    again = serving.take(BLOCK, FORGOTTEN_AFTER - 1)

    assert handed(again) == []
    assert [type(each) for each in told(again)] == [BlockOutcome]


def test_who_goes_on_asking_is_remembered_and_nobody_else() -> None:
    serving = ended(0.0)
    other = replace(BLOCK, id="other")
    serving.take(other, 0.0)
    serving.answer("other", replace(DONE, id="other"), 0.0)
    for number in range(1, 10):
        assert handed(serving.take(BLOCK, number * 0.9 * FORGOTTEN_AFTER)) == []

    assert serving.asked("a") == BLOCK
    assert serving.asked("other") is None


def test_a_live_request_is_never_forgotten() -> None:
    serving = Serving("realizer")
    serving.take(BLOCK, 0.0)
    serving.answer("a", Accepted(id="a"), 0.0)
    serving.take(replace(BLOCK, id="other"), 100 * FORGOTTEN_AFTER)

    assert serving.is_live("a")


def test_what_is_remembered_is_what_came_and_what_was_answered() -> None:
    serving = ended()

    assert serving.asked("a") == BLOCK
    assert told(serving.take(BLOCK, 1.0)) == told(serving.take(BLOCK, 2.0)) != []


@pytest.mark.parametrize("words", [1, 40, 400])
def test_its_memory_is_bounded_by_the_bytes_that_it_truly_takes(words: int) -> None:
    serving, number = Serving("realizer"), 1000
    behaviors = (Speech(id="s", text="hello you " * words), Gaze(id="g", target="cup"))
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for k in range(number):
        id = f"client-2dd550c3/block-{k}#{k}"
        block = Block(id=f"block-{k}", behaviors=behaviors)
        asked = PerformBlock(id=id, requester="client-2dd550c3", life=f"@life{k}", block=block)
        serving.take(decode(encode(asked)), 0.0, "process")  # type: ignore[arg-type]
        serving.answer(id, BlockOutcome(id=id, block=block.id, status="done"), 0.0)
    taken = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()

    assert 0.7 * taken < serving.remembered < 1.3 * taken


def test_who_was_asleep_for_long_sends_nothing_again_and_says_that_nobody_knows_what_became_of_it() -> None:
    for asleep, kinds in ((ASLEEP - 1, {PublishCommand}), (ASLEEP + 1, {TellEnd, PublishCommand})):
        asking = Asking("me", "1", Patience(silence=2 * ASLEEP))
        asking.server_there("realizer", "r", 0.0)
        asking.send(keys.BLOCK, BLOCK, 0.0)
        effects = asking.tick(asleep)

        assert {type(each) for each in effects} == kinds
        sent = [each.message for each in effects if isinstance(each, PublishCommand)]
        assert any(isinstance(each, PerformBlock) for each in sent) == (asleep < ASLEEP)
        assert all(isinstance(each.end, OutcomeUnknown) for each in effects if isinstance(each, TellEnd))

"""What is larger than its key allows is refused at the sender, with the number, on both buses."""

import logging

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.access import LONGEST_ENCODING, LONGEST_KEY, check_size, most
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.messages import Message, published
from engage_hri.schemas.requests import Accepted
from engage_hri.services.bus.zenoh.hub import ZenohHub
from tests.bus.places import PATIENCE, Place, heard, matched, messages, state

pytestmark = pytest.mark.each_bus
ANSWERED = keys.request_state("there")


def of_size(key: str, size: int) -> Accepted:
    """A message that has this many bytes on the wire."""
    beside = len(published(key, Accepted(id="x" * 1000))[0]) - 1000 + (2 if size > 2**16 else 0)
    return Accepted(id="x" * (size - beside))


@pytest.mark.parametrize("key", [ANSWERED, keys.fault("there"), keys.WORLD, keys.FEEDBACK])
async def test_a_message_is_sent_at_its_bound_and_refused_with_one_byte_more(place: Place, key: str):
    hub = await place.process()
    there, here = hub.join("there"), (await place.process()).join("here")
    inbox = here.subscribe(key)
    if isinstance(hub, ZenohHub):
        await matched(hub, key)  # of a state what goes before may be skipped
    largest = of_size(key, most(key))
    assert len(published(key, largest)[0]) == most(key)

    there.publish(key, state(1))
    there.publish(key, largest)
    with pytest.raises(InputRefused, match=rf"{key}: {most(key) + 1} bytes; at most {most(key)} may be sent"):
        there.publish(key, Accepted(id=largest.id + "x"))
    there.publish(key, state(2))

    came = [message.id for message in await messages(inbox, 3)]
    assert came == ["1", largest.id, "2"]


async def test_a_stream_that_is_too_large_is_not_sent_and_told_once(place: Place, caplog: pytest.LogCaptureFixture):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    key = keys.head_pose("ann")
    inbox = here.subscribe(key)
    assert await heard(there, key, state(1), inbox) == state(1)

    with caplog.at_level(logging.WARNING):
        for _ in range(3):
            there.publish(key, Accepted(id="x" * (most(key) + 1)))
    assert len([each for each in caplog.messages if "not sent" in each and "bytes; at most" in each]) == 1

    while (await heard(there, key, state(2), inbox)) != state(2):
        pass  # what of the first was still on its way


async def test_a_question_and_an_answer_that_are_too_large_are_refused_to_who_asks(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    key = keys.DESCRIBE
    asked: list[Message] = []

    def answer(question: Message) -> Message:
        asked.append(question)
        return Accepted(id="x" * (most(key) + 1))

    there.answer(key, answer)
    with pytest.raises(InputRefused, match=rf"{key}: \d+ bytes; at most {most(key)} may be sent"):
        await here.query(key, Accepted(id="x" * (most(key) + 1)), PATIENCE)
    assert not asked
    with pytest.raises(InputRefused, match=rf"{key}: \d+ bytes; at most {most(key)} may be sent"):
        await here.query(key, state(1), PATIENCE)
    assert asked == [state(1)]


async def test_a_key_that_zenoh_cannot_carry_is_refused_and_the_link_stays(place: Place):
    there, here = (await place.process()).join("there"), (await place.process()).join("here")
    inbox = here.subscribe(keys.ANY_FAULT)

    with pytest.raises(InputRefused, match=rf"a key of \d+ bytes; at most {LONGEST_KEY} may be sent"):
        there.publish(keys.fault("x" * 66_000), state(1))
    there.publish(keys.fault("there"), state(2))

    assert await messages(inbox) == [state(2)]


def test_the_name_of_an_encoding_that_makes_zenoh_panic_is_refused() -> None:
    check_size(keys.WORLD, b"", "x" * LONGEST_ENCODING)
    with pytest.raises(InputRefused, match="the name of an encoding has 256 bytes; at most 255 may be sent"):
        check_size(keys.WORLD, b"", "x" * (LONGEST_ENCODING + 1))

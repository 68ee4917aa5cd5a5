"""What the hostile peer makes, by itself."""

from collections import Counter
from random import Random

import msgspec
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.messages import Message, encode
from engage_hri.schemas.requests import Cancel
from engage_hri.services.bus.samples import read_payload
from tests.rigs.hostile.markup import document
from tests.rigs.hostile.payloads import Payloads
from tests.rigs.hostile.typed import KINDS, RandomMessages, Words, distorted

ENTITIES = ("cup", "ann")


@pytest.mark.parametrize("kind", KINDS)
def test_every_message_of_the_union_can_be_made_and_most_decode_again(kind: str) -> None:
    typed, good = RandomMessages(Random(1), Words()), 0
    for _ in range(60):
        message = typed.message(1.0, kind)
        assert type(message).__name__ == kind
        try:
            msgspec.msgpack.decode(encode(message), type=Message)
            good += 1
        except msgspec.ValidationError:
            pass

    assert good >= 15


def test_names_that_were_heard_come_back() -> None:
    words = Words()
    words.hear(Cancel(id="live-1", requester="client", of="perform_block"))
    typed = RandomMessages(Random(2), words)

    ids = [getattr(typed.message(0.0, "Cancel"), "id") for _ in range(40)]  # noqa: B009

    assert ids.count("live-1") > 10


def test_a_distorted_message_differs_in_one_place() -> None:
    message = Cancel(id="1", requester="r", of="perform_block")

    assert all(distorted(Random(seed), message) != msgspec.to_builtins(message) for seed in range(30))


def test_payloads_are_of_all_kinds_good_and_bad_and_nothing_but_a_refusal_comes_of_the_bad() -> None:
    payloads, seen = Payloads(Random(3), RandomMessages(Random(4), Words()), ENTITIES), Counter[str]()
    for number in range(3000):
        payload = payloads.next(number / 100)
        keys.key_class(payload.key)
        seen[payload.kind] += 1
        try:
            read_payload(payload.data, payload.encoding, payload.key, "")
            seen["good"] += 1
        except InputRefused:
            seen["bad"] += 1

    assert seen["good"] > 1500
    assert seen["bad"] > 300
    assert set(KINDS) <= set(seen)


def test_mutated_markup_is_read_or_refused() -> None:
    chance, read = Random(5), 0
    for _ in range(400):
        try:
            decode_xml(document(chance, ENTITIES))
            read += 1
        except InputRefused:
            pass

    assert 40 < read < 390

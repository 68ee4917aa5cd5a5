"""The form of a message in a file: JSON for viewers, and the very bytes back whatever came."""

import math
import struct

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.messages import encode, encoding_of
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Stamp
from engage_hri.services.bus.interface import Sample
from engage_hri.services.recording.form import BYTES, JSON, MSGPACK, XML, StoredForm, kept, payload

PACKED = "application/msgpack;engage.Fault/1"


def there_and_back(data: bytes, encoding: str) -> tuple[str, bytes]:
    form = kept(Sample("key", data, encoding, "there", 0.0))
    return form.encoding, payload(form, encoding)


values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**64 - 1) | st.text() | st.floats(),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=12,
)


@given(values)
def test_every_message_pack_comes_back_to_the_byte(value: object) -> None:
    data = msgspec.msgpack.encode(value)

    assert there_and_back(data, PACKED)[1] == data


def test_a_message_with_many_fields_comes_back_through_its_type() -> None:
    at = Stamp("loop", 1.5)
    event = ConnectionEvent(
        id="a-dg-1", kind="directed_gaze", initiator="robot", responder="ann", state="started", at=at, started=at
    )  # fmt: skip
    data = encode(event)
    form = kept(Sample("key", data, encoding_of(event), "there", 0.0))

    assert (form.encoding, form.is_typed) == (JSON, True)
    assert payload(form, encoding_of(event)) == data


@given(st.binary(), st.sampled_from([PACKED, "application/json", "application/xml", "", "image/png"]))
def test_all_bytes_come_back_whatever_they_are_called(data: bytes, encoding: str) -> None:
    assert there_and_back(data, encoding)[1] == data


def test_what_we_send_is_kept_as_json() -> None:
    data = msgspec.msgpack.encode({"type": "fault", "reason": "too far", "at": [0.1, -0.0, 1e300, 7]})

    assert kept(Sample("key", data, PACKED, "there", 0.0)) == StoredForm(
        JSON, b'{"type":"fault","reason":"too far","at":[0.1,-0.0,1e300,7]}'
    )


@pytest.mark.parametrize(
    ("data", "encoding", "form"),
    [
        (b"\xca" + struct.pack(">f", 0.5), PACKED, MSGPACK),  # a short float, which we never send
        (b"\xcd\x00\x01", PACKED, MSGPACK),  # a long number
        (msgspec.msgpack.encode(math.inf), PACKED, MSGPACK),
        (msgspec.msgpack.encode(b"bytes"), PACKED, MSGPACK),
        (b"\xc1", PACKED, BYTES),
        (b'{"a": 1}', "application/json;engage.Fault/1", JSON),
        (b"{", "application/json", BYTES),
        (b"<bml/>", "application/xml", XML),
    ],
)
def test_what_json_would_change_is_kept_as_it_came(data: bytes, encoding: str, form: str) -> None:
    assert there_and_back(data, encoding) == (form, data)

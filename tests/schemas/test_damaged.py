"""Whatever bytes come, a reader returns what they say or refuses them: no other exception leaves it."""

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, get_args

import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from engage_hri.schemas.documents import json_codec
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.messages import Message, decode, encode, encode_json
from engage_hri.schemas.participants import Step
from engage_hri.schemas.references import is_id
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.text import utf8
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.simulation.still import EXAMPLE, load_world
from tests.random_cases import share_of

FORMS: dict[str, Callable[[Message], bytes]] = {"application/json": encode_json, "application/msgpack": encode}
XML = b'<bml id="b">\n<speech id="s">caf\xc3\xa9 <sync id="m"/></speech><gaze id="g" target="cup" start="s:m"/></bml>'
JSON = b'{"turn_status": "full",\n"parts": [{"say": "caf\xc3\xa9"}, {"refer": "cup"}]}'
TOML = 'robot = "café"\n[realizer]\nlate = 0.5\n'.encode()

st.register_type_strategy(Step, st.builds(Step, content=st.none() | st.text(max_size=9)))
"""What a ledger holds is of types of each service."""


@st.composite
def messages(draw: st.DrawFn) -> Message:
    return draw(st.builds(draw(st.sampled_from(get_args(Message)))))  # type: ignore[no-any-return]


@st.composite
def damaged(draw: st.DrawFn, good: bytes) -> bytes:
    """Some bytes changed, left out or put in between."""
    bytes_ = bytearray(good)
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(0, len(bytes_) - 1)))
        more = draw(
            st.sampled_from([b"", b"\xe9", b"\xff", b"\xed\xa0\x80", b"\xc3", b'"', b"{", b"\0"])
            | st.binary(max_size=3)
        )
        bytes_[at : at + draw(st.integers(0, 2))] = more
    return bytes(bytes_)


@settings(max_examples=share_of(400), suppress_health_check=[HealthCheck.too_slow, HealthCheck.filter_too_much])
@given(message=messages(), form=st.sampled_from(list(FORMS)), data=st.data())
def test_a_damaged_message_is_a_message_or_is_refused(message: Message, form: str, data: st.DataObject) -> None:
    try:
        good = FORMS[form](message)
    except (OverflowError, UnicodeEncodeError):
        assume(False)
    try:
        found = decode(data.draw(damaged(good)), form)
    except InputRefused:
        return

    assert isinstance(found, get_args(Message))


@pytest.mark.parametrize(
    ("payload", "form"),
    [
        (b'{"type":"cancel","id":"\xe9","requester":"x"}', "application/json"),
        (encode(Cancel(id="abc", requester="x")).replace(b"abc", b"a\xe9c"), "application/msgpack"),
        (encode(Cancel(id="abc", requester="x")).replace(b"abc", b"\xed\xa0\x80"), "application/msgpack"),
    ],
)
def test_a_message_that_is_not_utf_8_is_refused_in_words(payload: bytes, form: str) -> None:
    with pytest.raises(InputRefused, match="not UTF-8"):
        decode(payload, form)


READERS: dict[str, tuple[Callable[[bytes], Any], bytes]] = {
    "json": (lambda data: json_codec.read(data, "f"), JSON),
    "xml": (lambda data: json_codec.read(data, "f"), XML),
    "xml alone": (lambda data: decode_xml(data, "f"), XML),
}


@settings(max_examples=share_of(300))
@pytest.mark.parametrize("reader", READERS)
@given(data=st.data())
def test_a_damaged_document_is_read_or_refused(reader: str, data: st.DataObject) -> None:
    read, good = READERS[reader]
    with suppress(InputRefused):
        read(data.draw(damaged(good)))


@settings(max_examples=share_of(200), suppress_health_check=[HealthCheck.function_scoped_fixture])
@pytest.mark.parametrize(("read", "good"), [(load, TOML), (load_world, EXAMPLE.encode())])
@given(data=st.data())
def test_a_damaged_file_is_read_or_refused(
    read: Callable[[Path], Any], good: bytes, data: st.DataObject, tmp_path: Path
) -> None:
    file = tmp_path / "file"
    file.write_bytes(data.draw(damaged(good)))
    with suppress(InputRefused):
        read(file)


def test_what_is_not_utf_8_is_refused_with_its_line() -> None:
    with pytest.raises(InputRefused) as refused:
        utf8(b"one\ntw\xe9", "f")

    assert str(refused.value) == "f, line 2: not UTF-8: byte 0xe9, unexpected end of data (save it as UTF-8)"
    assert utf8(b"\xef\xbb\xbfone") == "one"


def test_half_a_character_is_no_id_and_no_text() -> None:
    assert not is_id("caf\udce9")
    with pytest.raises(InputRefused, match="half a character"):
        json_codec.decode_json('{"id": "\ud800"}')

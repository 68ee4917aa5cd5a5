"""What comes over the bus as a block and is none: refused, with exactly one warning, and performed by nobody."""

import asyncio

import msgspec
import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.access import LARGEST_XML_SENT
from engage_hri.schemas.blocks import BlockOutcome, WarningFeedback
from engage_hri.schemas.requests import Refused
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.commandline.shell.roster import service
from engage_hri.services.realizer.together import planning
from engage_hri.services.runtime.service import running
from tests.realizer.stage import stage


async def _said_of(payload: bytes, encoding: str) -> list[object]:
    async with MemoryHub() as hub, running(hub, {"realizer": service("realizer", Config())}):
        with hub.join("test").subscribe(keys.FEEDBACK, keys.request_state("realizer")) as inbox:
            hub.inject(keys.BLOCK, payload, encoding)
            await asyncio.sleep(1)
            return [(await inbox.next()).message for _ in range(len(inbox))]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("payload", "encoding"),
    [
        (b"<bml id='b'><gaze", "application/xml"),
        (b"<bml><gaze id='g' target='human'/></bml>", "application/xml"),
        (b'<!DOCTYPE bml><bml id="b"/>', "text/xml"),
        (b"\xff\xfe", "application/xml"),
        (b"<html/>", "application/xml"),
        (b"{", "application/json"),
    ],
)
async def test_what_has_no_id_is_warned_of_once_as_nobodys(payload: bytes, encoding: str) -> None:
    (warning,) = await _said_of(payload, encoding)

    assert isinstance(warning, WarningFeedback)
    assert (warning.block, warning.kind, warning.behavior) == (None, "PARSING_FAILURE", "")


@pytest.mark.parametrize(
    "content",
    ['<gaze id="g" target="human" start="nobody:end"/>', '<gaze id="g" target="human" start="x"/>', "<gaze/>"],
)
async def test_a_bad_block_with_an_id_is_refused_by_it_and_warned_of_once(content: str) -> None:
    said = await _said_of(f'<bml id="b">\n{content}</bml>'.encode(), "application/xml")

    (refused,) = [each for each in said if isinstance(each, Refused)]
    (warning,) = [each for each in said if isinstance(each, WarningFeedback)]
    assert len(said) == 2
    assert (refused.id, refused.fault.line) == ("b", 2)
    assert (warning.block, warning.kind) == ("b", "PARSING_FAILURE")
    assert "line 2" in warning.message


@pytest.mark.parametrize(
    "spelled", ['<bml id="b">', "<?xml version='1.0'?>\n<!-- x --> <b:bml\n xmlns:b='u' id = 'b'>"]
)
async def test_xml_that_is_too_long_to_be_read_in_time_is_refused_unread_and_by_its_name(spelled: str) -> None:
    """It is not even parsed: what it holds is no XML."""
    payload = spelled.encode() + b"<" * LARGEST_XML_SENT
    said = await _said_of(payload, "application/xml")

    (refused,) = [each for each in said if isinstance(each, Refused)]
    (warning,) = [each for each in said if isinstance(each, WarningFeedback)]
    assert refused.id == warning.block == "b"
    assert refused.fault.reason == f"{len(payload)} bytes of XML; at most {LARGEST_XML_SENT} are read on the bus"
    assert "JSON" in refused.fault.advice


async def test_the_same_block_may_come_as_json(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(planning, "MOST_BEHAVIORS", 1500)
    behaviors = [_wait(f"wait-{number}", duration=0.0) for number in range(1500)]
    request = {"type": "perform_block", "id": "r", "requester": "me", "block": {"id": "b", "behaviors": behaviors}}
    payload = msgspec.json.encode(request)
    assert len(payload) > LARGEST_XML_SENT
    said = await _said_of(payload, "application/json;engage.PerformBlock/1")

    (outcome,) = [each for each in said if isinstance(each, BlockOutcome)]
    assert outcome.status == "done"


def _wait(id: str, **fields: object) -> dict[str, object]:
    return {"type": "wait", "id": id, "duration": 0.5, **fields}


@pytest.mark.parametrize("form", ["json", "msgpack"])
@pytest.mark.parametrize(
    ("behaviors", "reason"),
    [
        ([_wait("a"), _wait("a")], "duplicate id 'a'"),
        ([_wait("a b")], "may hold neither spaces"),
        ([_wait("")], "no id"),
        ([_wait("bml")], "reserved"),
        ([_wait("a", duration=-1)], "duration -1.0 is negative"),
        ([_wait("a", timing=[{"sync": "start", "ref": "1"}, {"sync": "start", "ref": "2"}])], "timed twice"),
        ([_wait("a", timing=[{"sync": "", "ref": "1"}])], "not a sync point"),
        ([_wait("a", timing=[{"sync": "start", "ref": "a:b:c:d:e"}])], "more than four parts"),
        ([{"type": "head", "id": "h", "lexeme": "NOD", "repetition": 0}], "repetition 0"),
        ([{"type": "speech", "id": "s", "text": "a", "marks": [{"id": "m", "position": 9}]}], "outside the text"),
        ([{"type": "speech", "id": "s", "text": "a", "marks": [{"id": "end", "position": 0}]}], "can't name a mark"),
    ],
)
async def test_what_is_wrong_with_a_block_is_the_same_however_it_is_sent(
    behaviors: list[dict[str, object]], reason: str, form: str
) -> None:
    request = {"type": "perform_block", "id": "r", "requester": "me", "block": {"id": "b", "behaviors": behaviors}}
    encode = msgspec.json.encode if form == "json" else msgspec.msgpack.encode
    said = await _said_of(encode(request), f"application/{form};engage.PerformBlock/1")

    (refused,) = [each for each in said if isinstance(each, Refused)]
    (warning,) = [each for each in said if isinstance(each, WarningFeedback)]
    assert len(said) == 2
    assert refused.id == "r"
    assert reason in refused.fault.reason
    assert (warning.block, warning.kind) == ("b", "PARSING_FAILURE")


@pytest.mark.parametrize(("block", "told"), [({"id": "b"}, "b"), ({}, None), ({"id": 3}, None), ("b", None)])
async def test_a_request_that_fits_no_schema_is_warned_of_by_its_block_or_by_none(
    block: object, told: str | None
) -> None:
    """The id of the request is no id of a block."""
    head = {"type": "head", "id": "h", "lexeme": "NOD", "amount": 5.0}
    content = {**block, "behaviors": [head]} if isinstance(block, dict) else block
    request = {"type": "perform_block", "id": "r-b-1", "requester": "me", "block": content}
    said = await _said_of(msgspec.json.encode(request), "application/json;engage.PerformBlock/1")

    (refused,) = [each for each in said if isinstance(each, Refused)]
    (warning,) = [each for each in said if isinstance(each, WarningFeedback)]
    assert refused.id == "r-b-1"
    assert (warning.block, warning.kind) == (told, "PARSING_FAILURE")


async def test_a_mark_that_looks_like_an_offset_is_known_as_such_however_it_is_sent() -> None:
    speech = {"type": "speech", "id": "s", "text": "one two", "marks": [{"id": "word-2", "position": 4}]}
    wait = {"type": "wait", "id": "w", "duration": 0, "timing": [{"sync": "start", "ref": "s:word-2"}]}
    block = {"id": "b", "behaviors": [speech, wait]}
    request = msgspec.json.encode({"type": "perform_block", "id": "r", "requester": "me", "block": block})
    async with stage() as seen:
        seen.hub.inject(keys.BLOCK, request, "application/json")
        await asyncio.sleep(10)

    times = seen.times()
    assert times["w:start"] == pytest.approx(times["s:word-2"])
    assert seen.warnings() == []

"""What comes over the bus as a block and is none: refused, with exactly one warning, and performed by nobody."""

import asyncio

import pytest

from schemas import keys
from schemas.feedback import WarningFeedback
from schemas.requests import Refused
from services.commandline.roster import service
from services.config import Config
from services.memory_bus import MemoryHub
from services.runtime import running


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

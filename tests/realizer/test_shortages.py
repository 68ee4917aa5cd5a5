"""What cannot be on time is told with what the body needs at least, and what there is; then it can be mended."""

import re

import pytest

from engage_hri.schemas.blocks import Block, WarningFeedback
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.services.control.config import Variability
from tests.realizer.test_simulated_body import robot

SHORT = [
    ('<gesture id="x" lexeme="BEAT" ready="{}"/>', 0.0, "from x:start to x:ready"),
    ('<gesture id="x" lexeme="BEAT" start="0" ready="{}"/>', 0.1, "from x:start to x:ready"),
    ('<head id="x" lexeme="NOD" start="0" end="{}"/>', 0.2, "from x:start to x:end"),
    (
        '<faceLexeme id="x" lexeme="BLINK" amount="1" start="0" attackPeak="{}"/>',
        0.01,
        "from x:start to x:attackPeak",
    ),
]


async def warnings_of(xml: str) -> list[str]:
    block = decode_xml(f'<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b">{xml}</bml>')
    assert isinstance(block, Block)
    async with robot(Variability()) as seen:
        await seen.perform(block)
    return [each.message for each in seen.feedback if isinstance(each, WarningFeedback)]


@pytest.mark.parametrize(("xml", "time", "span"), SHORT)
async def test_the_time_that_is_told_is_enough(xml: str, time: float, span: str) -> None:
    (message,) = await warnings_of(xml.format(time))
    told = re.search(rf"{span}[^,]* it takes ([\d.]+) s at least, and there are {time:.2f} s", message)

    assert told, message
    needed = float(told[1]) + 0.006
    assert await warnings_of(xml.format(round(needed, 3))) == []
    assert await warnings_of(xml.format(round(needed - 0.012, 3))) != []


ORDERS = [
    ('<wait id="n" start="3" end="1.5"/>', "start", "end"),
    ('<head id="n" lexeme="NOD" start="3" end="1.5"/>', "start", "end"),
    ('<head id="n" lexeme="NOD" stroke="3" relax="1.5"/>', "stroke", "relax"),
    ('<head id="n" lexeme="NOD" ready="3" strokeEnd="1.5"/>', "ready", "strokeEnd"),
]


@pytest.mark.parametrize(("xml", "first", "last"), ORDERS)
async def test_an_end_before_the_start_is_told_as_that(xml: str, first: str, last: str) -> None:
    """Also where nothing takes any time, as of a wait without a duration."""
    (message,) = await warnings_of(xml)

    assert message.startswith(f"line 1: cannot be on time: n:{last} would come 1.50 s before n:{first}: ")

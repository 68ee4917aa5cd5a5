"""A wait with a duration and a tied end: the end comes as it is tied, and a duration that is not kept is told."""

import pytest

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.feedback import WarningFeedback
from engage_hri.services.control.config import Variability
from engage_hri.services.realizer.plan.planner import plan_block
from tests.realizer.test_simulated_body import robot

WORDS = '<speech id="s"><text>One two three four</text></speech>'


async def _late(content: str) -> list[str]:
    block = decode_xml(f'<bml id="b">{content}</bml>')
    assert isinstance(block, Block)
    async with robot(Variability()) as seen:
        await seen.perform(block)
        return [each.message for each in seen.feedback if isinstance(each, WarningFeedback) and each.kind == "LATE"]


@pytest.mark.parametrize(
    ("content", "told"),
    [
        (
            f'<wait id="w" duration="0.4" end="s:end"/>{WORDS}',
            ["line 1: end came 0.83 s later than it should be: w:end = w:start+0.4"],
        ),
        (
            f'<wait id="w" duration="0.4"/>{WORDS}'
            '<constraint><synchronize><sync ref="w:end"/><sync ref="s:end"/></synchronize></constraint>',
            ["line 1: end came 0.83 s later than it should be: w:end = w:start+0.4"],
        ),
        (
            f'<wait id="w" duration="0.4"/>{WORDS}'
            '<constraint><after ref="s:end"><sync ref="w:end"/></after></constraint>',
            ["line 1: end came 0.83 s later than it should be: w:end = w:start+0.4"],
        ),
    ],
)
async def test_a_duration_that_is_given_up_is_told(content: str, told: list[str]) -> None:
    assert await _late(content) == told


@pytest.mark.parametrize(
    "content",
    [
        '<wait id="w" duration="0.5" start="0.1" end="0.6"/>',
        f'<wait id="w" start="s:end-0.4" duration="0.4" end="s:end"/>{WORDS}',
        f'<wait id="w" end="s:end"/>{WORDS}',
        f'<wait id="w" duration="0.4"/>{WORDS}',
        f'<wait id="w" duration="2"/>{WORDS}<constraint><after ref="s:end"><sync ref="w:end"/></after></constraint>',
    ],
)
async def test_a_duration_that_is_kept_is_not_told(content: str) -> None:
    assert await _late(content) == []


def test_a_wait_that_is_dropped_is_not_told_to_be_endless() -> None:
    block = decode_xml(f'<bml id="b">{WORDS}<wait id="w" start="s:starrt"/></bml>')
    assert isinstance(block, Block)

    (problem,) = plan_block(block).problems
    assert "did you mean 'start'?" in problem.message

"""The length of a wait: exact, but where its end is tied to another time; then it is the least."""

import pytest

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import Point

WORDS = '<speech id="s"><text>One two three four</text></speech>'


def _block(content: str) -> Block:
    block = decode_xml(f'<bml id="b">{content}{WORDS}</bml>')
    assert isinstance(block, Block)
    return block


@pytest.mark.parametrize(
    ("wait", "lasts"),
    [
        ('<wait id="w" duration="0.4"/>', 0.4),
        ('<wait id="w" duration="0.4" start="0.5"/>', 0.4),
        ('<wait id="w" duration="0.4" end="2"/>', 2.0),
        ('<wait id="w" duration="0.4" start="1" end="2"/>', 1.0),
    ],
)
def test_a_duration_is_exact_unless_the_end_is_tied_as_well(wait: str, lasts: float) -> None:
    plan = plan_block(_block(wait))

    start, end = (plan.schedule[plan.at[Point("w", sync)]] for sync in ("start", "end"))
    assert end - start == pytest.approx(lasts)
    assert plan.problems == ()


def test_a_wait_that_is_dropped_is_not_told_to_be_endless() -> None:
    (problem,) = plan_block(_block('<wait id="w" start="s:starrt"/>')).problems

    assert "did you mean 'start'?" in problem.message

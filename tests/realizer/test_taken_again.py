"""What one block hands over to another by plan, and what the other plans then."""

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Pointing
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.plan.planner import plan_block
from tests.realizer.oracle import SEVEN, estimate
from tests.realizer.planning import timed
from tests.realizer.test_losses import THEIRS, others


@pytest.mark.parametrize("taker", ["p", ""])
def test_what_is_handed_over_by_plan_is_taken_by_the_next_plan_too(taker: str) -> None:
    """It ends as the taker begins, and only for that: seen alone, the two do not even meet."""
    ours = timed(Pointing(id="p", target="a", mode="RIGHT_HAND"), start="3.5")
    again = timed(Pointing(id="q", target="a", mode="RIGHT_HAND"), start="12")
    times = dict(zip(SEVEN, (-1.0, 0.0, 1.0, 2.0, 3.0, 3.5, 3.5), strict=True))
    known = others(replace(THEIRS, mode="RIGHT_HAND"), times={f"other:x:{sync}": at for sync, at in times.items()})
    holder = replace(known.holders["other:x"], kept=frozenset(), reached=1, taker=taker)
    made = plan_block(
        Block(id="b", behaviors=(ours, again)),
        [estimate(ours), estimate(again)],
        known=replace(known, holders={"other:x": holder}),
    )

    assert made.takes == ({"other:x": "p"} if taker else {})

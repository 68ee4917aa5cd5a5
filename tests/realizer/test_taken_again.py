"""What one block hands over to another by plan, and what each of the two plans then."""

from collections.abc import Sequence

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Pointing
from engage_hri.schemas.blocks import Block
from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import Point
from tests.realizer.oracle import SEVEN, estimate
from tests.realizer.planning import at, timed
from tests.realizer.test_losses import THEIRS, others

OURS = timed(Pointing(id="p", target="a", mode="RIGHT_HAND"), start="3.5")
"""2.25 s; it is at its stroke end after 1.5."""
GOING_HOME = (-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0)
TO_COME = (3.75, 4.0, 5.0, 6.0, 7.0, 7.5, 8.0)


def planned_with(
    times: Sequence[float], *ours: BlockBehavior, reached: int, taker: str = "", begun: frozenset[str] = frozenset()
) -> Plan:
    """A plan beside one who has the right arm at these times. begun: who of the block began as planned."""
    known = others(
        replace(THEIRS, mode="RIGHT_HAND"),
        times={f"other:x:{sync}": when for sync, when in zip(SEVEN, times, strict=True)},
    )
    holder = replace(known.holders["other:x"], kept=frozenset(), reached=reached, taker=taker)
    points = {**known.points, **{Point(id, "start"): 3.5 for id in begun}}
    known = replace(known, holders={"other:x": holder}, points=points, begun=begun)
    return plan_block(Block(id="b", behaviors=ours), [estimate(each) for each in ours], known=known)


@pytest.mark.parametrize("taker", ["p", ""])
def test_what_is_handed_over_by_plan_is_taken_by_the_next_plan_too(taker: str) -> None:
    """It ends as the taker begins, and only for that: seen alone, the two do not even meet."""
    again = timed(Pointing(id="q", target="a", mode="RIGHT_HAND"), start="12")
    made = planned_with((-1.0, 0.0, 1.0, 2.0, 3.0, 3.5, 3.5), OURS, again, reached=1, taker=taker)

    assert made.takes == ({"other:x": "p"} if taker else {})


def test_who_comes_later_than_the_one_it_was_to_hand_over_to_hands_nothing_over() -> None:
    """It has not begun yet, and the other has."""
    made = planned_with(TO_COME, OURS, reached=0, taker="p", begun=frozenset("p"))

    assert (made.takes, made.dropped) == ({}, ())


@pytest.mark.parametrize("is_begun", [True, False])
def test_who_has_begun_takes_nothing_more(is_begun: bool) -> None:
    """It has its part already, from whomever it got it; who has yet to begin takes one from who goes home."""
    made = planned_with(GOING_HOME, OURS, reached=5, begun=frozenset("p" if is_begun else ""))

    assert made.takes == ({} if is_begun else {"other:x": "p"})
    assert [at(made, point) for point in ("p:start", "p:end")] == [3.5, 5.75]


@pytest.mark.parametrize(
    ("taken", "relax", "end"),
    [(3.75, 5.0, 5.0), (4.5, 5.0, 5.0), (5.0, 5.0, 5.0), (5.5, 5.25, 5.5), (6.0, 5.25, 5.75)],
)
def test_who_hands_over_makes_its_stroke_first_however_early_the_other_is_expected(
    taken: float, relax: float, end: float
) -> None:
    """From its stroke end on, and not before that, it loses what the other's start leaves no time for."""
    start = Point("other:x", "start")
    known = Known(blocks={"other": Block(id="other", behaviors=(THEIRS,))}, points={start: taken}, given={"p": start})
    made = plan_block(Block(id="b", behaviors=(OURS,)), [estimate(OURS)], known=known)

    points = ("p:stroke", "p:stroke_end", "p:relax", "p:end")
    assert [at(made, point) for point in points] == [4.75, 5.0, relax, end]

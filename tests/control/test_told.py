"""The strokes of a repeated movement, which a body may tell of: in order, all between the first and their end."""

import pytest

from engage_hri.schemas.behaviors import Head
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.contract.body import MovementAuthority, Reached
from engage_hri.services.control.serving.live_behavior import Told
from tests.control.directing import robot

NOD = Head(id="nod", lexeme="NOD", repetition=3)
FIRST, LAST = ("start", "ready", "stroke_start", "stroke"), ("stroke_end", "relax", "end")


def flaws(*syncs: str, through: str = "end") -> list[str]:
    told = Told(NOD, MovementAuthority(NOD, through), 0.0)
    return [flaw for sync in syncs if (flaw := told.flaw(Reached(sync, 0.1, 0.1), 0.1))]


@pytest.mark.parametrize("told", [(), ("stroke:2",), ("stroke:2", "stroke:3")])
def test_later_strokes_may_be_told(told: tuple[str, ...]):
    assert flaws(*FIRST, *told, *LAST) == []
    assert flaws(*FIRST, *told, through="stroke") == []


@pytest.mark.parametrize(
    "told",
    [("stroke:3",), ("stroke:2", "stroke:2"), ("stroke:1",), ("stroke:2", "stroke:3", "stroke:4"), ("stroke:x",)],
)
def test_a_stroke_out_of_order_or_not_asked_for_is_a_flaw(told: tuple[str, ...]):
    assert len(flaws(*FIRST, *told)) == 1


def test_a_later_stroke_belongs_between_the_first_and_their_end():
    assert flaws(*FIRST[:3], "stroke:2") != []
    assert flaws(*FIRST, "stroke_end", "stroke:2") != []


async def test_a_nod_of_several_strokes_is_done_through_the_service():
    async with robot(MemoryHub()) as client:
        outcome = await client.outcome(client.perform(NOD))
        reached = client.reached("nod")
    assert outcome.status == "done"
    assert list(reached) == [*FIRST, "stroke:2", "stroke:3", *LAST]

"""Ties that leave little time are kept, or told not to be at planning; arms that come together do not stop."""

import pytest

from tests.realizer.kept_or_told import BML, missed, perform

NODS = '<head id="a" lexeme="NOD"/><head id="b" lexeme="NOD" {}/>'
BEATS = '<gesture id="a" lexeme="BEAT" mode="LEFT_HAND"/><gesture id="b" lexeme="BEAT" mode="{}" {}/>'


@pytest.mark.parametrize("tie", ['start="a:strokeStart+0.2"', 'stroke="a:stroke+0.5"'])
def test_a_stand_or_an_earlier_end_keeps_a_tie_between_two_nods(tie: str) -> None:
    told = perform(f'<bml xmlns="{BML}" id="k">{NODS.format(tie)}</bml>')

    assert told.outcome is not None
    assert not told.outcome.dropped
    assert list(missed(told)) == []


@pytest.mark.parametrize("tie", ['end="a:strokeStart+0.5"', 'start="a:ready+0.2"', 'end="a:strokeEnd+0.3"'])
def test_what_cannot_be_kept_is_told_at_planning_by_the_right_amount(tie: str) -> None:
    told = perform(f'<bml xmlns="{BML}" id="k">{NODS.format(tie)}</bml>')

    assert told.outcome is not None
    assert not told.outcome.dropped
    assert [each.is_silent for each in missed(told)] == [False]


@pytest.mark.parametrize(("sync", "at"), [("strokeStart", 0.485), ("strokeEnd", 1.175)])
def test_two_arms_that_come_together_pass_without_a_stop(sync: str, at: float) -> None:
    told = perform(
        f'<bml xmlns="{BML}" id="k">{BEATS.format("RIGHT_HAND", f"{sync}=" + chr(34) + f"a:{sync}" + chr(34))}</bml>'
    )

    assert [told.times[f"{id}:{sync}"] for id in "ab"] == pytest.approx([at, at], abs=0.001)

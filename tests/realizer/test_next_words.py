"""The next words follow the words before them: whatever is late or held there, and whoever is tied to them."""

import pytest

from tests.judge import playing
from tests.judge.record import Record
from tests.judge.story import Deed, Story

RIGHT, LEFT = (f'lexeme="BEAT" mode="{side}_HAND"' for side in ("RIGHT", "LEFT"))
FIRST = f"""<speech id="s1">one two three four five six seven</speech>
    <gesture id="g" {RIGHT} stroke="s1:end"/><speech id="s2">eight nine ten</speech>"""
TIED = {
    "arm": f'<gesture id="k" {LEFT} stroke="{{}}s2:start"/>',
    "look": '<gaze id="k" target="cup" stroke="{}s2:start"/>',
}


def times(record: Record) -> dict[str, float]:
    return {f"{each.block}:{each.behavior}:{each.sync}": each.at.seconds for each in record.reported}


@pytest.mark.parametrize("tied", ["", *TIED])
def test_a_held_arm_that_is_tied_to_the_end_of_a_sentence_does_not_hold_the_next_one(tied: str) -> None:
    more = TIED[tied].format("") if tied else ""
    deeds = (
        Deed(0.0, "perform", "b", f'<bml id="b" xmlns="org.mindmakers.bml">{FIRST}{more}</bml>'),
        Deed(0.5, "hold", "b", behavior="g"),
        Deed(9.0, "continue", "b", behavior="g"),
    )
    came = times(playing.play(Story(deeds)))

    assert came["b:s2:start"] == pytest.approx(came["b:s1:end"], abs=0.02)
    assert came["b:g:stroke"] > 9.0
    if tied:
        assert came["b:k:stroke"] == pytest.approx(came["b:s2:start"], abs=0.1)


@pytest.mark.parametrize("tied", TIED)
def test_who_is_tied_to_them_in_another_block_comes_when_they_do_and_not_when_they_were_expected(tied: str) -> None:
    """They were expected with an arm that was late, at 3.7 s; that they came is news that overrules this.

    The arm of the other block is in the middle of its stroke then, slowed down for the time that was expected.
    """
    deeds = (
        Deed(0.0, "perform", "b", f'<bml id="b" xmlns="org.mindmakers.bml">{FIRST}</bml>'),
        Deed(0.3, "perform", "c", f'<bml id="c" xmlns="org.mindmakers.bml">{TIED[tied].format("b:")}</bml>'),
    )
    late = {"stall": [{"part": "right_arm", "before": "stroke_start", "seconds": 3.0}]}
    came = times(playing.play(Story(deeds, faults=late)))

    assert came["b:s2:start"] == pytest.approx(came["b:s1:end"], abs=0.02)
    assert came["b:g:stroke"] > came["b:s2:start"] + 1.0
    assert came["c:k:stroke"] <= came["b:s2:start"] + 0.45


@pytest.mark.parametrize("sync", ["stroke_start", "stroke"])
def test_a_look_comes_with_a_stroke_of_another_block_that_is_overdue(sync: str) -> None:
    look = f'<gaze id="k" target="cup" stroke="b:g:{sync}"/>'
    deeds = (
        Deed(0.0, "perform", "b", f'<bml id="b" xmlns="org.mindmakers.bml"><gesture id="g" {RIGHT}/></bml>'),
        Deed(0.1, "perform", "c", f'<bml id="c" xmlns="org.mindmakers.bml">{look}</bml>'),
    )
    late = {"stall": [{"part": "right_arm", "before": "stroke_start", "seconds": 2.0}]}
    came = times(playing.play(Story(deeds, faults=late)))

    assert came["c:k:stroke"] == pytest.approx(came[f"b:g:{sync}"], abs=0.1)

"""What of a streamed behavior has to come after the words before it: its stroke alone, where the stroke is tied."""

import pytest

from engage_hri.schemas.behaviors import Behavior, Gesture, Pointing, Speech
from engage_hri.services.generation.turns.continuation import first_met

GESTURE = Gesture(id="g", lexeme="BEAT")
POINT = Pointing(id="g", target="cup")
SPEECH = Speech(id="g", text="hello")


@pytest.mark.parametrize(
    ("behavior", "named", "expected"),
    [
        (GESTURE, [], "start"),
        (GESTURE, [("g", "stroke")], "stroke"),
        (GESTURE, [("g", "stroke_start")], "stroke_start"),
        (POINT, [("g", "stroke")], "stroke"),
        (GESTURE, [("g", "start"), ("g", "stroke")], "start"),
        (GESTURE, [("g", "ready"), ("g", "stroke")], "start"),
        (GESTURE, [("g", "stroke_end")], "start"),
        (GESTURE, [("other", "stroke")], "start"),
        (GESTURE, [("other", "start"), ("g", "stroke")], "stroke"),
        (SPEECH, [("g", "stroke")], "start"),
    ],
)
def test_a_behavior_that_is_tied_by_its_stroke_may_set_out_before_the_words(
    behavior: Behavior, named: list[tuple[str, str]], expected: str
) -> None:
    assert first_met(behavior, named) == expected

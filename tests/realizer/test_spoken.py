"""What has been said of the speeches of a block."""

import pytest

from engage_hri.schemas.behaviors import Mark, Speech
from engage_hri.schemas.blocks import SpokenText
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.report import Spoken

STORY = Speech(id="s", text="one two three", marks=(Mark("m", 4),))


def test_words_that_were_said_are_not_taken_back_by_what_is_told_late() -> None:
    spoken = Spoken((STORY,))
    spoken.hear("s", 8)
    spoken.hear("s", 4)
    spoken.reach(Point("s", "m"))

    assert spoken.of("s") == SpokenText(behavior="s", text="one two ", complete=False)


@pytest.mark.parametrize(("heard", "complete"), [("One", False), ("One two", True), ("One two!", True), ("", False)])
def test_a_speech_that_was_stopped_is_complete_once_its_last_word_came(heard: str, complete: bool) -> None:
    spoken = Spoken([Speech(id="s", text="One two!")])
    spoken.hear("s", len(heard))

    (told,) = spoken.texts
    assert (told.text, told.complete) == (heard, complete)

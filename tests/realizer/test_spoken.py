"""What has been said of the speeches of a block."""

from engage_hri.schemas.behaviors import Mark, Speech
from engage_hri.schemas.blocks import SpokenText
from engage_hri.services.realizer.perform.spoken import Spoken
from engage_hri.services.realizer.points import Point

STORY = Speech(id="s", text="one two three", marks=(Mark("m", 4),))


def test_words_that_were_said_are_not_taken_back_by_what_is_told_late() -> None:
    spoken = Spoken((STORY,))
    spoken.hear("s", 8)
    spoken.hear("s", 4)
    spoken.reach(Point("s", "m"))

    assert spoken.of("s") == SpokenText(behavior="s", text="one two ", complete=False)

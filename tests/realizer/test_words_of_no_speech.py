"""A body may tell of words of a behavior that has none: nothing was said then, and nothing goes wrong."""

import pytest

from engage_hri.schemas.behaviors import Gaze, Speech
from engage_hri.services.realizer.report import Spoken


@pytest.mark.parametrize("id", ["look", "nobody"])
def test_words_of_what_is_no_speech_are_ignored(id: str) -> None:
    spoken = Spoken((Gaze(id="look", target="a"), Speech(id="say", text="one two")))

    spoken.hear(id, 3)

    assert spoken.of(id) is None
    assert spoken.texts == ()

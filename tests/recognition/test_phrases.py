"""What is said into the robot's turn ends it, takes the floor, or lets it go on: phrases of a table made by ear."""

from collections import Counter

import pytest

from tests.recognition.phrases import PHRASES
from tests.recognition.test_interjections import Said, told

LONG = 1.2
"""Length of a phrase that would be an interruption by its length."""


def test_there_are_enough_of_each_kind() -> None:
    kinds = Counter((each.language, each.kind) for each in PHRASES)

    assert len(PHRASES) >= 200
    assert len(kinds) == 11 * 5
    assert min(kinds.values()) >= 3


@pytest.mark.parametrize("lasts", [0.4, LONG])
@pytest.mark.parametrize(("language", "kind"), sorted({(each.language, each.kind) for each in PHRASES}))
def test_it_is_read_as_it_is_meant(language: str, kind: str, lasts: float) -> None:
    for phrase in [each for each in PHRASES if (each.language, each.kind) == (language, kind)]:
        *_, (_, reading, at) = told(Said(3.0, lasts, phrase.words, lasts + 0.2), worded=True)

        assert (reading == "interruption") == phrase.stops, phrase.words
        assert kind != "noise" or reading == "noise", phrase.words
        assert at <= 3.0 + 1.5, phrase.words

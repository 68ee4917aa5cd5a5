"""What is said into the robot's turn ends it, takes the floor, or lets it go on: phrases of a table made by ear."""

from collections import Counter

import pytest

from tests.recognition.phrases import PHRASES, Phrase
from tests.recognition.test_interjections import Said, told

LONG = 1.2
"""Length of a phrase that would be an interruption by its length."""


def test_there_are_enough_of_each_kind() -> None:
    kinds = Counter((each.language, each.kind) for each in PHRASES)

    assert len(PHRASES) >= 200
    assert len(kinds) == 2 * 5
    assert min(kinds.values()) >= 3


@pytest.mark.parametrize("lasts", [0.4, LONG])
@pytest.mark.parametrize("phrase", PHRASES, ids=[f"{each.language}-{each.words}" for each in PHRASES])
def test_it_is_read_as_it_is_meant(phrase: Phrase, lasts: float) -> None:
    *_, (_, reading, at) = told(Said(3.0, lasts, phrase.words, lasts + 0.2), worded=True)

    assert (reading == "interruption") == phrase.stops
    if phrase.kind == "noise":
        assert reading == "noise"
    assert at <= 3.0 + 1.5

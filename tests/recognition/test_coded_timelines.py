"""Pairs and backchannels of talk that overlaps in all ways are those that a coder of the whole writes down.

More of it: `python -m tests.judge --talk --runs 1000`.
"""

import pytest

from tests.random_cases import share_of
from tests.recognition.coder import differences

TIMELINES = 1000
PARTS = 10


@pytest.mark.parametrize("part", range(PARTS))
def test_events_are_those_that_a_coder_writes_down(part: int) -> None:
    first, count = part * TIMELINES // PARTS, share_of(TIMELINES // PARTS)
    wrong = [(seed, differing) for seed in range(first, first + count) if (differing := differences(seed)[1])]

    assert not wrong, wrong[:3]

"""Events of talk and looks that overlap in all ways are those that a coder of the whole timeline writes down.

More of it: `python -m tests.judge --talk --runs 1000`.
"""

import pytest

from tests.random_cases import share_of
from tests.recognition import coder, gaze_coder

TIMELINES = 1000
PARTS = 10


@pytest.mark.parametrize("part", range(PARTS))
def test_pairs_and_backchannels(part: int) -> None:
    first, count = part * TIMELINES // PARTS, share_of(TIMELINES // PARTS)
    wrong = [(seed, differing) for seed in range(first, first + count) if (differing := coder.differences(seed)[1])]

    assert not wrong, wrong[:3]


@pytest.mark.parametrize("part", range(PARTS))
def test_directed_and_mutual_gazes(part: int) -> None:
    first, count = part * TIMELINES // PARTS, share_of(TIMELINES // PARTS)
    wrong = [
        (seed, differing) for seed in range(first, first + count) if (differing := gaze_coder.differences(seed)[1])
    ]

    assert not wrong, wrong[:3]

"""Events of talk and looks that overlap in all ways are those that a coder of the whole timeline writes down.

More of it: `python -m tests.judge --talk --runs 1000`.
"""

from collections.abc import Callable

import pytest

from tests.random_cases import share_of
from tests.recognition import gaze_coder, judged_talk, party_timeline

Differences = Callable[[int], tuple[int, list[str]]]
JUDGES: dict[str, tuple[Differences, int]] = {
    "talk": (judged_talk.differences, 1000),
    "company": (judged_talk.in_company, 360),
    "joins": (judged_talk.with_joins, 360),
    "looks": (gaze_coder.differences, 1000),
    "parties": (party_timeline.differences, 60),
}
"""Each with the number of timelines."""
PARTS = 10


@pytest.mark.parametrize("part", range(share_of(PARTS)))
@pytest.mark.parametrize("judge", JUDGES)
def test_events_are_those_that_a_coder_writes_down(judge: str, part: int) -> None:
    differences, timelines = JUDGES[judge]
    first, coded = part * timelines // PARTS, 0
    wrong = []
    for seed in range(first, first + share_of(timelines // PARTS, 6)):
        count, differing = differences(seed)
        coded += count
        if differing:
            wrong.append((seed, differing))

    assert coded > 0
    assert not wrong, wrong[:3]

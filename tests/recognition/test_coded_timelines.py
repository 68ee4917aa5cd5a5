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
MENDED = {
    "talk": (8042, 8500, 8571, 8840, 8927, 8994, 7014, 7018, 7115, 7184, 7219, 5632, 12259, 12410, 13094, 14155,
             12642, 13130, 14238, 15106, 15674, 20098, 20124, 20179, 20475, 20759, 21656,
             22283, 40107, 40841, 40914, 50705, 51910, 52330, 52915, 53000, 53214, 53975, 60273, 60536, 61138,
             61311),
    "company": (8004, 8024, 8034, 3009, 3014, 3033, 3092, 5038, 5199, 12009, 12082, 12151, 13045, 13103, 13127,
                15117, 15147, 15165, 20034, 20138, 20142, 22086, 22153, 50066, 50140, 50157, 50314, 50735,
                52021, 60009, 61202, 61212),
    "joins": (8001, 8014, 4009, 4024, 4095, 4130, 4135, 4145, 12032, 12148, 15122, 22190, 50304, 50507, 52066, 61202),
}  # fmt: skip
"""Timelines that differed once, each for a cause of its own."""


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


@pytest.mark.parametrize("judge", MENDED)
def test_what_differed_once_is_as_coded(judge: str) -> None:
    differing = {seed: JUDGES[judge][0](seed)[1] for seed in MENDED[judge]}

    assert not any(differing.values()), differing

"""How recognition tells the answers of 70 people who answered a product robot in a public study of turn-taking."""

from collections import Counter

import pytest

from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.recognition.config import RecognitionConfig
from tests.recognition.observations import HUMAN, ROBOT, Log

_IN_TENTHS = """
2 3 4 4 4 4 5 5 5 6 6 6 6 8 8 8 8 8 9 9 11 11 11 12 12 12 12 14 14 14 14 15 15 16 16 16 16 17 17 17 17 18 19 19 19 19
19 20 20 22 22 22 23 23 25 25 27 28 28 29 30 30 35 36 38 40 42 54 59 609
"""
DELAYS = tuple(int(each) / 10 for each in _IN_TENTHS.split())
"""Seconds from the end of the robot's turn to the beginning of the answer."""
LIMIT = RecognitionConfig().adjacency_pair_limit
END = 2.0
"""When the robot's turn ends."""


def talk(delay: float, **config: float) -> tuple[list[ConnectionEvent], Log]:
    """The robot asks, and a person answers for a second. Returns all changes of adjacency pairs."""
    defaults: dict[str, float] = {"adjacency_pair_limit": LIMIT, **config}
    log = Log(**defaults)
    log.begins(ROBOT, "speak", 0.0, behavior="block-1:speech-1")
    log.requests_event("adjacency_pair", 0.0, turn="turn-1")
    log.ends(ROBOT, "speak", END, behavior="block-1:speech-1")
    log.signals("ended", END)
    while (due := log.session.deadline) is not None and due < END + delay:
        log.until(due)
    log.begins(HUMAN, "speak", END + delay)
    log.ends(HUMAN, "speak", END + delay + 1.0)
    while (due := log.session.deadline) is not None:
        log.until(due)
    return [event for event in log.events if event.kind == "adjacency_pair"], log


@pytest.mark.parametrize("delay", sorted({*DELAYS}))
def test_each_is_told_with_its_delay_and_at_most_as_one_failure(delay: float) -> None:
    told, log = talk(delay)

    pairs = list(dict.fromkeys(each.id for each in told))
    failed = {each.id for each in told if each.state == "failed"}
    (robots,) = {each.id for each in told if each.initiator == ROBOT}
    if delay <= LIMIT:
        assert (pairs, failed) == ([robots], set())
        assert log.succeeded(robots).delay == pytest.approx(delay)
    else:
        assert (pairs, failed) == ([robots], {robots})
        last = log.last(robots)
        assert (last.retold, last.response, last.delay) == (True, "speak", pytest.approx(delay))
    assert log.outcomes[0].state == ("succeeded" if delay <= LIMIT else "failed")
    assert len(log.outcomes) == 1


def test_of_70_people_69_answer_in_time_and_one_late() -> None:
    ends = Counter[str]()
    for delay in DELAYS:
        told, _ = talk(delay)
        ends["late" if told[-1].retold else told[-1].state] += 1

    assert ends == {"completed": 69, "late": 1}


def test_with_the_limit_of_a_kitchen_table_half_of_them_had_failed() -> None:
    failed = sum(any(each.state == "failed" for each in talk(delay, adjacency_pair_limit=1.5)[0]) for delay in DELAYS)

    assert failed == 37

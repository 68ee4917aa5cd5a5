"""Instants by name: one for each, the earliest first, equal ones in an order that is known."""

import random

import pytest

from engage_hri.services.bus.deadlines import SLACK, Deadlines, Sight, Silences
from tests.random_cases import share_of


def test_there_is_one_instant_for_each_name_however_often_it_was_set() -> None:
    deadlines: Deadlines[str] = Deadlines()
    for at in range(1000):
        deadlines.set("a", 5000.0 - at)
        deadlines.set("b", 5000.0)
    deadlines.set("c", 4002.0)
    deadlines.set("b", None)

    assert len(deadlines._heap) <= SLACK + 4 * 3
    assert (deadlines.due(4000.0), deadlines.look) == (None, 4001.0)
    assert [deadlines.due(9000.0) for _ in range(3)] == ["a", "c", None]
    assert (deadlines.first, deadlines.earliest) == (None, None)


@pytest.mark.parametrize(
    ("order", "first"), [(None, ["b", "a", "c"]), (str, ["a", "b", "c"]), (ord, ["a", "b", "c"])]
)
def test_equal_instants_come_as_they_were_set_or_by_name(order, first) -> None:  # type: ignore[no-untyped-def]
    deadlines: Deadlines[str] = Deadlines(order)
    for name in "bac":
        deadlines.set(name, 1.0)

    assert [deadlines.due(1.0) for _ in "abc"] == [*first]


def judged(sleep: tuple[int, int], asked: int, allowance: int, *, beats: bool) -> int:
    """The millisecond in which a silence is judged by a process that stands still between two others.

    beats: it has something of its own to do every 100 ms, as long as it waits.
    """
    sight = Sight("me")
    silences = Silences[str](sight, is_own=lambda name: name == "pulse")
    beginning, end = sleep
    for ms in range(asked, asked + allowance + end - beginning + 1000):
        if beginning <= ms < end:
            continue
        now = ms / 1000
        if ms == asked or (ms == end and beginning <= asked < end):
            silences.set("other", now + allowance / 1000)
            silences.set("pulse", now + 0.1 if beats else None)
        while (name := silences.due(now + 1e-9)) is not None:
            if name == "other":
                return ms
            silences.set("pulse", now + 0.1)
    raise AssertionError("it was never judged")


@pytest.mark.parametrize("beats", [True, False])
def test_whoever_is_waited_for_has_its_time_without_that_for_which_the_judge_stood_still(beats: bool) -> None:
    """The oracle counts the milliseconds in which the judge was awake."""
    chance = random.Random(3)
    cases = [(end - 2990, end, 0, 3000) for end in (2999, 3000, 3001, 3020, 3049, 3051, 3100)]
    for _ in range(share_of(600)):
        asked, allowance = chance.randint(0, 500), chance.randint(100, 4000)
        beginning = asked + chance.randint(1, allowance + 200)
        cases.append((beginning, beginning + chance.choice((20, 300, 1000, 1200, 3000, 9000)), asked, allowance))
    for case in cases:
        beginning, end, asked, allowance = case
        due, slept = asked + allowance, end - beginning
        at = judged((beginning, end), asked, allowance, beats=beats)
        if due < beginning:
            assert at == due, case
            continue
        assert due <= at <= due + slept + 50, (case, at)
        if end - due > 50 or (beats and slept > 150 and due < end + 50):
            assert at >= end + 50, (case, at)  # what came meanwhile is heard first
        if beats and slept >= 1100:
            assert sum(not beginning <= ms < end for ms in range(asked, at)) >= allowance - 100, (case, at)

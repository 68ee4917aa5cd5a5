"""Nothing that recognition keeps grows with the length of a session: objects are counted, not bytes."""

import random
from collections.abc import Iterator
from itertools import islice

import pytest

from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Seconds
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.events.history import Latest
from engage_hri.services.recognition.events.session import Observation, Session
from engage_hri.services.recognition.statistics.published import PublishedStatistics
from tests.recognition.kept import kinds
from tests.recognition.meeting import meeting
from tests.recognition.observations import ROBOT, Log, stamp

EARLY, LATE = 5_000, 20_000
"""Observations; LATE is after one and a half hours."""


class Untidy:
    """A meeting of which one observation in ten comes late, and one in twenty twice."""

    def __init__(self, people: int) -> None:
        self._observed = meeting(people, seed=3)
        self._chance = random.Random(3)

    def __iter__(self) -> Iterator[tuple[Seconds, Observation]]:
        late: list[tuple[Seconds, Observation]] = []
        for observed in self._observed:
            if self._chance.random() < 0.1:
                late.append(observed)
                continue
            yield observed
            if self._chance.random() < 0.05:
                yield observed
            if late and self._chance.random() < 0.3:
                yield late.pop()


def test_a_long_session_keeps_no_more_than_a_short_one():
    session, published = Session(ROBOT, RecognitionConfig()), PublishedStatistics(ROBOT, RecognitionConfig())
    sizes, now = [], 0.0
    for number, (at, observation) in enumerate(islice(Untidy(2), LATE + 1)):
        now = max(now, at)
        effects = session.feed(observation, at)
        busy = session.busy
        published.feed([effect for effect in effects if isinstance(effect, ConnectionEvent)], busy, now)
        published.told(now)
        if number in (EARLY, LATE):
            sizes.append(kinds(session, published))
    early, late = sizes

    assert now > 3600.0
    assert late.total() < 20_000
    for kind, number in late.items():
        assert number <= 1.3 * early[kind] + 40, kind


def test_what_is_remembered_is_what_was_set_last():
    latest: Latest[str, int] = Latest(2)
    for key, value in (("a", 1), ("b", 2), ("a", 3), ("c", 4)):
        latest[key] = value

    assert latest == {"a": 3, "c": 4}


@pytest.mark.parametrize("kind", ["block", "turn", "answered"])
def test_blocks_and_turns_that_never_end_are_forgotten(kind: str):
    log = Log()
    sizes = []
    for number in range(400):
        if number % 200 == 100:
            sizes.append(kinds(log.session).total())
        at, name = float(number), f"{kind}-{number}"
        if kind == "block":
            log.passes("gaze-1:stroke", at, block=name)
        else:
            log.signals("ended" if kind == "turn" else "answered", at, turn=name, block=name)

    assert sizes[1] <= sizes[0] + 10


def test_a_look_leaves_no_trace_once_another_has_followed():
    log = Log()
    before = 0
    for number in range(3000):
        at = 0.2 * number
        action = ActionBegan(
            actor=ROBOT, action="look", at=stamp(at), targets=("table",), behavior=f"block-{number}:gaze"
        )
        log.session.feed(action, at)
        if number == 1000:
            before = kinds(log.session).total()

    assert kinds(log.session).total() <= before + 10

"""Addressees that perception tells just before a speech, and looks at whose face are counted until its end."""

import pytest

from engage_hri.schemas.behaviors import TurnSignal
from engage_hri.schemas.recognition import ConnectionEvent, SignalTurn
from engage_hri.services.recognition.events.scene import Worded
from engage_hri.services.recognition.perceive.words import TimedWords, Words
from tests.recognition.observations import ROBOT, Log, stamp

TO_BOB = frozenset(("bob",))


@pytest.mark.parametrize("before", [0.0, 0.02])
def test_who_looks_at_the_robot_and_speaks_to_another_answers_nothing(before: float) -> None:
    log = Log("ann", "bob")
    log.requests_event("adjacency_pair", 1.0, responder="ann", turn="turn-1")
    log.begins(ROBOT, "speak", 1.0, behavior="block-1:speech-1")
    log.looks("ann", ROBOT, 1.5)
    log.ends(ROBOT, "speak", 2.0, behavior="block-1:speech-1")
    signal = TurnSignal(id="e", turn="turn-1", signal="ended", actor="ann")
    log.feed(SignalTurn(id="over", requester="realizer", signal=signal, at=stamp(2.0), block="block-1"), 2.0)
    words = Words("loop")
    at = 2.5 - before
    early = words.hear(TimedWords(actor="ann", id="u", text="", began=at, ended=at, final=False, to=TO_BOB), at)
    assert early is not None
    log.feed(early, at)
    log.begins("ann", "speak", 2.5)
    log.ends("ann", "speak", 3.5)
    log.until(20.0)

    assert [event.state for event in log.events if event.kind == "adjacency_pair"] == ["started", "failed"]


def test_a_short_laugh_is_for_whom_one_looks_at_though_words_are_waited_for() -> None:
    log = Log("ann", "bob")
    log.looks("ann", ROBOT, 0.5)
    log.begins("ann", "speak", 1.0)
    log.feed(Worded(actor="ann", since=1.0, text="", to=frozenset((ROBOT,))), 1.1)
    log.ends("ann", "speak", 2.0)
    log.looks("ann", "bob", 5.0)
    log.begins("ann", "speak", 5.2)
    log.ends("ann", "speak", 5.8)
    log.looks("ann", "table", 5.9)
    log.until(20.0)

    pairs = [event for event in log.events if isinstance(event, ConnectionEvent) and event.kind == "adjacency_pair"]
    assert [round(event.started.seconds, 3) for event in pairs if event.state == "started"] == [1.0]

"""A connection event is as sure as the least sure observation of the person that began or answered it."""

import pytest

from engage_hri.schemas.perception import ActionBegan
from engage_hri.schemas.recognition import ConnectionEvent
from tests.recognition.observations import HUMAN, ROBOT, Log, asked, stamp

BLUE = "blue-square"


def begins(log: Log, action: str, at: float, confidence: float, target: str = "") -> None:
    targets = (target,) if target else ()
    log.feed(ActionBegan(actor=HUMAN, action=action, at=stamp(at), targets=targets, confidence=confidence), at)  # type: ignore[arg-type]


def confidences(log: Log, kind: str) -> list[tuple[str, float]]:
    return [(event.state, event.confidence) for event in log.events if event.kind == kind]


def test_a_look_that_follows_decides_as_surely_as_it_was_seen():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    begins(log, "look", 1.5, 0.7, BLUE)

    assert confidences(log, "directed_gaze") == [("started", 1.0), ("succeeded", 0.7)]


def test_a_look_that_was_there_before_counts_with_its_own_confidence():
    log = Log()
    begins(log, "look", 0.5, 0.6, BLUE)
    log.requests_event("directed_gaze", 0.7, BLUE)
    log.owner("fragment", "rectangle", 1.9)
    begins(log, "look", 2.0, 0.9, ROBOT)
    log.requests_event("mutual_facial_gaze", 3.0)

    assert confidences(log, "directed_gaze")[:2] == [("started", 0.6), ("succeeded", 0.6)]
    assert [event.confidence for event in log.events if event.state == "succeeded"] == [0.6, 0.9]


def test_what_fails_in_silence_is_as_sure_as_its_beginning():
    log = Log()
    log.requests_event("mutual_facial_gaze", 1.0)
    log.until(5.0)
    begins(log, "look", 6.0, 0.8, ROBOT)
    log.until(20.0)

    assert confidences(log, "mutual_facial_gaze") == [
        ("started", 1.0), ("failed", 1.0), ("started", 0.8), ("failed", 0.8),
    ]  # fmt: skip


@pytest.mark.parametrize(("action", "confidence"), [("look", 0.7), ("point", 0.8)])
def test_a_person_who_directs_does_so_as_surely_as_they_were_seen(action, confidence):
    log = Log()
    begins(log, action, 1.0, confidence, BLUE)
    log.until(2.0)
    log.looks(ROBOT, BLUE, 2.0)

    assert confidences(log, "directed_gaze")[:2] == [("started", confidence), ("succeeded", confidence)]


@pytest.mark.parametrize("action", ["speak", "nod", "point", "act"])
def test_an_answer_is_as_sure_as_the_words_or_gesture(action):
    log = asked("speak", "nod", "point", "act")
    begins(log, action, 2.5, 0.55, BLUE if action in ("point", "act") else "")

    assert confidences(log, "adjacency_pair")[:2] == [("started", 1.0), ("succeeded", 0.55)]


def test_an_interruption_keeps_its_confidence_until_the_turn_has_ended():
    log = asked(end=None)
    begins(log, "speak", 1.2, 0.5)
    log.until(2.5)
    log.ends(ROBOT, "speak", 3.0, behavior="block-1:speech-1")
    log.signals("ended", 3.0)

    assert confidences(log, "adjacency_pair")[:2] == [("started", 1.0), ("succeeded", 0.5)]


def test_a_persons_turn_and_a_backchannel_are_as_sure_as_the_speech():
    log = Log()
    begins(log, "speak", 1.0, 0.75)
    log.ends(HUMAN, "speak", 2.0)
    log.begins(ROBOT, "speak", 2.5)
    begins(log, "speak", 3.0, 0.65)
    log.ends(HUMAN, "speak", 3.4)

    assert confidences(log, "adjacency_pair")[:2] == [("started", 0.75), ("succeeded", 0.75)]
    assert {confidence for _, confidence in confidences(log, "backchannel")} == {0.65}


def test_confidence_only_falls_in_the_life_of_an_event():
    log = Log()
    begins(log, "look", 1.0, 0.5, ROBOT)
    log.looks(ROBOT, HUMAN, 1.5)
    begins(log, "look", 3.0, 1.0, BLUE)
    log.until(9.0)
    by_id: dict[str, list[float]] = {}
    for event in log.events:
        assert isinstance(event, ConnectionEvent)
        by_id.setdefault(event.id, []).append(event.confidence)

    assert by_id["mfg-1"] == [0.5, 0.5, 0.5]

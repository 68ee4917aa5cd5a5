"""Backchannels: every row of the table, both listeners, exact times."""

import pytest

from tests.recognition.observations import HUMAN, ROBOT, Log, asked


def test_short_speech_while_the_robot_speaks_is_a_backchannel_known_at_its_end():
    log = asked(end=None)
    log.begins(HUMAN, "speak", 1.5)
    assert log.told("backchannel") == []
    log.ends(HUMAN, "speak", 2.3)

    assert log.told("backchannel") == [
        ("bc-1", "started", 1.5),
        ("bc-1", "succeeded", 1.5),
        ("bc-1", "completed", 2.3),
    ] or (log.states("bc-1") == ["started", "succeeded", "completed"] and log.last("bc-1").started.seconds == 1.5)
    assert (log.last("bc-1").initiator, log.last("bc-1").responder) == (ROBOT, HUMAN)
    assert (log.last("bc-1").delay, log.last("bc-1").duration) == (None, pytest.approx(0.8))


def test_longer_speech_while_the_robot_speaks_is_a_change_of_floor():
    log = Log()
    log.begins(ROBOT, "speak", 1.0)
    log.begins(HUMAN, "speak", 1.5)
    log.until(2.3)

    assert log.told() == [("ap-1", "started", 1.5)]


@pytest.mark.parametrize("action", ["nod", "shake"])
def test_gestures_while_the_robot_speaks_are_backchannels(action):
    log = Log()
    log.begins(ROBOT, "speak", 1.0)
    log.begins(HUMAN, action, 1.5)
    log.begins(HUMAN, action, 2.5)
    log.ends(HUMAN, action, 3.0)

    assert log.told() == [
        ("bc-1", "started", 1.5), ("bc-1", "succeeded", 1.5), ("bc-1", "completed", 2.5),
        ("bc-2", "started", 2.5), ("bc-2", "succeeded", 2.5), ("bc-2", "completed", 3.0),
    ]  # fmt: skip


def test_a_nod_into_silence_is_nothing():
    log = Log()
    log.begins(HUMAN, "nod", 1.0)
    log.ends(HUMAN, "nod", 1.5)

    assert log.events == []


def test_robots_nod_while_a_person_speaks_is_a_backchannel():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.begins(ROBOT, "nod", 1.5)
    log.ends(ROBOT, "nod", 2.0)

    assert log.told("backchannel") == [
        ("bc-1", "started", 1.5),
        ("bc-1", "succeeded", 1.5),
        ("bc-1", "completed", 2.0),
    ]
    assert (log.last("bc-1").initiator, log.last("bc-1").responder) == (HUMAN, ROBOT)


def test_robots_short_speech_while_a_person_speaks_is_a_backchannel():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.begins(ROBOT, "speak", 1.5)
    log.ends(ROBOT, "speak", 1.9)

    assert log.states("bc-1") == ["started", "succeeded", "completed"]
    assert log.states("ap-1") == ["started"]


@pytest.mark.parametrize("announced_first", [True, False])
def test_an_announced_backchannel_is_one_event_however_it_is_noticed(announced_first):
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    if announced_first:
        log.requests_event("backchannel", 1.5)
        log.begins(ROBOT, "nod", 1.5)
    else:
        log.begins(ROBOT, "nod", 1.5)
        log.requests_event("backchannel", 1.5)
    log.ends(ROBOT, "nod", 2.0)

    assert log.told("backchannel") == [
        ("bc-1", "started", 1.5),
        ("bc-1", "succeeded", 1.5),
        ("bc-1", "completed", 2.0),
    ]
    assert [(outcome.event, outcome.state) for outcome in log.outcomes] == [("bc-1", "succeeded")]


@pytest.mark.parametrize("announced_first", [True, False])
def test_an_announced_spoken_backchannel_is_one_event(announced_first):
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    if announced_first:
        log.requests_event("backchannel", 1.5)
        log.begins(ROBOT, "speak", 1.5)
    else:
        log.begins(ROBOT, "speak", 1.5)
        log.requests_event("backchannel", 1.5)
    log.ends(ROBOT, "speak", 1.9)

    assert log.told("backchannel") == [
        ("bc-1", "started", 1.5),
        ("bc-1", "succeeded", 1.5),
        ("bc-1", "completed", 1.9),
    ]


def test_an_announced_backchannel_ends_with_its_block():
    log = Log()
    log.requests_event("backchannel", 1.5)
    log.block_ends(1.9)

    assert log.told()[-1] == ("bc-1", "completed", 1.9)


def test_a_gesture_whose_person_vanishes_is_completed():
    log = Log()
    log.begins(ROBOT, "speak", 1.0)
    log.begins(HUMAN, "nod", 1.5)
    log.lost(HUMAN, 1.6)
    log.until(2.1)

    assert log.told()[-1] == ("bc-1", "completed", 2.1)


def test_late_and_repeated_speech_does_not_speak_for_ever():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.begins(HUMAN, "speak", 1.0)
    log.until(3.5)

    assert log.states("ap-1") == ["started", "failed"]

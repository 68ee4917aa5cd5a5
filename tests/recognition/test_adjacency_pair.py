"""Adjacency pairs: every row of the table, both initiators, exact times."""

import pytest

from tests.recognition.observations import HUMAN, ROBOT, Log, asked

# -- the robot's pairs ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("action", ["speak", "nod", "shake", "point"])
def test_person_answers_within_the_limit(action):
    log = asked()
    log.begins(HUMAN, action, 2.4)
    log.ends(HUMAN, action, 3.4)

    assert log.told("adjacency_pair") == [
        ("ap-1", "started", 1.0), ("ap-1", "succeeded", 2.4), ("ap-1", "completed", 3.4),
    ]  # fmt: skip
    assert log.succeeded("ap-1").delay == pytest.approx(0.4)
    assert (log.succeeded("ap-1").response, log.outcomes[0].response) == (action, action)
    assert log.last("ap-1").duration == pytest.approx(1.0)
    assert log.told("backchannel") == []


def test_no_answer_fails_at_the_limit_after_the_turns_end():
    log = asked()
    log.until(9.0)

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "failed", 3.5)]
    assert (log.last("ap-1").delay, log.last("ap-1").response) == (2.5, None)


def test_manipulation_has_longer_when_it_is_accepted():
    log = asked("act")
    log.begins(HUMAN, "act", 9.5, "blue-square")
    log.ends(HUMAN, "act", 11.0, "blue-square")

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "succeeded", 9.5), ("ap-1", "completed", 11.0)]
    assert (log.succeeded("ap-1").delay, log.succeeded("ap-1").response) == (7.5, "act")


def test_what_is_not_accepted_answers_nothing():
    log = asked("nod")
    log.begins(HUMAN, "speak", 2.2)
    log.begins(HUMAN, "act", 2.3)
    log.until(3.5)

    assert log.states("ap-1") == ["started", "failed"]


def test_an_interruption_is_decided_at_the_turns_end_with_a_negative_delay():
    log = asked(end=None)
    log.begins(HUMAN, "speak", 1.5)
    log.until(2.5)
    assert log.states("ap-1") == ["started"]
    log.signals("ended", 3.0)
    log.ends(HUMAN, "speak", 3.4)

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "succeeded", 3.0), ("ap-1", "completed", 3.4)]
    assert log.succeeded("ap-1").delay == pytest.approx(-1.5)


def test_an_interruption_that_is_over_before_the_turn_completes_with_it():
    log = asked(end=None)
    log.begins(HUMAN, "speak", 1.2)
    log.ends(HUMAN, "speak", 2.2)
    log.signals("ended", 3.0)

    assert log.told()[1:] == [("ap-1", "succeeded", 3.0), ("ap-1", "completed", 3.0)]
    assert log.last("ap-1").duration == pytest.approx(1.0)


def test_short_speech_that_outlasts_the_turn_is_the_answer():
    log = asked(end=None)
    log.begins(HUMAN, "speak", 1.8)
    log.ends(ROBOT, "speak", 2.0, behavior="block-1:speech-1")
    log.signals("ended", 2.0)
    log.ends(HUMAN, "speak", 2.2)

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "succeeded", 2.0), ("ap-1", "completed", 2.2)]
    assert log.succeeded("ap-1").delay == pytest.approx(-0.2)


def test_pauses_between_the_robots_words_belong_to_its_turn():
    log = asked(end=None)
    log.ends(ROBOT, "speak", 1.5, behavior="block-1:speech-1")
    log.begins(HUMAN, "nod", 1.7)
    log.ends(HUMAN, "nod", 1.9)

    assert log.told("backchannel") == [
        ("bc-1", "started", 1.7),
        ("bc-1", "succeeded", 1.7),
        ("bc-1", "completed", 1.9),
    ]
    assert log.states("ap-1") == ["started"]


def test_manipulation_during_the_turn_answers_early():
    log = asked("act", end=None)
    log.begins(HUMAN, "act", 1.5, "blue-square")
    log.signals("ended", 2.0)

    assert log.succeeded("ap-1").delay == pytest.approx(-0.5)


def test_the_end_of_another_turn_starts_no_clock():
    log = asked(end=None)
    log.signals("ended", 2.0, turn="turn-9")
    log.until(5.0)

    assert log.states("ap-1") == ["started"]


def test_a_pair_announced_after_its_turns_end_has_its_clock():
    log = Log()
    log.signals("ended", 2.0)
    log.requests_event("adjacency_pair", 1.0, turn="turn-1")
    log.until(3.5)

    assert log.told()[-1] == ("ap-1", "failed", 3.5)


def test_without_a_turn_the_block_is_the_turn():
    log = asked(turn="", end=None)
    log.block_ends(2.0)
    log.until(3.5)

    assert log.told()[-1] == ("ap-1", "failed", 3.5)


@pytest.mark.parametrize("how", ["signal", "cancel"])
def test_an_aborted_turn_withdraws_the_question(how):
    log = asked(end=None)
    if how == "signal":
        log.signals("aborted", 1.5)
    else:
        log.cancels("request-1", 1.5)

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "withdrawn", 1.5)]


def test_who_interrupted_an_aborted_turn_has_answered():
    log = asked(end=None)
    log.begins(HUMAN, "speak", 1.5)
    log.until(2.4)
    log.signals("aborted", 2.5)

    assert log.states("ap-1") == ["started", "succeeded"]
    assert log.succeeded("ap-1").delay == pytest.approx(-1.0)


def test_a_new_question_supersedes_the_pending_one():
    log = asked()
    log.requests_event("adjacency_pair", 3.0, turn="turn-2")

    assert log.told()[1:] == [("ap-1", "superseded", 3.0), ("ap-2", "started", 3.0)]
    assert log.outcomes[0].state == "superseded"


def test_a_new_question_completes_the_answer_to_the_last():
    log = asked("act")
    log.begins(HUMAN, "act", 3.0, "blue-square")
    log.requests_event("adjacency_pair", 4.0, turn="turn-2")

    assert log.told()[1:] == [("ap-1", "succeeded", 3.0), ("ap-1", "completed", 4.0), ("ap-2", "started", 4.0)]


def test_a_turn_that_nobody_ends_is_given_up():
    log = asked(end=None)
    log.until(20.0)
    assert log.states("ap-1") == ["started"]
    log.ends(ROBOT, "speak", 20.0, behavior="block-1:speech-1")
    log.until(32.0)

    assert log.told()[-1] == ("ap-1", "withdrawn", 32.0)


@pytest.mark.parametrize("answered", [True, False])
def test_the_third_turn_closes_the_pair(answered):
    log = asked()
    if answered:
        log.begins(HUMAN, "speak", 2.5)
    log.signals("repaired", 3.0)

    assert log.states("ap-1") == ["started", "succeeded", "completed"]


# -- the person's pairs -----------------------------------------------------------------------------------------


def test_robot_answers_a_persons_turn():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.begins(ROBOT, "speak", 2.6)
    log.ends(ROBOT, "speak", 3.6)

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "succeeded", 2.6), ("ap-1", "completed", 3.6)]
    assert (log.events[0].initiator, log.succeeded("ap-1").response) == (HUMAN, "speak")
    assert log.succeeded("ap-1").delay == pytest.approx(0.6)


@pytest.mark.parametrize("action", ["nod", "shake", "point"])
def test_robot_answers_with_a_gesture(action):
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.begins(ROBOT, action, 2.6)
    log.ends(ROBOT, action, 3.0)

    assert log.states("ap-1") == ["started", "succeeded", "completed"]


@pytest.mark.parametrize("signal", ["answered", "repaired"])
def test_a_fragment_that_is_a_second_or_third_turn_answers_whoever_waits(signal):
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.signals(signal, 2.3, block="block-1")
    log.block_ends(2.9)

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "succeeded", 2.3), ("ap-1", "completed", 2.9)]


def test_no_answer_to_a_person_fails():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.until(3.5)

    assert log.told()[-1] == ("ap-1", "failed", 3.5)


def test_manipulation_asks_for_an_answer_from_its_end_on():
    log = Log()
    log.begins(HUMAN, "act", 1.0, "blue-square")
    log.ends(HUMAN, "act", 4.0, "blue-square")
    log.begins(ROBOT, "speak", 5.0)

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "succeeded", 5.0)]
    assert log.succeeded("ap-1").delay == pytest.approx(1.0)


def test_a_person_who_goes_on_speaking_has_not_ended_the_turn():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.begins(HUMAN, "speak", 3.0)
    log.until(6.0)
    assert log.states("ap-1") == ["started"]
    log.ends(HUMAN, "speak", 6.0)
    log.until(7.5)

    assert log.told()[-1] == ("ap-1", "failed", 7.5)


def test_the_robots_question_is_the_answer_to_a_person_who_has_finished():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.requests_event("adjacency_pair", 2.5, turn="turn-1")

    assert log.told()[1:] == [("ap-1", "succeeded", 2.5), ("ap-1", "completed", 2.5), ("ap-2", "started", 2.5)]


def test_the_robots_question_supersedes_a_turn_that_goes_on():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.begins(ROBOT, "speak", 1.5)
    log.requests_event("adjacency_pair", 1.5, turn="turn-1")

    assert log.told()[1:] == [("ap-1", "superseded", 1.5), ("ap-2", "started", 1.5)]


def test_robot_that_interrupts_has_answered_when_the_person_has_finished():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.begins(ROBOT, "speak", 1.5)
    log.ends(HUMAN, "speak", 3.0)
    log.ends(ROBOT, "speak", 3.5)

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "succeeded", 3.0), ("ap-1", "completed", 3.5)]
    assert log.succeeded("ap-1").delay == pytest.approx(-1.5)


@pytest.mark.parametrize(("at", "pairs"), [(4.9, {"ap-1"}), (5.2, {"ap-1", "ap-2"})])
def test_the_initiator_speaking_again_at_once_is_the_third_turn(at, pairs):
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.begins(ROBOT, "speak", 2.6)
    log.ends(ROBOT, "speak", 3.6)
    log.begins(HUMAN, "speak", at)

    assert {event.id for event in log.events} == pairs


def test_a_person_who_leaves_while_speaking_withdraws():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.lost(HUMAN, 2.0)
    log.until(2.5)

    assert log.told()[-1] == ("ap-1", "withdrawn", 2.5)


def test_a_person_who_leaves_while_answering_has_answered():
    log = asked()
    log.begins(HUMAN, "speak", 2.5)
    log.lost(HUMAN, 3.0)
    log.until(3.5)

    assert log.told()[-1] == ("ap-1", "completed", 3.5)
    assert log.last("ap-1").duration == pytest.approx(0.5)

"""Mutual facial gaze: every row of the table, both initiators, exact times."""

import pytest

from tests.recognition.observations import HUMAN, ROBOT, Log

BLUE, PINK = "blue-square", "pink-square"


def test_person_meets_the_robots_gaze():
    log = Log()
    log.requests_event("mutual_facial_gaze", 1.0, optional=True)
    log.looks(ROBOT, HUMAN, 1.3)
    log.looks(HUMAN, ROBOT, 1.8)
    log.looks(HUMAN, "table", 3.0)

    assert log.told() == [("mfg-1", "started", 1.0), ("mfg-1", "succeeded", 1.8), ("mfg-1", "completed", 3.0)]
    assert (log.succeeded("mfg-1").delay, log.last("mfg-1").duration) == (pytest.approx(0.8), pytest.approx(1.2))
    assert all(event.optional for event in log.events)


def test_person_on_the_face_already_is_delay_zero():
    log = Log()
    log.owner("fragment", "rectangle", 0.0)
    log.looks(HUMAN, ROBOT, 0.5)
    log.requests_event("mutual_facial_gaze", 1.0)

    assert log.told()[2:] == [("mfg-2", "started", 1.0), ("mfg-2", "succeeded", 1.0)]
    assert log.outcomes[0].delay == 0.0


def test_robots_mutual_gaze_fails_at_its_limit():
    log = Log()
    log.requests_event("mutual_facial_gaze", 1.0)
    log.looks(ROBOT, HUMAN, 1.3)
    log.until(3.0)

    assert log.told()[-1] == ("mfg-1", "failed", 2.9)


def test_robot_that_turns_away_first_withdraws():
    log = Log()
    log.requests_event("mutual_facial_gaze", 1.0)
    log.looks(ROBOT, HUMAN, 1.3)
    log.looks(ROBOT, BLUE, 2.0)

    assert log.told()[-1] == ("mfg-1", "withdrawn", 2.0)


def test_robot_still_on_its_way_has_not_turned_away():
    log = Log()
    log.looks(ROBOT, BLUE, 0.5)
    log.requests_event("mutual_facial_gaze", 1.0)
    log.looks_away(ROBOT, BLUE, 1.01)
    log.looks(ROBOT, HUMAN, 1.4)
    log.until(2.0)

    assert log.states("mfg-1") == ["started"]


def test_look_that_begins_again_at_the_same_instant_has_not_ended():
    log = Log()
    log.looks(ROBOT, HUMAN, 0.5)
    log.requests_event("mutual_facial_gaze", 1.0)
    log.looks_away(ROBOT, HUMAN, 1.2)
    log.looks(ROBOT, HUMAN, 1.2)
    log.until(2.0)

    assert log.states("mfg-1") == ["started"]


def test_robots_own_directed_gaze_ends_its_request_for_the_face():
    log = Log()
    log.requests_event("mutual_facial_gaze", 1.0)
    log.requests_event("directed_gaze", 2.0, BLUE)

    assert log.told()[1:] == [("mfg-1", "withdrawn", 2.0), ("dg-1", "started", 2.0)]


def test_an_aborted_turn_ends_its_request_for_the_face():
    log = Log()
    log.requests_event("mutual_facial_gaze", 1.0, turn="turn-1")
    log.signals("aborted", 1.5)

    assert log.states("mfg-1") == ["started", "withdrawn"]


def test_cancelled_mutual_gaze_is_withdrawn():
    log = Log()
    log.cancels(log.requests_event("mutual_facial_gaze", 1.0), 1.5)

    assert log.states("mfg-1") == ["started", "withdrawn"]


def test_asking_again_supersedes_the_pending_one():
    log = Log()
    log.requests_event("mutual_facial_gaze", 1.0)
    log.requests_event("mutual_facial_gaze", 2.0)

    assert log.told() == [("mfg-1", "started", 1.0), ("mfg-1", "superseded", 2.0), ("mfg-2", "started", 2.0)]


def test_asking_during_mutual_gaze_completes_it_and_succeeds_at_once():
    log = Log()
    log.looks(ROBOT, HUMAN, 0.5)
    log.looks(HUMAN, ROBOT, 1.0)
    log.requests_event("mutual_facial_gaze", 2.0)

    assert log.told()[2:] == [("mfg-1", "completed", 2.0), ("mfg-2", "started", 2.0), ("mfg-2", "succeeded", 2.0)]
    assert log.succeeded("mfg-2").delay == 0.0


# -- mutual facial gaze, the person's ---------------------------------------------------------------------------


def test_robot_meets_the_persons_gaze():
    log = Log()
    log.looks(HUMAN, ROBOT, 1.0)
    log.looks(ROBOT, HUMAN, 1.4)
    log.looks(ROBOT, BLUE, 2.0)

    assert log.told() == [("mfg-1", "started", 1.0), ("mfg-1", "succeeded", 1.4), ("mfg-1", "completed", 2.0)]
    assert (log.events[0].initiator, log.events[0].responder, log.events[0].limit) == (HUMAN, ROBOT, 1.9)


def test_robot_on_the_face_already_is_mutual_at_once():
    log = Log()
    log.looks(ROBOT, HUMAN, 0.5)
    log.looks(HUMAN, ROBOT, 1.0)

    assert log.told() == [("mfg-1", "started", 1.0), ("mfg-1", "succeeded", 1.0)]
    assert log.succeeded("mfg-1").delay == 0.0


def test_persons_mutual_gaze_fails_at_its_limit():
    log = Log()
    log.looks(HUMAN, ROBOT, 1.0)
    log.until(5.0)

    assert log.told()[-1] == ("mfg-1", "failed", 2.9)


def test_person_who_turns_away_first_has_failed():
    log = Log()
    log.looks(HUMAN, ROBOT, 1.0)
    log.looks(HUMAN, "table", 1.7)

    assert log.told()[-1] == ("mfg-1", "failed", 1.7)
    assert log.last("mfg-1").delay == pytest.approx(0.7)


def test_facial_gaze_while_a_fragment_looks_elsewhere_is_preempted():
    log = Log()
    log.owner("fragment", BLUE, 0.5)
    log.looks(HUMAN, ROBOT, 1.0)

    assert log.told() == [("mfg-1", "started", 1.0), ("mfg-1", "preempted", 1.0)]


def test_the_robots_request_supersedes_the_persons_wait():
    log = Log()
    log.looks(HUMAN, ROBOT, 1.0)
    log.requests_event("mutual_facial_gaze", 1.5)

    assert log.told()[1:] == [("mfg-1", "superseded", 1.5), ("mfg-2", "started", 1.5), ("mfg-2", "succeeded", 1.5)]


@pytest.mark.parametrize("by", [HUMAN, ROBOT])
def test_a_directed_gaze_ends_mutual_gaze(by):
    log = Log()
    log.looks(ROBOT, HUMAN, 0.5)
    log.looks(HUMAN, ROBOT, 1.0)
    if by == HUMAN:
        log.begins(HUMAN, "point", 2.0, BLUE)
    else:
        log.requests_event("directed_gaze", 2.0, BLUE)

    assert ("mfg-1", "completed", 2.0) in log.told()


def test_mutual_gaze_to_which_the_robot_never_came_ends_with_its_block():
    log = Log()
    log.looks(HUMAN, ROBOT, 0.5)
    log.requests_event("mutual_facial_gaze", 1.0)
    log.block_ends(2.0)

    assert log.told()[-1] == ("mfg-2", "completed", 2.0)

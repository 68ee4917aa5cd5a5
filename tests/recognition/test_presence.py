"""People who are lost, leave and come back; several at once."""

import pytest

from engage_hri.schemas.requests import Refused
from tests.recognition.observations import HUMAN, ROBOT, Log

BLUE, PINK = "blue-square", "pink-square"


def test_a_face_lost_for_less_than_the_grace_fails_nothing():
    log = Log()
    log.looks(ROBOT, HUMAN, 0.5)
    log.looks(HUMAN, ROBOT, 1.0)
    log.lost(HUMAN, 2.0)
    log.found(HUMAN, 2.4)
    log.until(9.0)

    assert log.states("mfg-1") == ["started", "succeeded"]


def test_a_person_who_leaves_closes_everything():
    log = Log()
    log.looks(ROBOT, HUMAN, 0.5)
    log.looks(HUMAN, ROBOT, 1.0)
    log.requests_event("adjacency_pair", 1.5, turn="turn-1")
    log.lost(HUMAN, 2.0)
    log.until(2.5)

    assert log.told()[-2:] == [("mfg-1", "completed", 2.5), ("ap-1", "failed", 2.5)]
    assert log.last("mfg-1").duration == pytest.approx(1.0)
    assert log.session.deadline is None


@pytest.mark.parametrize("kind", ["directed_gaze", "mutual_facial_gaze"])
def test_a_pending_request_to_somebody_who_leaves_fails(kind):
    log = Log()
    log.requests_event(kind, 1.0, *((BLUE,) if kind == "directed_gaze" else ()))
    log.lost(HUMAN, 1.2)
    log.until(2.0)

    assert log.told()[-1][1:] == ("failed", 1.7)


def test_what_a_leaving_person_wanted_is_withdrawn_and_what_was_shared_completed():
    log = Log()
    log.requests_event("directed_gaze", 0.5, "rectangle")
    log.looks(ROBOT, "rectangle", 0.6)
    log.looks(HUMAN, "rectangle", 0.8)
    log.begins(HUMAN, "point", 1.0, BLUE)
    log.lost(HUMAN, 1.2)
    log.until(1.7)

    assert log.told()[-2:] == [("dg-1", "completed", 1.7), ("dg-2", "withdrawn", 1.7)]
    assert log.last("dg-1").duration == pytest.approx(0.4)


def test_a_facial_gaze_of_somebody_who_vanishes_is_withdrawn():
    log = Log()
    log.looks(HUMAN, ROBOT, 1.0)
    log.lost(HUMAN, 1.2)
    log.until(1.7)

    assert log.told()[-1] == ("mfg-1", "withdrawn", 1.7)


def test_requests_to_somebody_who_has_gone_are_refused_until_the_return():
    log = Log()
    log.lost(HUMAN, 1.0)
    log.requests_event("mutual_facial_gaze", 2.0)
    log.found(HUMAN, 3.0)
    log.requests_event("mutual_facial_gaze", 4.0)

    assert [effect.fault.reason for effect in log.effects if isinstance(effect, Refused)] == ["'human' has gone"]
    assert log.states("mfg-1") == ["started"]


def test_several_persons_each_have_their_own_events():
    log = Log("ann", "bob")
    log.requests_event("mutual_facial_gaze", 1.0, responder="ann")
    log.requests_event("mutual_facial_gaze", 1.0, responder="bob")
    log.looks("bob", ROBOT, 1.5)
    log.until(2.9)

    assert log.states("mfg-1") == ["started", "failed"]
    assert log.states("mfg-2")[:2] == ["started", "succeeded"]

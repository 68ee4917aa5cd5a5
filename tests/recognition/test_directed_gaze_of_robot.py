"""Directed gaze: every row of the table, the robot's, exact times."""

import pytest

from engage_hri.schemas.requests import Refused
from tests.recognition.observations import HUMAN, ROBOT, Log, world

BLUE, PINK = "blue-square", "pink-square"


def test_person_follows_the_robots_gaze():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE, cause="reference")
    log.looks(ROBOT, BLUE, 1.4)
    log.looks(HUMAN, BLUE, 1.7)
    log.looks(HUMAN, "", 2.5)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "succeeded", 1.7), ("dg-1", "completed", 2.5)]
    assert log.succeeded("dg-1").delay == pytest.approx(0.7)
    assert log.last("dg-1").duration == pytest.approx(0.8)
    assert (log.outcomes[0].state, log.outcomes[0].id) == ("succeeded", "request-1")


def test_person_there_before_the_robot_shares_at_once_and_the_sharing_waits_for_the_robot():
    log = Log()
    log.looks(HUMAN, BLUE, 0.5)
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(ROBOT, BLUE, 1.4)
    log.looks(HUMAN, "", 2.0)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "succeeded", 1.0), ("dg-1", "completed", 2.0)]
    assert log.succeeded("dg-1").delay == 0.0
    assert log.last("dg-1").duration == pytest.approx(0.6)


def test_person_who_leaves_before_the_robot_arrives_has_shared_nothing():
    log = Log()
    log.looks(HUMAN, BLUE, 0.5)
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(HUMAN, "", 1.2)

    assert (log.last("dg-1").state, log.last("dg-1").duration) == ("completed", 0.0)


def test_robots_directed_gaze_fails_at_its_limit():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.until(3.5)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "failed", 3.5)]
    assert (log.last("dg-1").delay, log.outcomes[0].state) == (2.5, "failed")


def test_a_look_at_the_very_limit_still_counts():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(HUMAN, BLUE, 3.5)

    assert log.states("dg-1")[:2] == ["started", "succeeded"]


def test_an_observation_after_the_limit_comes_after_the_failure():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(HUMAN, BLUE, 3.6)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "failed", 3.5)]


def test_the_robot_may_look_away_before_the_person_arrives():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(ROBOT, BLUE, 1.4)
    log.looks(ROBOT, HUMAN, 2.0)
    log.looks(HUMAN, BLUE, 2.2)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "succeeded", 2.2), ("dg-1", "completed", 2.2)]
    assert log.last("dg-1").duration == 0.0


def test_limit_runs_from_the_latest_anchor():
    log = Log()
    anchors = ("gaze-1:stroke", "point-1:stroke_start", "phrase-1:start")
    log.requests_event("directed_gaze", 1.0, BLUE, anchors=anchors)
    assert log.session.deadline == 1.0 + 2.5 + 12.0
    log.passes("gaze-1:stroke", 1.4)
    log.passes("phrase-1:start", 2.0)
    log.passes("point-1:strokeStart", 1.9)

    assert log.session.deadline == 4.5


def test_anchors_realised_before_the_request_count():
    log = Log()
    log.passes("phrase-1:start", 0.8)
    log.requests_event("directed_gaze", 1.0, BLUE, anchors=("phrase-1:start",))

    assert log.session.deadline == 3.5


def test_anchor_offsets_shift_the_clock_and_bad_anchors_hold_nothing():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE, anchors=("phrase-1:start+0.5", "nonsense", "3"))
    log.passes("phrase-1:start", 2.0)

    assert log.session.deadline == 5.0


def test_the_end_of_the_block_ends_the_wait_for_anchors():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE, anchors=("phrase-1:start",))
    log.block_ends(9.0)
    log.until(9.0)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "failed", 9.0)]


def test_what_the_robot_never_shows_is_withdrawn_though_its_block_never_ends():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE, anchors=("gaze-1:stroke", "phrase-1:start"))
    log.passes("gaze-1:stroke", 1.5)
    log.until(60.0)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "withdrawn", 1.5 + 2.5 + 12.0)]
    assert log.session.deadline is None


def test_a_request_after_the_end_of_its_block_waits_for_no_anchor():
    log = Log()
    log.block_ends(0.9)
    log.requests_event("directed_gaze", 1.0, BLUE, anchors=("phrase-1:start",))

    assert log.session.deadline == 3.5


def test_own_limit_of_a_request_counts():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE, limit=0.5)

    assert (log.events[0].limit, log.session.deadline) == (0.5, 1.5)


def test_cancelled_directed_gaze_is_withdrawn():
    log = Log()
    request = log.requests_event("directed_gaze", 1.0, BLUE)
    log.cancels(request, 1.2)

    assert log.states("dg-1") == ["started", "withdrawn"]
    assert log.outcomes[0].state == "withdrawn"


@pytest.mark.parametrize("status", ["failed", "interrupted"])
def test_an_aborted_block_takes_its_directed_gaze_back(status):
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.block_ends(1.5, status)

    assert log.told()[-1] == ("dg-1", "withdrawn", 1.5)


def test_a_block_that_is_done_leaves_its_directed_gaze_open():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.block_ends(1.5)
    log.looks(HUMAN, BLUE, 2.0)

    assert log.states("dg-1")[1] == "succeeded"


def test_a_shared_gaze_to_which_the_robot_never_came_ends_with_its_block():
    log = Log()
    log.looks(HUMAN, BLUE, 0.5)
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.block_ends(2.0)

    assert log.told()[-1] == ("dg-1", "completed", 2.0)


def test_directing_anew_to_the_same_object_supersedes_the_pending_one():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.requests_event("directed_gaze", 2.0, BLUE)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "superseded", 2.0), ("dg-2", "started", 2.0)]
    assert log.outcomes[0].state == "superseded"


def test_directing_anew_during_shared_gaze_completes_it_and_succeeds_at_once():
    log = Log()
    log.looks(ROBOT, BLUE, 0.5)
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(HUMAN, BLUE, 1.5)
    log.requests_event("directed_gaze", 2.0, BLUE)

    assert log.told()[2:] == [("dg-1", "completed", 2.0), ("dg-2", "started", 2.0), ("dg-2", "succeeded", 2.0)]
    assert log.succeeded("dg-2").delay == 0.0


def test_directed_gazes_at_two_objects_are_decided_each_for_itself():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.requests_event("directed_gaze", 2.0, PINK)
    log.looks(HUMAN, PINK, 2.3)
    log.until(3.5)

    assert (log.states("dg-1"), log.states("dg-2")) == (["started", "failed"], ["started", "succeeded"])


@pytest.mark.parametrize(
    ("objects", "responder", "reason"),
    [
        ((), HUMAN, "without objects"),
        ((BLUE,), "stranger", "unknown actor 'stranger'"),
        (("unicorn",), HUMAN, "unknown object 'unicorn'"),
    ],
)
def test_invalid_requests_are_refused_at_once(objects, responder, reason):
    log = Log()
    log.requests_event("directed_gaze", 1.0, *objects, responder=responder)

    (refused,) = [effect for effect in log.effects if isinstance(effect, Refused)]
    assert reason in refused.fault.reason
    assert (log.events, refused.fault.where) == ([], "block-1: event-1")


def test_a_covered_piece_stays_known():
    log = Log()
    log.feed(world(pieces=("rectangle",)), 0.5)
    log.requests_event("directed_gaze", 1.0, BLUE)

    assert log.states("dg-1") == ["started"]

"""Directed and mutual facial gaze: every row of the two tables, both initiators, exact times."""

import pytest

from schemas.requests import Refused
from tests.recognition.observations import HUMAN, ROBOT, Log

BLUE, PINK = "blue-square", "pink-square"

# -- directed gaze, the robot's ---------------------------------------------------------------------------------


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
    assert log.session.deadline is None
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
    from tests.recognition.observations import world

    log = Log()
    log.feed(world(pieces=("rectangle",)), 0.5)
    log.requests_event("directed_gaze", 1.0, BLUE)

    assert log.states("dg-1") == ["started"]


# -- directed gaze, the person's --------------------------------------------------------------------------------


def test_pointing_directs_the_robot_who_follows():
    log = Log()
    log.begins(HUMAN, "point", 1.0, BLUE)
    log.looks(HUMAN, BLUE, 1.1)
    log.looks(ROBOT, BLUE, 1.5)
    log.looks(ROBOT, HUMAN, 2.3)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "succeeded", 1.5), ("dg-1", "completed", 2.3)]
    assert (log.events[0].initiator, log.events[0].limit, log.events[0].cause) == (HUMAN, 2.5, "human")
    assert log.succeeded("dg-1").delay == pytest.approx(0.5)
    assert log.last("dg-1").duration == pytest.approx(0.8)


def test_a_look_directs_once_it_has_lasted():
    log = Log()
    log.looks(HUMAN, BLUE, 1.0)
    log.until(1.59)
    assert log.events == []
    log.until(1.6)
    log.looks(ROBOT, BLUE, 2.0)

    assert log.told() == [("dg-1", "started", 1.6), ("dg-1", "succeeded", 2.0)]
    assert log.events[0].started.seconds == pytest.approx(1.0)
    assert log.succeeded("dg-1").delay == pytest.approx(1.0)


def test_robot_there_already_shares_at_once():
    log = Log()
    log.looks(ROBOT, BLUE, 0.5)
    log.begins(HUMAN, "point", 1.0, BLUE)

    assert log.states("dg-1")[:2] == ["started", "succeeded"]
    assert log.succeeded("dg-1").delay == 0.0


def test_persons_directed_gaze_fails_at_its_limit():
    log = Log()
    log.begins(HUMAN, "point", 1.0, BLUE)
    log.ends(HUMAN, "point", 1.5, BLUE)
    log.until(3.5)

    assert log.told()[-1] == ("dg-1", "failed", 3.5)


def test_the_person_may_look_away_before_the_robot_arrives():
    log = Log()
    log.begins(HUMAN, "point", 1.0, BLUE)
    log.looks(HUMAN, BLUE, 1.1)
    log.looks(HUMAN, "", 1.3)
    log.looks(ROBOT, BLUE, 1.6)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "succeeded", 1.6), ("dg-1", "completed", 1.6)]


def test_a_look_while_the_robot_speaks_directs_nothing_until_it_is_silent():
    log = Log()
    log.begins(ROBOT, "speak", 0.0)
    log.looks(HUMAN, BLUE, 1.0)
    log.until(3.0)
    assert log.events == []
    log.ends(ROBOT, "speak", 3.0)
    log.until(3.6)

    assert log.told() == [("dg-1", "started", 3.6)]


def test_a_look_while_the_looker_speaks_directs():
    log = Log()
    log.begins(HUMAN, "speak", 0.5)
    log.looks(HUMAN, BLUE, 1.0)
    log.until(1.6)

    assert ("dg-1", "started", 1.6) in log.told("directed_gaze")


@pytest.mark.parametrize(("after", "directs"), [(1.9, False), (2.1, True)])
def test_a_look_soon_after_the_robots_directed_gaze_directs_nothing(after, directs):
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.until(3.5)
    log.looks(HUMAN, BLUE, 3.5 + after)
    log.until(20.0)

    assert ("dg-2" in {event.id for event in log.events}) == directs


def test_a_look_that_answered_the_robot_never_turns_into_a_direction():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(ROBOT, BLUE, 1.2)
    log.looks(HUMAN, BLUE, 1.5)
    log.looks(ROBOT, HUMAN, 2.0)
    log.until(60.0)

    assert {event.id for event in log.events} == {"dg-1"}


def test_a_person_moving_an_object_directs_nothing_with_looks():
    log = Log()
    log.looks(HUMAN, BLUE, 1.0)
    log.begins(HUMAN, "act", 1.2, BLUE)
    log.ends(HUMAN, "act", 3.0, BLUE)
    log.until(60.0)

    assert log.told("directed_gaze") == []


@pytest.mark.parametrize("target", ["table", ROBOT, "somewhere"])
def test_only_objects_can_be_directed_to(target):
    log = Log()
    log.looks(HUMAN, target, 1.0)
    log.begins(HUMAN, "point", 2.0, target)
    log.until(9.0)

    assert log.told("directed_gaze") == []


def test_directing_while_a_fragment_looks_elsewhere_is_preempted():
    log = Log()
    log.owner("fragment", PINK, 0.5)
    log.begins(HUMAN, "point", 1.0, BLUE)

    assert log.told() == [("dg-1", "started", 1.0), ("dg-1", "preempted", 1.0)]


def test_a_fragment_that_looks_there_anyway_preempts_nothing():
    log = Log()
    log.owner("fragment", BLUE, 0.5)
    log.begins(HUMAN, "point", 1.0, BLUE)
    log.looks(ROBOT, BLUE, 1.2)

    assert log.states("dg-1")[1] == "succeeded"


def test_a_fragment_that_takes_the_head_preempts_what_waits():
    log = Log()
    log.begins(HUMAN, "point", 1.0, BLUE)
    log.looks(HUMAN, ROBOT, 1.2)
    log.owner("fragment", PINK, 1.5)

    assert log.states("dg-1") == ["started", "preempted"]
    assert log.states("mfg-1") == ["started", "preempted"]


def test_the_robots_own_reference_supersedes_the_persons_direction():
    log = Log()
    log.begins(HUMAN, "point", 1.0, BLUE)
    log.requests_event("directed_gaze", 1.5, BLUE)

    assert log.states("dg-1") == ["started", "superseded"]
    assert log.states("dg-2") == ["started"]


# -- gaze resolution --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("resolution", "state"), [("table", "succeeded"), ("object", "failed")])
@pytest.mark.parametrize("target", ["table", PINK])
def test_at_resolution_table_anything_on_it_will_do(resolution, state, target):
    log = Log(gaze_resolution=resolution)
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(HUMAN, target, 2.0)
    log.until(3.5)

    assert log.states("dg-1")[1] == state


def test_at_resolution_table_a_face_is_not_on_the_table():
    log = Log(gaze_resolution="table")
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(HUMAN, ROBOT, 2.0)
    log.until(3.5)

    assert log.states("dg-1") == ["started", "failed"]


def test_at_resolution_table_wandering_over_it_stays_shared():
    log = Log(gaze_resolution="table")
    log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(ROBOT, BLUE, 1.2)
    log.looks(HUMAN, "table", 2.0)
    log.looks(HUMAN, PINK, 2.5)
    log.looks(HUMAN, ROBOT, 3.0)

    assert log.told("directed_gaze")[-1] == ("dg-1", "completed", 3.0)


# -- mutual facial gaze, the robot's ----------------------------------------------------------------------------


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


# -- presence ---------------------------------------------------------------------------------------------------


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

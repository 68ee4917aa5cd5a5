"""Directed gaze: every row of the table, the person's; gaze resolution, exact times."""

import pytest

from tests.recognition.observations import HUMAN, ROBOT, Log

BLUE, PINK = "blue-square", "pink-square"


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

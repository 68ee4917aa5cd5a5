"""What is known late, ends that are lost, and limits met exactly: adjacency pairs in spite of them."""

import pytest

from engage_hri.schemas.body import BodyPose, Ray, RobotState
from engage_hri.schemas.requests import Accepted, Refused
from engage_hri.services.recognition.config import RecognitionConfig
from tests.recognition.observations import HUMAN, ROBOT, Log, asked, stamp

WORDS = "block-2:speech-1"


# -- answers that are known late ----------------------------------------------------------------------------------


def test_speech_that_began_in_time_is_the_answer_though_the_robot_speaks_on():
    log = asked(end=4.0)
    log.begins(ROBOT, "speak", 5.0, behavior=WORDS)
    log.begins(HUMAN, "speak", 5.3)
    log.ends(HUMAN, "speak", 6.8)
    log.ends(ROBOT, "speak", 7.0, behavior=WORDS)
    log.until(20.0)

    assert log.told() == [("ap-1", "started", 1.0), ("ap-1", "succeeded", 5.3), ("ap-1", "completed", 6.8)]
    assert log.succeeded("ap-1").delay == pytest.approx(1.3)


def test_speech_that_began_in_time_but_was_a_backchannel_answers_nothing():
    log = asked(end=4.0)
    log.begins(ROBOT, "speak", 5.0, behavior=WORDS)
    log.begins(HUMAN, "speak", 5.3)
    log.until(5.8)
    assert log.states("ap-1") == ["started"]
    log.ends(HUMAN, "speak", 5.9)
    log.until(20.0)

    assert ("ap-1", "failed", 5.5) in log.told()
    assert log.states("bc-1") == ["started", "succeeded", "completed"]


def test_speech_that_is_no_accepted_answer_is_not_waited_for():
    log = asked("nod", end=4.0)
    log.begins(ROBOT, "speak", 5.0, behavior=WORDS)
    log.begins(HUMAN, "speak", 5.3)
    log.until(5.5)

    assert log.told("adjacency_pair")[-1] == ("ap-1", "failed", 5.5)


def test_speech_that_began_after_the_limit_is_not_waited_for():
    log = asked(end=4.0)
    log.begins(ROBOT, "speak", 5.0, behavior=WORDS)
    log.begins(HUMAN, "speak", 5.6)

    assert log.told("adjacency_pair")[-1] == ("ap-1", "failed", 5.5)


def test_speech_that_began_before_a_gesture_is_the_answer_though_it_is_known_later():
    log = asked(end=None)
    log.begins(HUMAN, "speak", 2.0)
    log.begins(HUMAN, "point", 2.5, "blue-square")
    log.ends(HUMAN, "point", 2.7, "blue-square")
    log.signals("ended", 4.0)
    log.ends(HUMAN, "speak", 4.5)

    assert (log.succeeded("ap-1").response, log.succeeded("ap-1").delay) == ("speak", pytest.approx(-2.0))
    assert log.last("ap-1").duration == pytest.approx(2.5)


# -- ends that are lost -------------------------------------------------------------------------------------------


def test_after_a_lost_end_of_speech_the_next_answer_is_heard():
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.begins(ROBOT, "speak", 11.0, behavior=WORDS)
    log.requests_event("adjacency_pair", 11.0, turn="turn-1")
    log.ends(ROBOT, "speak", 14.0, behavior=WORDS)
    log.signals("ended", 14.0)
    log.begins(HUMAN, "speak", 14.4)
    log.ends(HUMAN, "speak", 15.0)

    assert log.states("ap-2") == ["started", "succeeded", "completed"]
    assert log.succeeded("ap-2").delay == pytest.approx(0.4)


@pytest.mark.parametrize("action", ["speak", "nod", "point", "act"])
def test_a_new_beginning_ends_the_answer_whose_end_was_lost(action):
    log = asked("speak", "nod", "point", "act")
    log.begins(HUMAN, action, 2.5, "blue-square")
    log.begins(HUMAN, action, 4.0, "rectangle")

    assert ("ap-1", "completed", 4.0) in log.told()
    assert log.last("ap-1").duration == pytest.approx(1.5)


def test_the_end_of_what_a_new_beginning_has_ended_does_not_end_the_new_one():
    log = Log()
    log.begins(HUMAN, "act", 1.0, "blue-square")
    log.begins(HUMAN, "act", 3.0, "rectangle")
    log.ends(HUMAN, "act", 3.5, "blue-square")
    assert log.session.busy == {HUMAN}
    log.ends(HUMAN, "act", 5.0, "rectangle")
    log.until(20.0)

    assert log.session.busy == set()
    assert log.told()[-1] == ("ap-1", "failed", 6.5)


@pytest.mark.parametrize(("action", "longest"), [("speak", 60.0), ("nod", 10.0), ("point", 10.0), ("act", 120.0)])
def test_what_nobody_ends_is_over_after_its_longest_time(action, longest):
    log = asked("speak", "nod", "point", "act")
    log.begins(HUMAN, action, 2.5)
    log.until(300.0)

    assert log.told("adjacency_pair")[-1] == ("ap-1", "completed", 2.5 + longest)
    assert (log.session.deadline, log.session.busy) == (None, set())


@pytest.mark.parametrize("setting", ["longest_speech", "longest_gesture", "longest_manipulation"])
def test_what_lasts_must_last(setting):
    with pytest.raises(ValueError, match=f"{setting} must be positive"):
        RecognitionConfig(**{setting: 0.0})


# -- at the very limit --------------------------------------------------------------------------------------------


def test_an_answer_at_the_very_limit_counts_whatever_the_rounding():
    log = Log()
    log.looks(HUMAN, ROBOT, 0.3)
    assert 0.3 + 1.9 < 2.2
    log.looks(ROBOT, HUMAN, 2.2)

    assert log.states("mfg-1") == ["started", "succeeded"]


@pytest.mark.parametrize("start", [0.1 * number for number in range(1, 40)])
def test_the_longest_backchannel_is_one_whatever_the_rounding(start):
    log = Log()
    log.begins(ROBOT, "speak", 0.05)
    log.begins(HUMAN, "speak", start)
    log.ends(HUMAN, "speak", round(start + 0.8, 9))

    assert log.states("bc-1") == ["started", "succeeded", "completed"]


@pytest.mark.parametrize("end", [0.1 * number for number in range(10, 40)])
def test_the_third_turn_at_the_very_limit_is_one_whatever_the_rounding(end):
    log = Log()
    log.begins(HUMAN, "speak", 0.2)
    log.ends(HUMAN, "speak", 0.5)
    log.begins(ROBOT, "speak", 0.9)
    log.ends(ROBOT, "speak", end)
    log.begins(HUMAN, "speak", round(end + 1.5, 9))

    assert {event.id for event in log.events} == {"ap-1"}


def robot_state(at: float, speaking: str = "") -> RobotState:
    ray = Ray(origin=(0.0, 0.0, 1.1), axis=(1.0, 0.0, 0.0))
    return RobotState(at=stamp(at), pose=BodyPose(), gaze=ray, left_arm=ray, right_arm=ray, speaking=speaking)


@pytest.mark.parametrize("shows", [True, False])
def test_a_speech_of_the_robot_whose_end_was_lost_is_over_once_its_body_is_silent(shows):
    """Not of a body that never shows whether it speaks."""
    log = Log()
    log.begins(ROBOT, "speak", 1.0, behavior="s")
    for second in range(2, 5):
        log.feed(robot_state(second, "s" if shows else ""), second)
    speaks = log.session.scene.robot_speaks_since
    for second in range(5, 9):
        log.feed(robot_state(second), second)

    assert speaks == 1.0
    assert (log.session.scene.robot_speaks_since is None) is shows


def test_what_is_asked_for_a_turn_that_was_cut_off_is_refused():
    """The message that it was may be quicker than the request: both were held up by a cut."""
    log = Log()
    log.signals("aborted", 1.0, turn="t")
    late = log.requests_event("adjacency_pair", 1.1, turn="t")
    other = log.requests_event("adjacency_pair", 1.2, turn="u")

    answers = {each.id: type(each) for each in log.effects if isinstance(each, Accepted | Refused)}
    assert answers == {late: Refused, other: Accepted}

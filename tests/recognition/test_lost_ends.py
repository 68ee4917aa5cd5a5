"""What is known late, ends that are lost, and limits met exactly: adjacency pairs in spite of them."""

import pytest

from engage_hri.schemas.body import BodyPose, Ray, RobotState
from engage_hri.schemas.requests import Accepted, Refused
from tests.recognition.event_stories import check
from tests.recognition.observations import HUMAN, ROBOT, Log, asked, stamp
from tests.stories import Story, each

STORIES = """
speech that began in time is the answer though the robot speaks on
    1 asked until=4; 5 robot +speak next-words; 5.3 human +speak; 6.8 human -speak; 7 robot -speak next-words
    20 time
    robot's ap-1: started 1, succeeded 5.3 after 1.3 by speak told 6.8, completed 6.8 lasting 1.5

speech that began in time but was a backchannel answers nothing
    1 asked until=4; 5 robot +speak next-words; 5.3 human +speak; 5.8 time; 5.9 human -speak; 20 time
    robot's ap-1: started 1, failed 5.5 after 4.5 told 5.9
    robot's bc-1: started 5.9 since 5.3, succeeded 5.9, completed 5.9 lasting 0.6

speech that is no accepted answer is not waited for
    1 asked nod until=4; 5 robot +speak next-words; 5.3 human +speak; 5.5 time
    robot's ap-1: started 1, failed 5.5 after 4.5

speech that began after the limit is not waited for
    1 asked until=4; 5 robot +speak next-words; 5.6 human +speak
    robot's ap-1: started 1, failed 5.5 after 4.5

speech that began before a gesture is the answer though it is known later
    1 asking; 2 human +speak; 2.5 human +point blue; 2.7 human -point blue; 4 turn ended; 4.5 human -speak
    robot's ap-1: started 1, succeeded 4 after -2 by speak, completed 4.5 lasting 2.5
    human's dg-1 at blue: started 2.5

after a lost end of speech the next answer is heard
    1 human +speak; 11 robot +speak next-words; 11 asks ap turn=turn-1; 14 robot -speak next-words; 14 turn ended
    14.4 human +speak; 15 human -speak
    human's ap-1: started 1, succeeded 14.4 after -3.4 by speak, completed 14.4 lasting 3
    robot's ap-2: started 11, succeeded 14.4 after 0.4 by speak, completed 15 lasting 0.6

a new beginning ends the answer whose end was lost
    ACTION in speak act
    1 asked speak nod point act; 2.5 human +ACTION blue; 4 human +ACTION rectangle
    robot's ap-1: started 1, succeeded 2.5 after 0.5 by ACTION, completed 4 lasting 1.5
    human's ap-2: started 4

a new nod ends the answer whose end was lost
    1 asked speak nod point act; 2.5 human +nod blue; 4 human +nod rectangle
    robot's ap-1: started 1, succeeded 2.5 after 0.5 by nod, completed 4 lasting 1.5

a new point ends the answer whose end was lost
    1 asked speak nod point act; 2.5 human +point blue; 4 human +point rectangle
    robot's ap-1: started 1, succeeded 2.5 after 0.5 by point, completed 4 lasting 1.5
    human's dg-1 at blue: started 2.5
    human's dg-2 at rectangle: started 4
"""


@each(STORIES)
def test_an_adjacency_pair_in_spite_of_what_is_late_or_lost(story: Story):
    check(story)


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

"""People who are lost, leave and come back; several at once. Read `event_stories.py`."""

from engage_hri.schemas.requests import Refused
from tests.recognition.event_stories import check
from tests.recognition.observations import HUMAN, ROBOT, Log
from tests.stories import Story, each

STORIES = """
a face lost for less than the grace fails nothing
    0.5 robot +look human; 1 human +look robot; 2 lost human; 3.9 found human; 9 time
    human's mfg-1: started 1, succeeded 1 after 0

a person who leaves closes everything
    0.5 robot +look human; 1 human +look robot; 1.5 asks ap turn=turn-1; 2 lost human; 4 time
    human's mfg-1: started 1, succeeded 1 after 0, completed 4 lasting 1
    robot's ap-1: started 1.5, failed 4 after 2.5
    deadline none

a pending directed gaze for somebody who leaves fails
    1 asks dg blue; 1.2 lost human; 4 time
    robot's dg-1 at blue: started 1, failed 3.2 after 2.2

a pending facial gaze for somebody who leaves fails
    0.6 lost human; 0.8 asks mfg; 4 time
    robot's mfg-1: started 0.8, failed 2.6 after 1.8

what a leaving person wanted is withdrawn and what was shared completed
    0.5 asks dg rectangle; 0.6 robot +look rectangle; 0.8 human +look rectangle; 1 human +point blue; 1.2 lost human
    3.2 time
    robot's dg-1 at rectangle: started 0.5, succeeded 0.8 after 0.3, completed 3.2 lasting 0.4
    human's dg-2 at blue: started 1, withdrawn 3.2

a facial gaze of somebody who vanishes is withdrawn
    with mutual_facial_gaze_limit=4
    1 human +look robot; 1.2 lost human; 3.2 time
    human's mfg-1: started 1, withdrawn 3.2
"""


@each(STORIES)
def test_what_becomes_of_the_events_of_who_leaves(story: Story):
    check(story)


def test_requests_to_somebody_who_has_gone_are_refused_until_the_return():
    log = Log()
    log.lost(HUMAN, 1.0)
    log.requests_event("mutual_facial_gaze", 3.5)
    log.found(HUMAN, 4.0)
    log.requests_event("mutual_facial_gaze", 5.0)

    refused = [effect.fault.reason for effect in log.effects if isinstance(effect, Refused)]
    assert refused == ["'human' is not seen any more"]
    assert log.states("mfg-1") == ["started"]


def test_several_persons_each_have_their_own_events():
    log = Log("ann", "bob")
    log.requests_event("mutual_facial_gaze", 1.0, responder="ann")
    log.requests_event("mutual_facial_gaze", 1.0, responder="bob")
    log.looks("bob", ROBOT, 1.5)
    log.until(2.9)

    assert log.states("mfg-1") == ["started", "failed"]
    assert log.states("mfg-2")[:2] == ["started", "succeeded"]


def test_who_is_found_at_a_time_after_which_they_were_lost_has_gone():
    """Two reporters, of which one was cut off: the later loss was known before the return."""
    log = Log("host")
    log.found(HUMAN, 1.0)
    log.lost(HUMAN, 2.0)
    log.until(3.0)
    log.lost(HUMAN, 10.0)
    log.found(HUMAN, 5.0)
    log.lost(HUMAN, 10.0)
    log.until(20.0)

    assert not log.session.persons[HUMAN].presence.here

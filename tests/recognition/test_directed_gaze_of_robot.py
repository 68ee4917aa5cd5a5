"""Directed gaze: every row of the table, the robot's, exact times. Read `event_stories.py`."""

import pytest

from engage_hri.schemas.requests import Refused
from tests.recognition.event_stories import check
from tests.recognition.observations import HUMAN, Log, world
from tests.stories import Story, each

BLUE = "blue-square"
STORIES = """
person follows the robot's gaze
    1 asks dg blue cause=reference; 1.4 robot +look blue; 1.7 human +look blue; 2.5 human +look
    robot's dg-1 at blue: started 1, succeeded 1.7 after 0.7, completed 2.5 lasting 0.8

person there before the robot shares at once and the sharing waits for the robot
    0.5 human +look blue; 1 asks dg blue; 1.4 robot +look blue; 2 human +look
    robot's dg-1 at blue: started 1, succeeded 1 after 0, completed 2 lasting 0.6

person who leaves before the robot arrives has shared nothing
    0.5 human +look blue; 1 asks dg blue; 1.2 human +look
    robot's dg-1 at blue: started 1, succeeded 1 after 0, completed 1.2 lasting 0

robot's directed gaze fails at its limit
    1 asks dg blue; 3.5 time
    robot's dg-1 at blue: started 1, failed 3.5 after 2.5

a look at the very limit still counts
    1 asks dg blue; 3.5 human +look blue
    robot's dg-1 at blue: started 1, succeeded 3.5 after 2.5

an observation after the limit comes after the failure
    1 asks dg blue; 3.6 human +look blue
    robot's dg-1 at blue: started 1, failed 3.5 after 2.5

the robot may look away before the person arrives
    1 asks dg blue; 1.4 robot +look blue; 2 robot +look human; 2.2 human +look blue
    robot's dg-1 at blue: started 1, succeeded 2.2 after 1.2, completed 2.2 lasting 0

limit runs from the latest anchor
    1 asks dg blue anchors=gaze-1:stroke,point-1:stroke_start,phrase-1:start
    1.4 passes gaze-1:stroke; 2 passes phrase-1:start; 1.9 passes point-1:strokeStart
    robot's dg-1 at blue: started 1.9
    deadline 4.5

until all anchors have come the limit and the longest wait count
    1 asks dg blue anchors=gaze-1:stroke,point-1:stroke_start,phrase-1:start
    deadline 15.5

anchors realised before the request count
    0.8 passes phrase-1:start; 1 asks dg blue anchors=phrase-1:start
    robot's dg-1 at blue: started 1
    deadline 3.5

anchor offsets shift the clock and bad anchors hold nothing
    1 asks dg blue anchors=phrase-1:start+0.5,nonsense,3; 2 passes phrase-1:start
    robot's dg-1 at blue: started 2
    deadline 5

the end of the block ends the wait for anchors
    1 asks dg blue anchors=phrase-1:start; 9 block done; 12 time
    robot's dg-1 at blue: started 9, failed 11.5 after 2.5

the limit of what was shown may be over when the block ends the wait for anchors
    1 asks dg blue anchors=phrase-1:start; 1.4 robot +look blue; 9 block done; 9 time
    robot's dg-1 at blue: started 1.4, failed 9 after 7.6

what the robot never shows is withdrawn though its block never ends
    1 asks dg blue anchors=gaze-1:stroke,phrase-1:start; 1.5 passes gaze-1:stroke; 60 time
    robot's dg-1 at blue: started 16, withdrawn 16
    deadline none

what the robot shows before all anchors have come starts
    1 asks dg blue anchors=gaze-1:stroke,phrase-1:start; 1.4 robot +look blue; 2 passes phrase-1:start
    2.2 human +look blue
    robot's dg-1 at blue: started 1.4, succeeded 2.2 after 0.8

what ends before the robot has shown anything starts as it ends
    1 asks dg blue anchors=gaze-1:stroke; 2 asks dg blue anchors=gaze-1:stroke; 3 cancels 2
    3 asks dg blue anchors=gaze-1:stroke; 4 lost human; 6 time
    robot's dg-1 at blue: started 2, superseded 2
    robot's dg-2 at blue: started 3, withdrawn 3
    robot's dg-3 at blue: started 6, failed 6 after 0
    deadline none

a request after the end of its block waits for no anchor
    0.9 block done; 1 asks dg blue anchors=phrase-1:start
    robot's dg-1 at blue: started 1
    deadline 3.5

own limit of a request counts
    1 asks dg blue limit=0.5
    robot's dg-1 at blue: started 1
    deadline 1.5

cancelled directed gaze is withdrawn
    1 asks dg blue; 1.2 cancels 1
    robot's dg-1 at blue: started 1, withdrawn 1.2

an aborted block takes its directed gaze back
    STATUS in failed interrupted
    1 asks dg blue; 1.5 block STATUS
    robot's dg-1 at blue: started 1, withdrawn 1.5

a block that is done leaves its directed gaze open
    1 asks dg blue; 1.5 block done; 2 human +look blue
    robot's dg-1 at blue: started 1, succeeded 2 after 1

a shared gaze to which the robot never came ends with its block
    0.5 human +look blue; 1 asks dg blue; 2 block done
    robot's dg-1 at blue: started 1, succeeded 1 after 0, completed 2 lasting 0

directing anew to the same object supersedes the pending one
    1 asks dg blue; 2 asks dg blue
    robot's dg-1 at blue: started 1, superseded 2
    robot's dg-2 at blue: started 2

directing anew during shared gaze is answered by it
    0.5 robot +look blue; 1 asks dg blue; 1.5 human +look blue; 2 asks dg blue; 3 human +look
    robot's dg-1 at blue: started 1, succeeded 1.5 after 0.5, succeeded 2 after 0.5, completed 3 lasting 1.5

person who is there first follows when the robot arrives
    0.5 human +look blue; 1 asks dg blue anchors=gaze-1:stroke; 1.4 robot +look blue; 2 human +look
    robot's dg-1 at blue: started 1.4, succeeded 1.4 after 0, completed 2 lasting 0.6

person who comes while the robot is on its way follows when it arrives
    1 asks dg blue anchors=gaze-1:stroke; 1.2 human +look blue; 1.4 robot +look blue; 2 human +look
    robot's dg-1 at blue: started 1.4, succeeded 1.4 after 0, completed 2 lasting 0.6

person who is there first follows when the robot has pointed
    0.5 human +look blue; 1 asks dg blue anchors=gaze-1:stroke,phrase-1:start; 1.3 robot +point blue; 2 human +look
    robot's dg-1 at blue: started 1.3, succeeded 1.3 after 0, completed 2 lasting 0

person who leaves before the robot has shown anything has not followed
    0.5 human +look blue; 1 asks dg blue anchors=gaze-1:stroke; 1.2 human +look; 1.4 robot +look blue
    1.4 passes gaze-1:stroke; 4 time
    robot's dg-1 at blue: started 1.4, failed 3.9 after 2.5

directed gazes at two objects are decided each for itself
    1 asks dg blue; 2 asks dg pink; 2.3 human +look pink; 3.5 time
    robot's dg-1 at blue: started 1, failed 3.5 after 2.5
    robot's dg-2 at pink: started 2, succeeded 2.3 after 0.3
"""


@each(STORIES)
def test_a_directed_gaze_of_the_robot(story: Story):
    check(story)


def test_the_start_says_how_long_the_person_has():
    log = Log()
    log.requests_event("directed_gaze", 1.0, BLUE, limit=0.5)

    assert [event.limit for event in log.events] == [0.5]


def test_an_answer_names_its_request():
    log = Log()
    request = log.requests_event("directed_gaze", 1.0, BLUE)
    log.looks(HUMAN, BLUE, 1.7)

    assert [(outcome.id, outcome.state) for outcome in log.outcomes] == [(request, "succeeded")]


@pytest.mark.parametrize(
    ("objects", "responder", "reason", "advice"),
    [
        ((), HUMAN, "without objects", ""),
        ((BLUE,), "stranger", "unknown actor 'stranger'", f"known: {HUMAN}"),
        (("unicorn",), HUMAN, "unknown object 'unicorn'", ""),
    ],
)
def test_invalid_requests_are_refused_at_once(objects, responder, reason, advice):
    log = Log()
    log.requests_event("directed_gaze", 1.0, *objects, responder=responder)

    (refused,) = [effect for effect in log.effects if isinstance(effect, Refused)]
    assert reason in refused.fault.reason
    assert refused.fault.advice == advice
    assert (log.events, refused.fault.where) == ([], "block-1: event-1")


def test_a_covered_piece_stays_known():
    log = Log()
    log.feed(world(pieces=("rectangle",)), 0.5)
    log.requests_event("directed_gaze", 1.0, BLUE)

    assert log.states("dg-1") == ["started"]

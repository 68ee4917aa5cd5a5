"""Mutual facial gaze: every row of the table, both initiators, exact times. Read `event_stories.py`."""

from tests.recognition.event_stories import check
from tests.recognition.observations import HUMAN, ROBOT, Log
from tests.stories import Story, each

OF_ROBOT = """
person meets the robot's gaze
    1 asks mfg; 1.3 robot +look human; 1.8 human +look robot; 3 human +look table
    robot's mfg-1: started 1, succeeded 1.8 after 0.8, completed 3 lasting 1.2

person on the face already is delay zero
    0 owner fragment rectangle; 0.5 human +look robot; 1 asks mfg
    human's mfg-1: started 0.5, preempted 0.5
    robot's mfg-2: started 1, succeeded 1 after 0

robot's mutual gaze fails at its limit
    1 asks mfg; 1.3 robot +look human; 3 time
    robot's mfg-1: started 1, failed 2.9 after 1.9

robot that turns away first withdraws
    1 asks mfg; 1.3 robot +look human; 2 robot +look blue
    robot's mfg-1: started 1, withdrawn 2

robot still on its way has not turned away
    0.5 robot +look blue; 1 asks mfg; 1.01 robot -look blue; 1.4 robot +look human; 2 time
    robot's mfg-1: started 1

look that begins again at the same instant has not ended
    0.5 robot +look human; 1 asks mfg; 1.2 robot -look human; 1.2 robot +look human; 2 time
    robot's mfg-1: started 1

robot's own directed gaze ends its request for the face
    1 asks mfg; 2 asks dg blue
    robot's mfg-1: started 1, withdrawn 2
    robot's dg-1 at blue: started 2

an aborted turn ends its request for the face
    1 asks mfg turn=turn-1; 1.5 turn aborted
    robot's mfg-1: started 1, withdrawn 1.5

cancelled mutual gaze is withdrawn
    1 asks mfg; 1.5 cancels 1
    robot's mfg-1: started 1, withdrawn 1.5

asking again supersedes the pending one
    1 asks mfg; 2 asks mfg
    robot's mfg-1: started 1, superseded 2
    robot's mfg-2: started 2

asking during mutual gaze is answered by it
    0.5 robot +look human; 1 human +look robot; 2 asks mfg; 3 human +look table
    human's mfg-1: started 1, succeeded 1 after 0, succeeded 2 after 0, completed 3 lasting 2

what is asked for begins when the robot has arrived
    0.5 owner fragment rectangle; 0.6 human +look robot; 1 asks mfg anchors=gaze-1:stroke; 1.4 robot +look human
    human's mfg-1: started 0.6, preempted 0.6
    robot's mfg-2: started 1.4, succeeded 1.4 after 0

a person who has looked away before the robot arrives has not met it
    0.5 owner fragment rectangle; 0.6 human +look robot; 1 asks mfg anchors=gaze-1:stroke; 1.2 human +look table
    1.4 robot +look human; 1.4 passes gaze-1:stroke; 4 time
    human's mfg-1: started 0.6, preempted 0.6
    robot's mfg-2: started 1.4, failed 3.3 after 1.9

the robot's own directed gaze ends its request for the face while its head is on its way
    1 asks mfg anchors=gaze-1:stroke; 2 asks dg blue
    robot's mfg-1: started 2, withdrawn 2
    robot's dg-1 at blue: started 2

what an aborted turn has not shown starts as it is withdrawn
    1 asks mfg turn=turn-1 anchors=gaze-1:stroke; 1.5 turn aborted
    robot's mfg-1: started 1.5, withdrawn 1.5
"""


@each(OF_ROBOT)
def test_mutual_gaze_that_the_robot_seeks(story: Story):
    check(story)


OF_PERSON = """
robot meets the person's gaze
    1 human +look robot; 1.4 robot +look human; 2 robot +look blue
    human's mfg-1: started 1, succeeded 1.4 after 0.4, completed 2 lasting 0.6

robot on the face already is mutual at once
    0.5 robot +look human; 1 human +look robot
    human's mfg-1: started 1, succeeded 1 after 0

person's mutual gaze fails at its limit
    1 human +look robot; 5 time
    human's mfg-1: started 1, failed 2.9 after 1.9

person who turns away first has failed
    1 human +look robot; 1.7 human +look table
    human's mfg-1: started 1, failed 1.7 after 0.7

facial gaze while a fragment looks elsewhere is preempted
    0.5 owner fragment blue; 1 human +look robot
    human's mfg-1: started 1, preempted 1

the robot's request adopts the person's wait
    1 human +look robot; 1.5 asks mfg; 1.8 robot +look human
    human's mfg-1: started 1, succeeded 1.8 after 0.8

a request begins an event of its own when the person's wait ends in vain
    1 human +look robot; 1.5 asks mfg anchors=gaze-1:stroke; 1.7 human +look table; 1.8 robot +look human
    2 human +look robot
    human's mfg-1: started 1, failed 1.7 after 0.7
    robot's mfg-2: started 1.8, succeeded 2 after 0.2

a request outlasts the limit of the person's wait
    1 human +look robot; 1.5 asks mfg anchors=gaze-1:stroke; 3 robot +look human
    human's mfg-1: started 1, failed 2.9 after 1.9
    robot's mfg-2: started 3, succeeded 3 after 0

a request that is shown while it waits for the person's event has started then
    1 human +look robot; 1.5 asks mfg anchors=gaze-1:stroke; 1.6 passes gaze-1:stroke; 1.7 human +look table
    2 human +look robot
    human's mfg-1: started 1, failed 1.7 after 0.7
    robot's mfg-2: started 1.7 since 1.6, succeeded 2 after 0.4

an aborted turn withdraws a request that waits for the person's event
    1 human +look robot; 1.5 asks mfg turn=turn-1; 1.6 turn aborted; 1.8 robot +look human
    human's mfg-1: started 1, succeeded 1.8 after 0.8
    robot's mfg-2: started 1.6 since 1.5, withdrawn 1.6

of two requests that wait for the person's event the later one is adopted
    1 human +look robot; 1.5 asks mfg; 1.6 asks mfg; 1.8 robot +look human
    human's mfg-1: started 1, succeeded 1.8 after 0.8
    robot's mfg-2: started 1.6 since 1.5, superseded 1.6

a person's directed gaze ends mutual gaze
    0.5 robot +look human; 1 human +look robot; 2 human +point blue
    human's mfg-1: started 1, succeeded 1 after 0, completed 2 lasting 1
    human's dg-1 at blue: started 2

a directed gaze of the robot ends mutual gaze
    0.5 robot +look human; 1 human +look robot; 2 asks dg blue
    human's mfg-1: started 1, succeeded 1 after 0, completed 2 lasting 1
    robot's dg-1 at blue: started 2

mutual gaze to which the robot never came ends with its block
    0.4 owner fragment rectangle; 0.5 human +look robot; 1 asks mfg; 2 block done
    human's mfg-1: started 0.5, preempted 0.5
    robot's mfg-2: started 1, succeeded 1 after 0, completed 2 lasting 0
"""


@each(OF_PERSON)
def test_mutual_gaze_that_a_person_seeks(story: Story):
    check(story)


def test_every_change_says_whether_the_event_was_optional():
    log = Log()
    log.requests_event("mutual_facial_gaze", 1.0, optional=True)
    log.looks(ROBOT, HUMAN, 1.3)
    log.looks(HUMAN, ROBOT, 1.8)
    log.looks(HUMAN, "table", 3.0)

    assert [event.optional for event in log.events] == [True, True, True]


def test_the_start_says_how_long_the_robot_has():
    log = Log()
    log.looks(HUMAN, ROBOT, 1.0)

    assert [event.limit for event in log.events] == [1.9]

"""Directed gaze: every row of the table, the person's; gaze resolution. Read `event_stories.py`."""

from tests.recognition.event_stories import check
from tests.recognition.observations import HUMAN, Log
from tests.stories import Story, each

STORIES = """
pointing directs the robot who follows
    1 human +point blue; 1.1 human +look blue; 1.5 robot +look blue; 2.3 robot +look human
    human's dg-1 at blue: started 1, succeeded 1.5 after 0.5, completed 2.3 lasting 0.8

a look directs once it has lasted
    1 human +look blue; 1.59 time; 1.6 time; 2 robot +look blue
    human's dg-1 at blue: started 1.6 since 1, succeeded 2 after 1

robot there already shares at once
    0.5 robot +look blue; 1 human +point blue
    human's dg-1 at blue: started 1, succeeded 1 after 0, completed 1 lasting 0

person's directed gaze fails at its limit
    1 human +point blue; 1.5 human -point blue; 3.5 time
    human's dg-1 at blue: started 1, failed 3.5 after 2.5

the person may look away before the robot arrives
    1 human +point blue; 1.1 human +look blue; 1.3 human +look; 1.6 robot +look blue
    human's dg-1 at blue: started 1, succeeded 1.6 after 0.6, completed 1.6 lasting 0

a look while the robot speaks directs nothing until it is silent
    0 robot +speak; 1 human +look blue; 3 time; 3 robot -speak; 3.6 time
    human's dg-1 at blue: started 3.6 since 3

a look while the looker speaks directs
    0.5 human +speak; 1 human +look blue; 1.6 time
    human's ap-1: started 0.5
    human's dg-1 at blue: started 1.6 since 1

a look soon after the robot's directed gaze directs nothing
    1 asks dg blue; 3.5 time; 5.4 human +look blue; 20 time
    robot's dg-1 at blue: started 1, failed 3.5 after 2.5

a look longer after the robot's directed gaze directs
    1 asks dg blue; 3.5 time; 5.6 human +look blue; 20 time
    robot's dg-1 at blue: started 1, failed 3.5 after 2.5
    human's dg-2 at blue: started 6.2 since 5.6, failed 8.1 after 2.5

a look that answered the robot never turns into a direction
    1 asks dg blue; 1.2 robot +look blue; 1.5 human +look blue; 2 robot +look human; 60 time
    robot's dg-1 at blue: started 1, succeeded 1.5 after 0.5, completed 2 lasting 0.5

a person moving an object directs nothing with looks
    1 human +look blue; 1.2 human +act blue; 3 human -act blue; 60 time
    human's ap-1: started 1.2, failed 4.5 after 3.3

only objects can be directed to
    TARGET in table somewhere
    1 human +look TARGET; 2 human +point TARGET; 9 time
    nothing

a face is met and not directed to
    1 human +look robot; 2 human +point robot; 9 time
    human's mfg-1: started 1, failed 2.9 after 1.9

directing while a fragment looks elsewhere is preempted
    0.5 owner fragment pink; 1 human +point blue
    human's dg-1 at blue: started 1, preempted 1

a fragment that looks there anyway preempts nothing
    0.5 owner fragment blue; 1 human +point blue; 1.2 robot +look blue
    human's dg-1 at blue: started 1, succeeded 1.2 after 0.2, completed 1.2 lasting 0

a fragment that takes the head preempts what waits
    1 human +point blue; 1.2 human +look robot; 1.5 owner fragment pink
    human's dg-1 at blue: started 1, preempted 1.5
    human's mfg-1: started 1.2, preempted 1.5

the robot's own reference adopts the person's direction
    1 human +point blue; 1.5 asks dg blue; 1.9 robot +look blue
    human's dg-1 at blue: started 1, succeeded 1.9 after 0.9, completed 1.9 lasting 0

the robot's own reference begins when the person's direction ends in vain
    1 human +point blue; 1.5 asks dg blue; 3.7 human +look blue
    human's dg-1 at blue: started 1, failed 3.5 after 2.5
    robot's dg-2 at blue: started 3.5 since 1.5, succeeded 3.7 after 2.2

a person who leaves fails a request that waits for their direction
    1 human +point blue; 1.1 lost human; 1.5 asks dg blue; 4 time
    human's dg-1 at blue: started 1, withdrawn 3.1
    robot's dg-2 at blue: started 3.1 since 1.5, failed 3.1 after 1.6

at resolution table anything on it will do
    TARGET in table pink
    with gaze_resolution=table
    1 asks dg blue; 2 human +look TARGET; 3.5 time
    robot's dg-1 at blue: started 1, succeeded 2 after 1

at resolution object the table will not do
    with gaze_resolution=object
    1 asks dg blue; 2 human +look table; 3.5 time
    robot's dg-1 at blue: started 1, failed 3.5 after 2.5

at resolution object another object will not do
    with gaze_resolution=object
    1 asks dg blue; 2 human +look pink; 3.5 time
    robot's dg-1 at blue: started 1, failed 3.5 after 2.5
    human's dg-2 at pink: started 2.6 since 2

at resolution table a face is not on the table
    with gaze_resolution=table
    1 asks dg blue; 2 human +look robot; 3.5 time
    robot's dg-1 at blue: started 1, failed 3.5 after 2.5
    human's mfg-1: started 2

at resolution table wandering over it stays shared
    with gaze_resolution=table
    1 asks dg blue; 1.2 robot +look blue; 2 human +look table; 2.5 human +look pink; 3 human +look robot
    robot's dg-1 at blue: started 1, succeeded 2 after 1, completed 3 lasting 1
    human's mfg-1: started 3
"""


@each(STORIES)
def test_a_directed_gaze_of_a_person(story: Story):
    check(story)


def test_the_start_says_how_long_the_robot_has_and_the_cause():
    log = Log()
    log.begins(HUMAN, "point", 1.0, "blue-square")

    assert [(event.limit, event.cause) for event in log.events] == [(2.5, "human")]


def test_a_fragment_that_looks_at_several_things_at_once_looks_at_each_of_them():
    log = Log()
    log.owner("fragment", "pink-triangle + blue-square", 0.5)
    log.begins(HUMAN, "point", 1.0, "blue-square")

    assert [event.state for event in log.events] == ["started"]

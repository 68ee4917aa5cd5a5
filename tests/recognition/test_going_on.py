"""What goes on, and becomes known only now, answers what waits for it and begins nothing. Read `event_stories.py`."""

from math import inf

import pytest

from tests.recognition.event_stories import check
from tests.recognition.observations import HUMAN, ROBOT, Log
from tests.stories import Story, each

STORIES = """
a look that goes on begins nothing
    TARGET in robot blue
    20 human ~look TARGET since=1; 40 time
    nothing

a look that goes on has been there before the robot asks
    20 human ~look robot since=1; 21 asks mfg
    robot's mfg-1: started 21, succeeded 21 after 0

the look of the robot that goes on is there when a person looks
    20 robot ~look human since=1; 21 human +look robot
    human's mfg-1: started 21, succeeded 21 after 0

a look that was missed answers at the time at which it began
    1 asks dg blue; 3.2 human ~look blue since=2
    robot's dg-1 at blue: started 1, succeeded 2 after 1

a look of the robot that was missed answers at the time at which it began
    1 human +look robot; 2.2 robot ~look human since=1.5
    human's mfg-1: started 1, succeeded 1.5 after 0.5

a limit that has passed stays passed
    1 asks dg blue; 10 human ~look blue since=2
    robot's dg-1 at blue: started 1, failed 3.5 after 2.5

a look that goes on ends like any other
    1 robot +look human; 20 human ~look robot since=2; 21 asks mfg; 23 human -look robot; 24 time
    robot's mfg-1: started 21, succeeded 21 after 0, completed 23 lasting 2 told 23.001

a newer look counts more
    20 human +look blue; 21 human ~look robot since=1; 22 asks mfg; 24 time
    human's dg-1 at blue: started 20.6 since 20, failed 22.5 after 2.5
    robot's mfg-1: started 22, failed 23.9 after 1.9

speech and manipulation that go on begin no turn
    ACTION in speak act
    20 human ~ACTION blue since=1; 25 human -ACTION blue; 30 time
    nothing

a manipulation that was missed is the answer at the time at which it began
    1 asked act; 5 human ~act blue since=3; 9 human -act blue
    robot's ap-1: started 1, succeeded 3 after 1 by act, completed 9 lasting 6

what had begun before the question is no answer
    2 human ~act blue since=0.5; 1 asked act; 12 time
    robot's ap-1: started 1, failed 10 after 9

words of the robot that were missed are the answer
    1 human +speak; 2 human -speak; 3.2 robot ~speak words since=2.5; 5 robot -speak words
    human's ap-1: started 1, succeeded 2.5 after 0.5 by speak, completed 5 lasting 2.5

a nod of the robot that was missed is the answer
    1 human +speak; 2 human -speak; 3.2 robot ~nod block-1:head-1 since=2.5; 3.5 robot -nod block-1:head-1
    human's ap-1: started 1, succeeded 2.5 after 0.5 by nod, completed 3.5 lasting 1

a turn that goes on after its body was out of reach is not withdrawn
    1 asking; 4 robot -speak words; 9 robot ~speak words since=1; 30 robot -speak words; 30 turn ended
    30.4 human +nod
    robot's ap-1: started 1, succeeded 30.4 after 0.4 by nod

a turn whose body stays out of reach is withdrawn
    1 asking; 4 robot -speak words; 17 time
    robot's ap-1: started 1, withdrawn 16
"""


@each(STORIES)
def test_what_goes_on(story: Story):
    check(story)


def test_the_floor_belongs_to_who_goes_on_speaking():
    log = Log()
    log.goes_on(HUMAN, "speak", 20.0, 1.0)
    log.goes_on(ROBOT, "speak", 20.0, 2.0, behavior="block-1:speech-1")

    speech = log.session.persons[HUMAN].talk.speeches.going_on
    assert speech is not None
    assert speech.since == 1.0
    assert log.session.scene.robot_speaks_since == 2.0
    assert log.session.scene.others_silent_since(HUMAN) == inf


@pytest.mark.parametrize(("action", "longest"), [("speak", 60.0), ("act", 120.0)])
def test_the_longest_time_counts_from_when_it_became_known(action, longest):
    log = Log()
    log.goes_on(HUMAN, action, 500.0, 1.0)
    log.until(500.0 + longest - 0.1)
    speech = log.session.persons[HUMAN].talk.speeches.going_on
    doing = (speech and speech.since, set(log.session.busy))
    log.until(500.0 + longest)

    assert doing in ((1.0, set()), (None, {HUMAN}))
    assert log.session.persons[HUMAN].talk.speeches.going_on is None
    assert log.session.busy == set()


def test_it_brings_back_who_had_gone():
    log = Log("host")
    log.found(HUMAN, 1.0)
    log.lost(HUMAN, 2.0)
    log.until(3.0)
    log.goes_on(HUMAN, "look", 10.0, 1.5, ROBOT)

    assert log.session.persons[HUMAN].presence.here
    assert log.session.persons[HUMAN].gazes.on_robots_face

"""Adjacency pairs: every row of the table, both initiators, exact times. Read `event_stories.py`."""

import pytest

from tests.recognition.event_stories import check
from tests.recognition.observations import HUMAN, ROBOT, Log
from tests.stories import Story, each

OF_ROBOT = """
person answers within the limit
    ACTION in speak nod shake point
    1 asked; 2.4 human +ACTION; 3.4 human -ACTION
    robot's ap-1: started 1, succeeded 2.4 after 0.4 by ACTION, completed 3.4 lasting 1

no answer fails at the limit after the turn's end
    1 asked; 9 time
    robot's ap-1: started 1, failed 3.5 after 2.5

who nods too late, and begins to speak before that is over, has answered with both
    1 asked; 4 human +nod; 4.3 human +speak; 4.5 human -nod; 5 human -speak; 9 time
    robot's ap-1: started 1, failed 3.5 after 2.5, failed 4 after 2

manipulation has longer when it is accepted
    1 asked act; 9.5 human +act blue; 11 human -act blue
    robot's ap-1: started 1, succeeded 9.5 after 7.5 by act, completed 11 lasting 1.5

what is not accepted answers nothing
    1 asked nod; 2.2 human +speak; 2.3 human +act; 3.5 time
    robot's ap-1: started 1, failed 3.5 after 2.5

an interruption is decided at the turn's end with a negative delay
    1 asking; 1.5 human +speak; 2.5 time; 3 turn ended; 3.4 human -speak
    robot's ap-1: started 1, succeeded 3 after -1.5 by speak, completed 3.4 lasting 1.9

an interruption that is over before the turn completes with it
    1 asking; 1.2 human +speak; 2.2 human -speak; 3 turn ended
    robot's ap-1: started 1, succeeded 3 after -1.8 by speak, completed 3 lasting 1

short speech that outlasts the turn is the answer
    1 asking; 1.8 human +speak; 2 robot -speak words; 2 turn ended; 2.2 human -speak
    robot's ap-1: started 1, succeeded 2 after -0.2 by speak, completed 2.2 lasting 0.4

pauses between the robot's words belong to its turn
    1 asking; 1.5 robot -speak words; 1.7 human +nod; 1.9 human -nod
    robot's ap-1: started 1
    robot's bc-1: started 1.9 since 1.7, succeeded 1.9, completed 1.9 lasting 0.2

manipulation during the turn answers early
    1 asking act; 1.5 human +act blue; 2 turn ended
    robot's ap-1: started 1, succeeded 2 after -0.5 by act

the end of another turn starts no clock
    1 asking; 2 turn ended turn=turn-9; 5 time
    robot's ap-1: started 1

a pair announced after its turn's end has its clock
    2 turn ended; 1 asks ap turn=turn-1; 3.5 time
    robot's ap-1: started 1, failed 3.5 after 2.5

without a turn the block is the turn
    1 robot +speak block-1:speech-1; 1 asks ap turn=; 2 block done; 3.5 time
    robot's ap-1: started 1, failed 3.5 after 2.5

an aborted turn withdraws the question
    1 asking; 1.5 turn aborted
    robot's ap-1: started 1, withdrawn 1.5

a cancelled request withdraws the question
    1 asking; 1.5 cancels 1
    robot's ap-1: started 1, withdrawn 1.5

a question that is asked is answered though the realizer has died since
    WHY in gone closed unrenewed unlinked restarted
    1 asked; 2.2 cancels 1 cause=WHY; 2.4 human +nod; 3.4 human -nod
    robot's ap-1: started 1, succeeded 2.4 after 0.4 by nod, completed 3.4 lasting 1

a question of which the turn was under way when the realizer died is withdrawn
    1 asking; 1.5 cancels 1 cause=gone
    robot's ap-1: started 1, withdrawn 1.5

a question that is asked can be cancelled
    1 asked; 2.2 cancels 1
    robot's ap-1: started 1, withdrawn 2.2

a third turn while somebody talks into the first ends both
    1 asking; 1.5 human +speak; 2.5 turn repaired
    robot's ap-1: started 1, succeeded 2.5 after -1 by speak, completed 2.5 lasting 1

who interrupted an aborted turn has answered
    1 asking; 1.5 human +speak; 2.4 time; 2.5 turn aborted
    robot's ap-1: started 1, succeeded 2.5 after -1 by speak

a new question supersedes the pending one
    1 asked; 3 asks ap turn=turn-2
    robot's ap-1: started 1, superseded 3
    robot's ap-2: started 3

a new question completes the answer to the last
    1 asked act; 3 human +act blue; 4 asks ap turn=turn-2
    robot's ap-1: started 1, succeeded 3 after 1 by act, completed 4 lasting 1
    robot's ap-2: started 4

a turn that nobody ends is given up
    1 asking; 20 time; 20 robot -speak words; 32 time
    robot's ap-1: started 1, withdrawn 32

the third turn closes a pair that was answered
    1 asked; 2.5 human +speak; 3 turn repaired
    robot's ap-1: started 1, succeeded 2.5 after 0.5 by speak, completed 3 lasting 0.5

the third turn closes a pair that nobody was seen to answer
    1 asked; 3 turn repaired
    robot's ap-1: started 1, succeeded 3, completed 3
"""


@each(OF_ROBOT)
def test_a_pair_of_the_robot(story: Story):
    check(story)


OF_PERSON = """
robot answers a person's turn
    1 human +speak; 2 human -speak; 2.6 robot +speak; 3.6 robot -speak
    human's ap-1: started 1, succeeded 2.6 after 0.6 by speak, completed 3.6 lasting 1

robot answers with a gesture
    ACTION in nod shake point
    1 human +speak; 2 human -speak; 2.6 robot +ACTION; 3 robot -ACTION
    human's ap-1: started 1, succeeded 2.6 after 0.6 by ACTION, completed 3 lasting 0.4

a fragment that is a second or third turn answers whoever waits
    SIGNAL in answered repaired
    1 human +speak; 2 human -speak; 2.3 turn SIGNAL block=block-1; 2.9 block done
    human's ap-1: started 1, succeeded 2.3 after 0.3 by speak, completed 2.9 lasting 0.6

no answer to a person fails
    1 human +speak; 2 human -speak; 3.5 time
    human's ap-1: started 1, failed 3.5 after 2.5

manipulation asks for an answer from its end on
    1 human +act blue; 4 human -act blue; 5 robot +speak
    human's ap-1: started 1, succeeded 5 after 1 by speak

a person who goes on speaking has not ended the turn
    1 human +speak; 2 human -speak; 3 human +speak; 6 time; 6 human -speak; 7.5 time
    human's ap-1: started 1, failed 7.5 after 6.5

the robot's question is the answer to a person who has finished
    1 human +speak; 2 human -speak; 2.5 asks ap turn=turn-1
    human's ap-1: started 1, succeeded 2.5 after 0.5 by speak, completed 2.5 lasting 0
    robot's ap-2: started 2.5

the robot's question before the person has ended answers with a negative delay
    1 human +speak; 1.5 robot +speak; 1.5 asks ap turn=turn-1; 2 human -speak; 4 robot -speak; 4 turn ended
    human's ap-1: started 1, succeeded 2 after -0.5 by speak, completed 4 lasting 2.5
    robot's ap-2: started 1.5

a robot that falls silent before the person has ended has answered, too
    1 human +speak; 1.5 asks ap turn=turn-1; 1.5 robot +speak; 2 robot -speak; 2 turn ended; 3 human -speak; 4 time
    human's ap-1: started 1, succeeded 3 after -1.5 by speak, completed 3 lasting 0.5
    robot's ap-2: started 1.5, failed 3.5 after 2

a person who leaves while the robot cuts in has been answered
    1 human +speak; 1.5 robot +speak; 1.5 asks ap turn=turn-1; 2 lost human; 9 time
    human's ap-1: started 1, succeeded 4 after -2.5 by speak, completed 4 lasting 0.5
    robot's ap-2: started 1.5, failed 4 after 2.5

robot that interrupts has answered when the person has finished
    1 human +speak; 1.5 robot +speak; 3 human -speak; 3.5 robot -speak
    human's ap-1: started 1, succeeded 3 after -1.5 by speak, completed 3.5 lasting 2

a person who leaves while speaking withdraws
    1 human +speak; 2 lost human; 4 time
    human's ap-1: started 1, withdrawn 4

a person who leaves while answering has answered
    1 asked; 2.5 human +speak; 3 lost human; 5 time
    robot's ap-1: started 1, succeeded 2.5 after 0.5 by speak, completed 5 lasting 0.5
"""


@each(OF_PERSON)
def test_a_pair_of_a_person(story: Story):
    check(story)


@pytest.mark.parametrize(("at", "pairs"), [(4.9, {"ap-1"}), (5.2, {"ap-1", "ap-2"})])
def test_the_initiator_speaking_again_at_once_is_the_third_turn(at, pairs):
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.begins(ROBOT, "speak", 2.6)
    log.ends(ROBOT, "speak", 3.6)
    log.begins(HUMAN, "speak", at)

    assert {event.id for event in log.events} == pairs

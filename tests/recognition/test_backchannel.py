"""Backchannels: every row of the table, both listeners, exact times. Read `event_stories.py`."""

from tests.recognition.event_stories import check
from tests.stories import Story, each

STORIES = """
short speech while the robot speaks is a backchannel known at its end
    1 asking; 1.5 human +speak; 2.3 human -speak
    robot's ap-1: started 1
    robot's bc-1: started 2.3 since 1.5, succeeded 2.3, completed 2.3 lasting 0.8

longer speech while the robot speaks is a change of floor
    1 robot +speak; 1.5 human +speak; 2.3 time
    human's ap-1: started 1.5 told 2.3

gestures while the robot speaks are backchannels
    ACTION in nod shake
    1 robot +speak; 1.5 human +ACTION; 2.5 human +ACTION; 3 human -ACTION
    robot's bc-1: started 2.5 since 1.5, succeeded 2.5, completed 2.5 lasting 1
    robot's bc-2: started 3 since 2.5, succeeded 3, completed 3 lasting 0.5

a nod into silence is nothing
    1 human +nod; 1.5 human -nod
    nothing

robot's nod while a person speaks is a backchannel
    1 human +speak; 1.5 robot +nod; 2 robot -nod
    human's ap-1: started 1
    human's bc-1: started 1.5, succeeded 1.5, completed 2 lasting 0.5

robot's short speech while a person speaks is a backchannel
    1 human +speak; 1.5 robot +speak; 1.9 robot -speak
    human's ap-1: started 1
    human's bc-1: started 1.9 since 1.5, succeeded 1.9, completed 1.9 lasting 0.4

a nod that was announced is one event
    1 human +speak; 1.5 asks bc; 1.5 robot +nod; 2 robot -nod
    human's ap-1: started 1
    human's bc-1: started 1.5, succeeded 1.5, completed 2 lasting 0.5

a nod that is announced when it has begun is one event
    1 human +speak; 1.5 robot +nod; 1.5 asks bc; 2 robot -nod
    human's ap-1: started 1
    human's bc-1: started 1.5, succeeded 1.5, completed 2 lasting 0.5

a word that was announced is one event
    1 human +speak; 1.5 asks bc; 1.5 robot +speak; 1.9 robot -speak
    human's ap-1: started 1
    human's bc-1: started 1.5, succeeded 1.5, completed 1.9 lasting 0.4

a word that is announced when it has begun is one event
    1 human +speak; 1.5 robot +speak; 1.5 asks bc; 1.9 robot -speak
    human's ap-1: started 1
    human's bc-1: started 1.5, succeeded 1.5, completed 1.9 lasting 0.4

an announced backchannel ends with its block
    1.5 asks bc; 1.9 block done
    human's bc-1: started 1.5, succeeded 1.5, completed 1.9 lasting 0.4

a gesture whose person vanishes is completed
    1 robot +speak; 1.5 human +nod; 1.6 lost human; 3.6 time
    robot's bc-1: started 1.6 since 1.5 told 3.6, succeeded 1.6 told 3.6, completed 1.6 lasting 0.1 told 3.6

late and repeated speech does not speak for ever
    1 human +speak; 2 human -speak; 1 human +speak; 3.5 time
    human's ap-1: started 1, failed 3.5 after 2.5
"""


@each(STORIES)
def test_a_backchannel(story: Story):
    check(story)

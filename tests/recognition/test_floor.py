"""Who has the floor when both speak, or when a sign is small: no answer is lost, and no uh-huh is an answer."""

from tests.recognition.event_stories import check
from tests.stories import Story, each

STORIES = """
an uh-huh of the robot in a pause answers nobody
    1 human +speak; 3 human -speak; 3.3 asks bc block=b; 3.3 robot +speak b:s; 3.7 robot -speak b:s
    3.9 human +speak; 6 human -speak; 6.5 robot +speak; 8 robot -speak
    human's ap-1: started 1, succeeded 6.5 after 0.5 by speak, completed 8 lasting 1.5
    human's bc-1: started 3.3, succeeded 3.3, completed 3.7 lasting 0.4

words after the nod of one backchannel answer nobody either
    1 human +speak; 3 human -speak; 3.3 asks bc block=b; 3.3 robot +nod b:n; 3.5 robot -nod b:n
    3.6 robot +speak b:s; 3.9 robot -speak b:s; 4 robot +speak c:s; 5 robot -speak c:s
    human's ap-1: started 1, succeeded 4 after 1 by speak, completed 5 lasting 1
    human's bc-1: started 3.3, succeeded 3.3, completed 3.5 lasting 0.2

other words of the robot beside its backchannel are an answer
    1 human +speak; 3 human -speak; 3.3 asks bc block=b; 3.3 robot +nod b:n; 3.4 robot +speak c:s; 5 robot -speak c:s
    human's ap-1: started 1, succeeded 3.4 after 0.4 by speak, completed 5 lasting 1.6
    human's bc-1: started 3.3, succeeded 3.3, completed 5 lasting 1.7

a nod beside an uh-huh is no answer
    1 asking; 1.5 human +speak; 1.55 human +nod; 1.9 human -speak; 2.1 human -nod; 3 robot -speak words
    3 turn ended
    robot's ap-1: started 1
    robot's bc-1: started 1.9 since 1.5, succeeded 1.9, completed 1.9 lasting 0.4

speech over the last word comes before a nod that began later
    1 asking; 2.8 human +speak; 2.9 human +nod; 3 robot -speak words; 3 turn ended; 4 human -speak
    robot's ap-1: started 1, succeeded 3 after -0.2 by speak, completed 4 lasting 1.2
"""

LATE = """
an answer after the limit is told with the pair that failed, and is no pair of the person
    1 asked; 3.6 human +speak; 4.5 human -speak; 9 time
    robot's ap-1: started 1, failed 3.5 after 2.5, failed 3.6 after 1.6

late answers are nods, too
    ACTION in nod shake point
    1 asked; 5 human +ACTION; 6 human -ACTION; 9 time
    robot's ap-1: started 1, failed 3.5 after 2.5, failed 5 after 3

only the first of them is the answer
    1 asked; 5 human +speak; 6 human -speak; 7 human +speak; 8 human -speak; 9 time
    robot's ap-1: started 1, failed 3.5 after 2.5, failed 5 after 3
    human's ap-2: started 7

what is not accepted is no late answer
    1 asked nod; 5 human +speak; 6 human -speak
    robot's ap-1: started 1, failed 3.5 after 2.5
    human's ap-2: started 5

after other words of the robot nothing answers the turn before
    1 asked; 4 robot +speak c:s; 5 robot -speak c:s; 6 human +speak
    robot's ap-1: started 1, failed 3.5 after 2.5
    human's ap-2: started 6

an answer may come a minute late
    1 asked; 62.9 human +speak; 64 human -speak
    robot's ap-1: started 1, failed 3.5 after 2.5, failed 62.9 after 60.9

who leaves and comes back begins anew
    1 asked; 4 lost human; 6 time; 6.1 found human; 6.5 human +speak
    robot's ap-1: started 1, failed 3.5 after 2.5
    human's ap-2: started 6.5

a question soon after the third turn's time is a question, however long an answer may take
    with adjacency_pair_limit=4 third_turn_limit=1.5
    1 human +speak; 2 human -speak; 2.5 robot +speak; 3 robot -speak; 5 human +speak; 6 human -speak
    human's ap-1: started 1, succeeded 2.5 after 0.5 by speak, completed 3 lasting 0.5
    human's ap-2: started 5
"""


@each(LATE)
def test_a_late_answer(story: Story) -> None:
    check(story)


@each(STORIES)
def test_a_sign(story: Story) -> None:
    check(story)

"""Who has the floor when both speak, or when a sign is small: no answer is lost, and no uh-huh is an answer."""

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.recognition import Interjection
from tests.recognition.event_stories import check
from tests.recognition.observations import HUMAN, ROBOT, Log
from tests.stories import Story, each

STORIES = """
an uh-huh of the robot in a pause answers nobody
    1 human +speak; 3 human -speak; 3.3 asks bc block=b; 3.3 robot +speak b:s; 3.7 robot -speak b:s
    3.9 human +speak; 6 human -speak; 6.5 robot +speak; 8 robot -speak
    human's ap-1: started 1, succeeded 6.5 after 0.5 by speak, completed 8 lasting 1.5
    human's bc-1: started 3.3, succeeded 3.3, completed 3.7 lasting 0.4

who speaks again over an uh-huh of the robot speaks into nothing, and has the floor
    1 human +speak; 3 human -speak; 3.3 asks bc block=b; 3.3 robot +speak b:s; 3.5 human +speak; 3.7 robot -speak b:s
    6 human -speak; 6.5 robot +speak; 8 robot -speak
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
    robot's bc-1: started 2.1 since 1.5, succeeded 2.1, completed 2.1 lasting 0.6

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


@given(
    spoken=st.integers(2, 60), offset=st.integers(-59, 39), answered=st.integers(2, 60), announced=st.booleans(),
)  # fmt: skip
def test_the_delay_of_a_robots_answer_is_its_start_less_the_end_of_what_it_answers(
    spoken: int, offset: int, answered: int, *, announced: bool
) -> None:
    """Tenths of a second. offset: of the robot's start from the person's end; negative: it cuts in."""
    offset = max(offset, 1 - spoken)
    answered = answered if announced else max(answered, 9)  # else it is a backchannel, which answers nobody
    end = (10 + spoken) / 10
    start, stop = end + offset / 10, end + (offset + answered) / 10
    log = Log(adjacency_pair_limit=4.0)
    steps: list[tuple[float, int, Callable[[], object]]] = [
        (1.0, 0, lambda: log.begins(HUMAN, "speak", 1.0)),
        (end, 2, lambda: log.ends(HUMAN, "speak", end)),
        (start, 1, lambda: log.begins(ROBOT, "speak", start, behavior="block-1:s")),
        (stop, 3, lambda: log.ends(ROBOT, "speak", stop, behavior="block-1:s")),
    ]
    if announced:
        steps.append((start, 0, lambda: log.requests_event("adjacency_pair", start, turn="turn-1")))
        steps.append((stop, 4, lambda: log.signals("ended", stop)))
    for _, _, step in sorted(steps, key=lambda each: each[:2]):
        step()
    log.until(100.0)

    pairs = {each.id: each for each in log.events if each.kind == "adjacency_pair"}
    persons = [id for id, each in pairs.items() if each.initiator == HUMAN]
    assert len(persons) == 1
    told = log.succeeded(persons[0])
    assert told.delay == pytest.approx(start - end)
    assert told.at.seconds == pytest.approx(max(start, end))
    assert log.states(persons[0]) == ["started", "succeeded", "completed"]
    assert len(pairs) == 1 + announced


def test_an_uh_huh_of_the_robot_is_no_speech_and_nobody_speaks_into_it() -> None:
    log = Log(HUMAN)
    log.begins(HUMAN, "speak", 1.0)
    log.requests_event("backchannel", 2.0, responder=HUMAN, block="b")
    log.begins(ROBOT, "speak", 2.0, behavior="b:words")
    assert [each.actor for each in log.session.floor()] == [HUMAN]

    log.ends(HUMAN, "speak", 2.1)
    log.begins(HUMAN, "speak", 2.2)
    log.ends(ROBOT, "speak", 2.4, behavior="b:words")
    log.block_ends(2.4, block="b")
    log.until(9.0)

    assert [each.actor for each in log.session.scene.spoken] == [HUMAN, HUMAN]
    assert not [each for each in log.effects if isinstance(each, Interjection)]

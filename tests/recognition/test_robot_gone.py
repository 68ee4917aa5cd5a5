"""The ends of what the robot does may be lost: nothing stays open for that."""

from tests.recognition.event_stories import check
from tests.recognition.observations import HUMAN, ROBOT, Log
from tests.stories import Story, each

STORIES = """
speech whose end is lost ends with its block and later words are no backchannel
    1 human +speak; 2 human -speak; 2.5 robot +speak words; 4 block failed; 7 human +speak
    human's ap-1: started 1, succeeded 2.5 after 0.5 by speak, completed 4 lasting 1.5
    human's ap-2: started 7

a gesture whose end is lost ends with its block
    GESTURE in nod shake
    1 human +speak; 1.5 robot +GESTURE block-1:head-1; 2 block done
    human's ap-1: started 1
    human's bc-1: started 1.5, succeeded 1.5, completed 2 lasting 0.5
"""


@each(STORIES)
def test_what_ends_without_its_end(story: Story):
    check(story)


def speaking() -> Log:
    """The robot answers a person, and never stops."""
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.begins(ROBOT, "speak", 2.5, behavior="block-1:speech-1")
    return log


def test_another_block_ends_nothing():
    log = speaking()
    log.block_ends(4.0, block="block-10")
    log.block_ends(4.0, block="block")

    assert log.states("ap-1") == ["started", "succeeded"]


def test_the_end_that_comes_after_its_block_changes_nothing():
    log = speaking()
    log.block_ends(4.0)
    log.begins(ROBOT, "speak", 4.5, behavior="block-2:speech-1")
    log.ends(ROBOT, "speak", 4.6, behavior="block-1:speech-1")

    assert log.session.scene.robot_speaks_since == 4.5

"""The ends of what the robot does may be lost, with its body or on the way: nothing stays open for that."""

import pytest

from engage_hri.schemas.presence import PeerGone
from tests.recognition.observations import HUMAN, ROBOT, Log

CONTROL_GONE = PeerGone(participant="control")


def speaking() -> Log:
    """The robot answers a person, and never stops."""
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.ends(HUMAN, "speak", 2.0)
    log.begins(ROBOT, "speak", 2.5, behavior="block-1:speech-1")
    return log


def test_speech_whose_end_is_lost_ends_with_its_block():
    log = speaking()
    log.block_ends(4.0, status="failed")
    log.begins(HUMAN, "speak", 7.0)

    assert log.told() == [
        ("ap-1", "started", 1.0),
        ("ap-1", "succeeded", 2.5),
        ("ap-1", "completed", 4.0),
        ("ap-2", "started", 7.0),  # it is no backchannel to a robot that has long been silent
    ]


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


@pytest.mark.parametrize("gesture", ["nod", "shake"])
def test_a_gesture_whose_end_is_lost_ends_with_its_block(gesture):
    log = Log()
    log.begins(HUMAN, "speak", 1.0)
    log.begins(ROBOT, gesture, 1.5, behavior="block-1:head-1")
    log.block_ends(2.0)

    assert log.told("backchannel")[-1] == ("bc-1", "completed", 2.0)


def test_a_body_that_vanishes_has_stopped_speaking_and_looking():
    log = speaking()
    log.looks(ROBOT, HUMAN, 2.6)
    log.looks(HUMAN, ROBOT, 3.0)
    log.feed(CONTROL_GONE, 3.5)
    log.until(3.6)

    assert log.told()[-2:] == [("ap-1", "completed", 3.5), ("mfg-1", "completed", 3.5)]
    assert log.session.scene.robot_speaks_since is None


def test_others_who_vanish_are_not_the_body():
    log = speaking()
    log.feed(PeerGone(participant="generation"), 3.5)

    assert log.session.scene.robot_speaks_since == 2.5

"""What the robot does besides actions, in words, and the sync point at which each is told."""

import pytest

from engage_hri.schemas.behaviors import Gesture
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.console.performed import Deed, deeds

WORDS = {
    '<gesture id="x" lexeme="WAVE"/>': ("strokeStart", "makes the gesture WAVE"),
    '<gesture id="x" lexeme="WAVE" mode="LEFT_HAND"/>': ("strokeStart", "makes the gesture WAVE with the left hand"),
    '<head id="x" lexeme="TILT"/>': ("strokeStart", "moves the head: TILT"),
    '<faceLexeme id="x" lexeme="SMILE"/>': ("attackPeak", "shows the face SMILE"),
    '<faceFacs id="x" au="12" side="LEFT"/>': ("attackPeak", "shows the face AU 12 left"),
    '<faceShift id="x"><lexeme lexeme="SMILE"/></faceShift>': ("end", "shows the face SMILE"),
    '<posture id="x"><stance type="SITTING"/><pose part="ARMS" lexeme="ARMS_OPEN"/></posture>': (
        "ready", "takes the posture SITTING and ARMS_OPEN ARMS",
    ),
    '<gaze id="x" target="cup" offsetAngle="20" offsetDirection="LEFT"/>': ("ready", "looks 20° LEFT of cup"),
    '<locomotion id="x" target="door"/>': ("end", "moves to door"),
}  # fmt: skip


@pytest.mark.parametrize("xml", WORDS)
def test_each_behavior_that_is_no_action_has_its_words(xml: str) -> None:
    block = decode_xml(f'<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b">{xml}</bml>')
    assert isinstance(block, Block)

    assert deeds(block) == {("b", "x"): Deed(*WORDS[xml])}


@pytest.mark.parametrize(
    "xml",
    [
        '<gaze id="x" target="cup"/>',
        '<pointing id="x" target="cup"/>',
        '<head id="x" lexeme="nod"/>',
        '<speech id="x"><text>so</text></speech>',
        '<wait id="x" duration="1"/>',
    ],
)
def test_of_what_is_seen_as_an_action_and_of_what_is_not_seen_nothing_is_said(xml: str) -> None:
    block = decode_xml(f'<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b">{xml}</bml>')
    assert isinstance(block, Block)

    assert deeds(block) == {}


def test_gestures_of_a_fragment_are_told_in_the_spelling_of_its_block() -> None:
    fragment = TurnFragment(id="f", behaviors=(Gesture(id="x", lexeme="BEAT"),))

    assert deeds(fragment) == {("f", "x"): Deed("stroke_start", "makes the gesture BEAT")}

"""What the robot does besides actions, in words, and the sync point at which each is told."""

import pytest

from engage_hri.schemas.behaviors import Gesture
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.schemas.world import Entity, World
from engage_hri.services.console.wording import Deed, deeds
from engage_hri.services.control.torso.body import SimulatedBody

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

    told = Deed("stroke_start", "makes the gesture BEAT")
    assert deeds(fragment) == {("f", "x"): told}


@pytest.mark.parametrize(
    ("xml", "words"),
    [
        ('<gesture id="x" lexeme="METAPHORIC"/>', "makes the gesture METAPHORIC, as near as it can"),
        ('<faceFacs id="x" au="9"/>', "shows the face AU 9, as near as it can"),
        ('<gaze id="x" target="cup" offsetAngle="20" offsetDirection="LEFT" influence="EYES"/>',
         "looks 20° LEFT of cup, as near as it can"),
    ],
)  # fmt: skip
async def test_what_the_simulated_body_lacks_is_told_as_near(xml: str, words: str) -> None:
    block = decode_xml(f'<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b">{xml}</bml>')
    assert isinstance(block, Block)
    world = World(entities=(Entity(id="cup", kind="object", position=(0.6, 0.0, 1.0)),))
    estimate = SimulatedBody().estimate(block.behaviors[0], None, world)

    assert deeds(block)["b", "x"].as_warned(f"line 1: {estimate.degraded}").words == words


def test_words_that_name_nothing_in_its_place_are_told_as_near() -> None:
    fragment = TurnFragment(id="f", behaviors=(Gesture(id="x", lexeme="BEAT"),))
    deed = deeds(fragment)["f", "x"]

    assert deed.as_warned("this body has no right elbow").words == "makes the gesture BEAT, as near as it can"
    assert deed.as_warned("attribute 'power' of <gesture>; it is ignored").words == "makes the gesture BEAT"

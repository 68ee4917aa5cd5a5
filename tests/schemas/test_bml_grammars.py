"""The grammars of BML 1.0 refuse what is not BML 1.0; what is, and what we write, they accept."""

import pytest

from engage_hri.schemas.behaviors import FaceShift, Mark, Speech, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_encode import encode_xml
from tests.schemas.grammar import violations

GAZE = '<gaze id="g" target="t"/>'


def block(content: str, attributes: str = 'id="b"') -> str:
    return f'<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" {attributes}>{content}</bml>'


@pytest.mark.parametrize(
    "content",
    [
        "", GAZE, '<gaze id="g" target="t" start="a:b:stroke:2 + .5" ready="-1" end="b:2"/>',
        '<gazeShift id="g" target="t" influence="WAIST" offsetAngle="-5" offsetDirection="UP" end="bml:start+3"/>',
        '<gesture id="g" lexeme="BEAT" mode="BOTH_HANDS" strokeStart="1"/>', f"<required>{GAZE}</required>",
        '<pointing id="g" target="t"/><head id="h" lexeme="NOD" repetition="2" amount=".5" stroke="1"/>',
        '<speech id="s" end="3"><text>a <sync id="m" ref="g:ready"/>b</text></speech>', '<wait id="w" duration="1"/>',
        '<speech id="s"><text/><description priority="1" type="application/ssml+xml"><speak/></description></speech>',
        '<face id="f" overshoot="0.1" attackPeak="1"><lexeme lexeme="SMILE" amount="1"/></face>',
        '<faceFacs xmlns="http://www.bml-initiative.org/bml/coreextensions-1.0" id="f" au="1" side="LEFT"/>',
        '<posture id="p" relax="1"><stance type="SITTING"/><pose part="ARMS" lexeme="CROSSED"/></posture>',
        '<locomotion id="l" target="t" manner="WALK"/><headDirectionShift id="d" target="t"/>',
        '<constraint id="c"><synchronize><sync ref="g:start"/><sync ref="1"/></synchronize></constraint>',
        '<constraint><before ref="g:end"><sync ref="h:start - 1"/></before></constraint>',
        '<constraint id="c"><after ref="2"><sync ref="h:m-2"/><sync ref="h:end"/></after></constraint>',
        '<ebml:event xmlns:ebml="edu.wpi.ebml" id="e" kind="x"/>',
    ],
)  # fmt: skip
def test_bml_1_0_is_accepted(content: str) -> None:
    assert violations(block(content)) == []


@pytest.mark.parametrize(
    "content",
    [
        '<gaze id="g"/>', '<gaze target="t"/>', '<gaze id="1" target="t"/>', '<gaze id="g" target="t" stroke="1"/>',
        '<gaze id="g" target="t" offsetDirection="up"/>', '<gazeShift id="g" target="t" ready="1"/>', "words",
        '<gesture id="g"/>', '<gesture id="g" lexeme="B" hand="left"/>', '<gesture id="g" lexeme="B" mode="left"/>',
        '<gesture id="g" type="POINT" target="t"/>', '<gesture id="g" lexeme="BEAT" stroke_start="1"/>',
        '<head id="h" lexeme="NOD" amount="2"/>', '<head id="h" lexeme="NOD" repetition="0"/>', '<nod id="n"/>',
        '<speech id="s">words</speech>', '<speech id="s"/>', '<speech id="s" m="1"><text>a</text></speech>',
        '<speech id="s"><text>a<sync ref="m"/></text></speech>', '<speech id="s"><text>a<tm id="m"/></text></speech>',
        '<faceLexeme id="f" lexeme="SMILE" stroke="1"/>', '<faceFacs id="f"/>', '<faceShift id="f" lexeme="SMILE"/>',
        '<posture id="p" lexeme="X"/>', '<gaze id="g" target="t" required="true"/>', '<required id="r"/>',
        '<gaze id="g" target="t" start="a"/>', '<gaze id="g" target="t" start=":a:b"/>',
        '<wait id="w" duration="-1"/>', '<gaze id="g" target="t" start="a:relax:2"/>',
        '<gaze id="g" target="t" start="+x"/>',
        '<gaze id="g" target="t" start="a:b:c:d:e"/>', '<gaze id="g" target="t" start="a:stroke:0"/>',
        '<constraint/>', '<constraint><before><sync ref="a:b"/></before></constraint>',
        '<constraint><synchronize ref="a:b"><sync ref="c:d"/></synchronize></constraint>',
        '<constraint><after ref="a:b"/></constraint>', '<constraint required="true"><after ref="a:b"/></constraint>',
        '<constraint><synchronize><sync ref="a:b"/></synchronize></constraint>',
        '<event xmlns="edu.wpi.ebml.other" id="e"/>',
    ],
)  # fmt: skip
def test_what_is_not_bml_1_0_is_not(content: str) -> None:
    assert violations(block(content)) != []


@pytest.mark.parametrize(
    "attributes", ["", 'id="b" composition="merge"', 'id="b" composition="CHUNK"', 'id="b" character="Melvin"']
)
def test_neither_is_what_is_wrong_at_the_root(attributes: str) -> None:
    assert violations(block(GAZE, attributes)) != []


SPOKEN = Block(
    id="b",
    dialect="bml-1.0",
    behaviors=(
        Speech(
            id="s", text="One two", markup='<emphasis>One</emphasis> <mark name="m"/>two', marks=(Mark("m", 4),),
            timing=(Timing("start", "1"), Timing("m", "2.5")),
        ),
        FaceShift(id="f", au=12, side="LEFT"),
    ),
)  # fmt: skip


def test_markup_ties_of_marks_and_expressions_are_written_as_bml_1_0_has_them() -> None:
    written = encode_xml(SPOKEN)

    assert violations(written) == []
    for part in (b'<sync id="m" ref="2.5"/>', b"<emphasis>One</emphasis>", b'<facs au="12" side="LEFT"/>'):
        assert part in written
    assert b"edu.wpi.ebml" not in written
    again = decode_xml(written)
    assert isinstance(again, Block)
    assert again.behaviors[0].timing == SPOKEN.behaviors[0].timing
    assert isinstance(again.behaviors[0], Speech)
    assert again.behaviors[0].markup == '<emphasis>One</emphasis> <mark name="m"/>two'

"""Elements without the attribute that says what to do: dropped in a draft, refused where BML 1.0 demands it."""

import pytest

from engage_hri.schemas.behaviors import Speech, Unknown
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.documents.xml_source import BML_1_0, DRAFT
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.vocabulary import DEFINED
from engage_hri.services.realizer.plan.planner import plan_block

WORDS = '<speech id="s"><text>so</text></speech>'
LACKING = {
    '<locomotion id="x" type="VECTOR" velocity="1"/>': "<locomotion> has no target",
    '<head id="x"/>': "<head> has no rotation or orientation",
    '<head id="x" action="ROTATION"/>': "<head> has no rotation",
    '<head id="x" type="ORIENTATION"/>': "<head> has no orientation",
    '<gesture id="x"/>': "<gesture> has no type or lexeme",
    '<gesture id="x" type="POINT"/>': "<gesture> has no target",
    '<face id="x" type="FACS"/>': "<face> has no au",
}


def _block(content: str, namespace: str = DRAFT) -> Block:
    read = decode_xml(f'<bml xmlns="{namespace}" id="b">{content}{WORDS}</bml>')
    assert isinstance(read, Block)
    return read


@pytest.mark.parametrize("namespace", [DRAFT, ""])
@pytest.mark.parametrize("xml", LACKING)
def test_in_a_draft_the_behavior_is_dropped_with_one_warning_and_the_words_are_said(xml: str, namespace: str) -> None:
    plan = plan_block(_block(xml, namespace))

    assert [each.id for each in plan.behaviors] == ["s"]
    assert [(each.kind, each.behavior) for each in plan.problems] == [("CANNOT_CREATE_BEHAVIOR", "x")]
    assert (
        plan.problems[0].message == f"line 1: {LACKING[xml]}, so there is nothing to perform; the behavior is dropped"
    )


def test_what_depends_on_it_is_as_without_it_and_if_it_is_required_the_block_is_refused() -> None:
    plan = plan_block(
        _block('<head id="x" action="ROTATION" required="false"/><wait id="w" duration="1" start="x:end"/>')
    )

    assert {each.behavior for each in plan.problems} == {"x"}
    with pytest.raises(InputRefused, match="has no rotation"):
        plan_block(_block('<head id="x" action="ROTATION" required="true"/>'))


def test_it_is_written_and_read_again() -> None:
    read = _block('<head id="x" action="ROTATION"/>')

    assert read.behaviors[0] == Unknown(id="x", element="head", lacks="rotation", line=1)
    again = decode_xml(encode_xml(read))
    assert isinstance(again, Block)
    assert isinstance(again.behaviors[0], Unknown)
    assert again.behaviors[0].lacks == "rotation"


@pytest.mark.parametrize(
    ("xml", "lacks"),
    [
        ('<faceFacs id="x"/>', "au"),
        ('<head id="x"/>', "lexeme"),
        ('<gesture id="x"/>', "lexeme"),
        ('<locomotion id="x"/>', "target"),
        ('<gaze id="x"/>', "target"),
    ],
)
def test_what_bml_1_0_demands_is_refused_with_an_advice(xml: str, lacks: str) -> None:
    with pytest.raises(InputRefused) as refused:
        _block(xml, BML_1_0)

    assert refused.value.fault.reason.endswith(f": no {lacks}")
    assert refused.value.fault.advice == f'add {lacks}="..."'


@pytest.mark.parametrize("element", sorted(DEFINED["draft"]))
def test_an_element_of_the_draft_with_any_one_attribute_refuses_no_block(element: str) -> None:
    """But for what has to have a target, an event, or words."""
    needed = {"gaze": ' target="x"', "emit": ' event="e"', "speech": ' text="so"'}.get(element, "")
    attributes = {name: values[0] if values else "1" for name, values in DEFINED["draft"][element].items()}

    for name, value in ({"": ""} | attributes).items():
        given = f' {name}="{value}"' if name and f" {name}=" not in needed else ""
        read = _block(f'<{element} id="x"{needed}{given}/>')
        assert len(read.behaviors) == 2, name
        assert isinstance(read.behaviors[1], Speech)


@pytest.mark.parametrize(
    "xml",
    [
        '<posture id="x"/>', '<posture id="x"><pose part="ARMS"/></posture>', '<postureShift id="x"/>',
        '<pose id="x"/>', '<faceShift id="x"/>',
    ],
)  # fmt: skip
def test_a_face_or_posture_that_names_nothing_is_warned_of(xml: str) -> None:
    (problem,) = plan_block(_block(xml, BML_1_0)).problems

    assert (problem.kind, problem.behavior) == ("PARSING_FAILURE", "x")
    assert problem.message.endswith("has nothing in it that says what to show; it moves nothing")


def test_what_no_body_performs_of_one_behavior_is_one_warning() -> None:
    (note,) = _block('<gesture id="x" type="BEAT" power="1" amplitude="2" trajectory="ARC"/>').unread

    assert note.kind == "DEGRADED"
    assert "attributes 'amplitude', 'power' and 'trajectory' of <gesture>: the draft of 2007 has this" in note.message

"""The table of behavior types: complete, and against what BML 1.0 and the thesis say, spelled out here by hand."""

from typing import get_args

import pytest
from lxml import etree

from engage_hri.schemas import behaviors as of
from engage_hri.schemas.behavior_types import ROWS, SYNC_POINTS, TYPES, dialect_sync, same_instant, sync_points
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.documents.xml_encode import encode_xml
from engage_hri.schemas.documents.xml_source import BML_1_0, EBML, split
from tests.schemas.grammar import violations

SAMPLES: tuple[of.BlockBehavior, ...] = (
    of.Gaze(id="b", target="cup"),
    of.GazeShift(id="b", target="cup"),
    of.HeadDirectionShift(id="b", target="cup"),
    of.Pointing(id="b", target="cup"),
    of.Gesture(id="b", lexeme="BEAT"),
    of.Head(id="b", lexeme="NOD"),
    of.Face(id="b"),
    of.FaceLexeme(id="b", lexeme="SMILE"),
    of.FaceFacs(id="b", au=1),
    of.FaceShift(id="b", lexeme="SMILE"),
    of.Posture(id="b", stance="SITTING"),
    of.PostureShift(id="b", stance="SITTING"),
    of.Pose(id="b", part="LEGS", lexeme="CROSSED"),
    of.Locomotion(id="b", target="cup"),
    of.Speech(id="b", text="hello"),
    of.Wait(id="b", duration=1.0),
    of.Emit(id="b", event="e"),
)
STANDARD = {str(each.__struct_config__.tag) for each in SAMPLES}
"""What BML 1.0 has, and what our specification counts to it."""


def test_every_type_has_one_row() -> None:
    kinds = [row.kind for row in ROWS]

    assert len(kinds) == len(set(kinds))
    assert set(kinds) == {*get_args(of.BlockBehavior), *get_args(of.FragmentBehavior)}


def test_a_type_that_nobody_has_thought_about_is_not_the_standards() -> None:
    """Forgetting it in the row must not write our elements into the namespace of others."""
    assert {row.name for row in ROWS if row.is_standard} == STANDARD


@pytest.mark.parametrize("behavior", SAMPLES, ids=lambda each: type(each).__name__)
def test_what_is_the_standards_is_in_its_grammar_and_is_read_again(behavior: of.BlockBehavior) -> None:
    block = Block(id="a", behaviors=(behavior,), dialect="bml-1.0")
    xml = encode_xml(block)
    (element,) = etree.fromstring(xml)

    assert split(str(element.tag)) == (BML_1_0, TYPES[str(behavior.__struct_config__.tag)].name)
    assert violations(xml) == []
    assert type(decode_xml(xml, "a").behaviors[0]) is type(behavior)


def test_what_is_ours_is_in_our_namespace() -> None:
    events = (
        of.Event(id="e", kind="mutual_facial_gaze", responder="human"),
        of.TurnSignal(id="t", turn="t", signal="ended"),
    )
    for element in etree.fromstring(encode_xml(Block(id="a", behaviors=events, dialect="bml-1.0"))):
        assert split(str(element.tag))[0] == EBML


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row.name)
def test_a_row_agrees_with_itself(row: object) -> None:
    assert isinstance(row, type(ROWS[0]))
    assert row.points in (SYNC_POINTS, ("start", "end"))
    assert set(row.holds) <= set(row.points)
    assert len(row.nominal) == len(row.points) - 1
    assert set(row.bml_1_0_names) <= set(row.points)
    instants = [sync for group in row.one_instant for sync in group]
    assert len(instants) == len(set(instants))
    for group in row.one_instant:
        start = row.points.index(group[0])
        assert row.points[start : start + len(group)] == group
        assert len([sync for sync in group if sync in row.bml_1_0_names]) == 1
    for sync in row.points:
        assert dialect_sync(same_instant(sync, row.name), row.name, "bml-1.0") is not None


@pytest.mark.parametrize(
    ("type", "spelled"),
    [
        ("gaze", "start ready relax end"),
        ("posture", "start ready relax end"),
        ("face", "start attackPeak relax end"),
        ("faceLexeme", "start attackPeak relax end"),
        ("gesture", "start ready strokeStart stroke strokeEnd relax end"),
        ("head", "start ready strokeStart stroke strokeEnd relax end"),
        ("gazeShift", "start end"),
        ("speech", "start end"),
    ],
)
def test_the_points_are_called_as_in_the_standard(type: str, spelled: str) -> None:
    points = SYNC_POINTS if type != "speech" else ("start", "end")

    assert [name for sync in points if (name := dialect_sync(sync, type, "bml-1.0"))] == spelled.split()


def test_the_marks_of_speech_are_points_in_the_order_of_the_text() -> None:
    speech = of.Speech(id="s", text="one two", marks=(of.Mark("late", 7), of.Mark("early", 3)))

    assert sync_points(speech) == ("start", "early", "late", "end")


def test_every_kind_of_event_and_every_action_has_a_row_in_order() -> None:
    assert (tuple(of.EVENT_KINDS), tuple(of.ACTIONS)) == (get_args(of.EventKind), get_args(of.Action))
    assert len({kind.prefix for kind in of.EVENT_KINDS.values()}) == len(of.EVENT_KINDS)

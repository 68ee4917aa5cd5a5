"""The inventory of what the dialects define: against the structs, and how the rarer of it is read."""

import pytest

from engage_hri.schemas import vocabulary
from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import (
    Behavior,
    Expression,
    Face,
    FaceLexeme,
    FaceShift,
    Gesture,
    Head,
    PartPose,
    Pose,
    Posture,
    expressed,
    posed,
)
from tests.schemas.test_xml_codec import behavior


@pytest.mark.parametrize(
    ("xml", "expected"),
    [
        (
            '<face id="x" amount="0.2"><lexeme lexeme="SMILE"/><facs au="1" side="left" amount=".4"/></face>',
            Face(
                id="x",
                amount=0.2,
                expressions=(Expression(lexeme="SMILE"), Expression(au=1, side="LEFT", amount=0.4)),
            ),
        ),
        (
            '<posture id="x"><stance type="STANDING"/><pose part="ARMS" lexeme="A"/><pose lexeme="Y"/></posture>',
            Posture(id="x", stance="STANDING", poses=(PartPose(part="ARMS", lexeme="A"), PartPose(lexeme="Y"))),
        ),
        ('<posture id="x" stance="SIT"/>', Posture(id="x", stance="SIT")),
        ('<head id="x" action="ROTATION" rotation="x"/>', Head(id="x", lexeme="NOD")),
        ('<head id="x" action="ROTATION" rotation="z"/>', Head(id="x", lexeme="TILT")),
        ('<head id="x" action="ORIENTATION" orientation="UP_LEFT"/>', Head(id="x", lexeme="UP_LEFT")),
        ('<face id="x" type="MOUTH" mouth="smile"/>', FaceLexeme(id="x", lexeme="MOUTH_SMILE")),
        ('<face id="x" type="EYEBROWS"/>', FaceLexeme(id="x", lexeme="EYEBROWS")),
        ('<gesture id="x" type="LEXICALIZED" lexeme="WAVE"/>', Gesture(id="x", lexeme="WAVE")),
    ],
)
def test_what_is_rare_is_read_too(xml: str, expected: Behavior) -> None:
    assert behavior(xml) == expected


def test_one_expression_or_pose_and_several_are_read_alike() -> None:
    assert posed(Pose(id="p", lexeme="A", part="ARMS")) == (PartPose(lexeme="A", part="ARMS"),)
    assert posed(Posture(id="p", lexeme="A", poses=(PartPose(lexeme="B"),))) == (
        PartPose(lexeme="A"),
        PartPose(lexeme="B"),
    )
    assert expressed(FaceShift(id="f", au=4, expressions=(Expression(lexeme="B"),))) == (
        Expression(au=4),
        Expression(lexeme="B"),
    )


def test_each_standard_type_is_in_the_inventory() -> None:
    defined = {element for elements in vocabulary.DEFINED.values() for element in elements}

    assert {row.name for row in TYPES.values() if row.is_standard} <= defined


@pytest.mark.parametrize(
    ("table", "lexeme", "is_defined"),
    [
        ("gesture", "beat", True), ("gesture", "CONDUIT", True), ("gesture", "POINT", False),
        ("gesture", "WAVE", False),
        ("head", "up-left", True), ("head", "X", False), ("face", "EYEBROWS_POINT_UP", True), ("face", "FACS", False),
        ("facs", "12", True), ("facs", "99", False), ("stance", "LYING", True), ("pose", "LEGS_OPEN", True),
    ],
)  # fmt: skip
def test_a_lexeme_is_defined_or_somebodys_own(table: str, lexeme: str, is_defined: bool) -> None:
    assert vocabulary.is_defined(table, lexeme) is is_defined

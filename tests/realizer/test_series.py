"""Untimed behaviors of one series: they come in the document's order."""

import pytest

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.services.control.config import Variability
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.points import Point
from tests.realizer.test_simulated_body import robot

FACES = (
    '<face id="f1" type="EYELIDS" eyelid="BOTH"/>',
    '<face id="f2" type="FACS" au="45"/>',
    '<face id="f3" type="MOUTH" mouth="SMILE"/>',
    '<face id="f4"><lexeme lexeme="SMILE"/><facs au="2"/></face>',
)


def _block(content: str) -> Block:
    read = decode_xml(f'<bml xmlns="org.mindmakers.bml" id="b">{content}</bml>')
    assert isinstance(read, Block)
    return read


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (1, 0, 3, 2), (3, 2, 1, 0)])
async def test_faces_of_all_types_come_in_the_documents_order(order: tuple[int, ...]) -> None:
    faces = [FACES[number] for number in order]
    async with robot(Variability()) as seen:
        await seen.perform(_block("".join(faces)))

    starts = [seen.times()[f"f{number + 1}:start"].time for number in order]
    peaks = [seen.times()[f"f{number + 1}:stroke"].time for number in order]
    assert all(peak <= start for peak, start in zip(peaks[:-1], starts[1:], strict=True))
    assert seen.kinds() == []


def test_a_face_follows_the_face_before_it_and_not_the_last_of_its_own_type() -> None:
    plan = plan_block(_block("".join(FACES)))

    times = {str(point): plan.schedule[at] for point, at in plan.at.items()}
    for number in (1, 2, 3):
        assert times[f"f{number}:stroke"] <= times[f"f{number + 1}:start"]


def test_what_lies_beneath_is_no_part_of_the_series() -> None:
    assert TYPES["faceShift"].series != TYPES["face"].series
    assert TYPES["gazeShift"].series != TYPES["gaze"].series
    assert {TYPES[name].series for name in ("face", "faceLexeme", "faceFacs")} == {"face"}


def test_a_gesture_and_a_pointing_are_two_series() -> None:
    """Each has a hand of its own: in the drafts, too, where both are a <gesture>."""
    plan = plan_block(
        _block('<gesture id="g" type="BEAT" hand="LEFT"/><gesture id="p" type="POINT" target="x" hand="RIGHT"/>')
    )

    assert plan.schedule[plan.at[Point("p", "start")]] == 0.0

"""What is said of a value that is none of a few: which there are, and which was meant, in XML and in JSON."""

import pytest

from engage_hri.schemas.documents.json_codec import decode_json
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.faults import InputRefused

HANDS = "one of LEFT_HAND, RIGHT_HAND, BOTH_HANDS"


@pytest.mark.parametrize(
    ("xml", "place", "advice"),
    [
        ('<gesture id="x" lexeme="BEAT" mode="RIHGT_HAND"/>', "mode", f"did you mean 'RIGHT_HAND'? {HANDS}"),
        ('<pointing id="x" target="cup" mode="up"/>', "mode", HANDS),
        ('<faceFacs id="x" au="12" side="lefft"/>', "side", "did you mean 'LEFT'? one of LEFT, RIGHT, BOTH"),
        ('<head id="x" lexeme="NOD" repetition="often"/>', "repetition", ""),
    ],
)
def test_a_wrong_attribute_is_told_with_what_is_allowed(xml: str, place: str, advice: str) -> None:
    with pytest.raises(InputRefused, match=f": {place}: ") as refused:
        decode_xml(f'<bml id="b">{xml}</bml>')

    assert refused.value.fault.advice == advice


@pytest.mark.parametrize(
    ("json", "place", "advice"),
    [
        (
            '{"type": "block", "id": "b", "behaviors": [{"type": "wait", "id": "w"}, '
            '{"type": "pointing", "id": "p", "target": "cup", "mode": "LEFTHAND"}]}',
            "$.behaviors[1].mode", f"did you mean 'LEFT_HAND'? {HANDS}",
        ),
        ('{"type": "block", "id": "b", "composition": "M"}', "$.composition", "one of MERGE, APPEND, REPLACE"),
        (
            '{"type": "fragment", "id": "f", "accept": ["nod", "speek"]}', "$.accept[1]",
            "did you mean 'speak'? one of look, point, nod, shake, speak, act",
        ),
        ('{"type": "block", "id": "b", "character_id": 3}', "$.character_id", "see docs/protocol.md"),
        ('{"type": "block", "id": "b", "behaviors": [3]}', "$.behaviors[0]", "see docs/protocol.md"),
    ],
)  # fmt: skip
def test_a_wrong_value_of_json_is_told_with_what_is_allowed(json: str, place: str, advice: str) -> None:
    with pytest.raises(InputRefused) as refused:
        decode_json(json)

    assert (refused.value.fault.where, refused.value.fault.advice) == (place, advice)

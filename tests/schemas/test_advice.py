"""Advice about names that are not known, and about values that are none of a few, in XML and in JSON."""

import pytest

from engage_hri.schemas.advice import meant, suggestion
from engage_hri.schemas.documents.json_codec import decode_json
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.faults import InputRefused


@pytest.mark.parametrize(
    ("name", "known", "advice"),
    [
        ("humn", ["table", "human"], "did you mean 'human'?"),
        ("x", ["table", "human"], "known: human, table"),
        ("x", [f"n{number:02}" for number in range(12)], f"known: {', '.join(f'n{each:02}' for each in range(12))}"),
        (
            "x",
            [f"n{number:02}" for number in range(13)],
            f"known: {', '.join(f'n{each:02}' for each in range(12))}, ...",
        ),
        ("x", [], "known: none"),
    ],
)
def test_the_name_that_was_probably_meant_or_those_that_there_are(name: str, known: list[str], advice: str) -> None:
    assert suggestion(name, known) == suggestion(name, reversed(known)) == advice


def test_what_is_said_where_there_is_nothing_is_the_callers() -> None:
    assert suggestion("x", (), "the world is empty") == "the world is empty"


@pytest.mark.parametrize("name", ["CUP", "Cup", "cub", "cup "])
def test_a_name_in_other_letters_is_found(name: str) -> None:
    assert suggestion(name, ["table", "cup"]) == "did you mean 'cup'?"


def test_the_name_is_told_as_it_is_spelled() -> None:
    assert meant("bluesquare", ["Blue-Square"]) == " (did you mean 'Blue-Square'?)"


def test_names_that_differ_in_case_alone_are_all_told() -> None:
    assert suggestion("CUP", ["cup", "Cup", "can"]) == "did you mean 'Cup' or 'cup'?"
    assert meant("CUP", ["cup", "Cup", "can"]) == " (did you mean 'Cup' or 'cup'?)"


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

"""JSON as managers write it: what is understood, and the path of what is refused."""

import json
from typing import Any

import pytest

from engage_hri.schemas.behaviors import Gaze, Mark, Speech, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.json_codec import encode_json, read
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.fragments import TurnFragment

SAY = {"type": "speech", "id": "s", "text": "Hello"}
CUP: dict[str, Any] = {
    "type": "reference",
    "id": "r",
    "target": "cup",
    "minimum_reliability": 0.85,
    "options": [{"text": "the cup", "cost": 2}, {"text": "it", "cost": 1, "distractors": ["jug"]}],
}


def refused(form: object) -> Fault:
    with pytest.raises(InputRefused) as refusal:
        read(form if isinstance(form, bytes) else json.dumps(form).encode(), "file.json")
    return refusal.value.fault


@pytest.mark.parametrize(
    ("form", "expected"),
    [
        ({"type": "fragment", "id": "f"}, TurnFragment(id="f")),
        ({"id": "f", "turn_status": "end"}, TurnFragment(id="f", turn_status="end")),
        ({"id": "f", "delay": True, "delay_target": "table"}, TurnFragment(id="f", delay=True, delay_target="table")),
        ({"type": "block", "id": "b", "composition": "APPEND"}, Block(id="b", composition="APPEND")),
        ({"id": "b", "behaviors": [SAY]}, Block(id="b", behaviors=(Speech(id="s", text="Hello"),))),
    ],
)
def test_type_may_be_missing_where_it_is_plain(form: object, expected: object) -> None:
    assert read(json.dumps(form).encode())[0] == expected


def test_a_reference_makes_it_a_fragment() -> None:
    assert isinstance(read(json.dumps({"id": "f", "behaviors": [CUP]}).encode())[0], TurnFragment)


def test_the_same_fragment_in_xml_and_json_is_the_same_struct() -> None:
    fragment = decode_xml("""<ebml:ebml xmlns:ebml="edu.wpi.ebml" id="f" turnStatus="end">
      <gaze id="g" target="cup" start="s:m-1 + 1"/><speech id="s">Oh <sync id="m-1"/>yes</speech></ebml:ebml>""")

    assert read(encode_json(fragment))[0] == fragment


def test_an_ambiguous_reference_is_made_explicit() -> None:
    block = Block(
        id="b",
        behaviors=(
            Gaze(id="g", target="t", timing=(Timing("start", "s:m-1"),)),
            Speech(id="s", text="a b", marks=(Mark("m-1", 2),)),
        ),
    )

    assert read(encode_json(block))[0].behaviors[0].timing == (Timing("start", "s:m-1+0"),)


def test_read_takes_either_form_and_arrays_of_several() -> None:
    assert read(b' \n<bml id="b"/>') == (Block(id="b"),)
    assert read(b'\xef\xbb\xbf{"id": "b"}') == (Block(id="b"),)
    assert read(b'[{"id": "b"}, {"type": "fragment", "id": "f"}]') == (Block(id="b"), TurnFragment(id="f"))


@pytest.mark.parametrize(
    ("form", "path", "reason"),
    [
        ({"type": "turn", "id": "f"}, "$.type", "unknown type 'turn'"),
        ({"id": "f", "turn_status": "whole"}, "$.turn_status", "Invalid enum value 'whole'"),
        ({"id": "f", "turnStatus": "end"}, "$.turnStatus", "unknown key 'turnStatus'"),
        ({"turn_status": "end"}, "$", "missing required field `id`"),
        ({"id": "", "behaviors": []}, "$.id", "no id"),
        ({"id": "b", "behaviors": {}}, "$.behaviors", "Expected `array`"),
        ({"id": "b", "behaviors": [{**SAY, "type": "dance"}]}, "$.behaviors[0].type", "Invalid value 'dance'"),
        ({"id": "b", "behaviors": [{**SAY, "txt": "x"}]}, "$.behaviors[0].txt", "unknown key 'txt'"),
        ({"id": "b", "behaviors": [{**SAY, "line": 3}, SAY]}, "$.behaviors[1].id", "duplicate id 's'"),
        (
            {"id": "b", "behaviors": [{**SAY, "marks": [{"id": "m", "position": 9}]}]},
            "$.behaviors[0].marks",
            "outside the text",
        ),
        (
            {"id": "b", "behaviors": [{**SAY, "timing": [{"sync": "start", "ref": "x:end"}]}]},
            "$.behaviors[0].timing[0].ref",
            "unknown behavior 'x'",
        ),
        (
            {"id": "b", "constraints": [{"operators": [{"type": "after", "ref": "a", "syncs": []}]}]},
            "$.constraints[0].operators[0].ref",
            "sync reference 'a'",
        ),
        (
            {"id": "b", "constraints": [{"operators": [{"type": "synchronize", "syncs": ["1", "+x"]}]}]},
            "$.constraints[0].operators[0].syncs[1]",
            "sync reference '+x'",
        ),
        ({"type": "block", "id": "b", "behaviors": [CUP]}, "$.behaviors[0].type", "Invalid value 'reference'"),
        ({"id": "f", "behaviors": [{**CUP, "options": []}]}, "$.behaviors[0].options", "no phrase"),
        (
            {"id": "f", "behaviors": [{**CUP, "minimum_reliability": 1}]},
            "$.behaviors[0].minimum_reliability",
            "outside (0, 1)",
        ),
        (
            {"id": "f", "behaviors": [{**CUP, "options": [{"text": "it", "cost": "1"}]}]},
            "$.behaviors[0].options[0].cost",
            "Expected `float`",
        ),
        (
            {"id": "f", "behaviors": [{**CUP, "options": [{"text": "it", "cost": -1}]}]},
            "$.behaviors[0].options[0].cost",
            "cost -1",
        ),
        ([{"id": "b"}, 3], "$[1]", "expected an object"),
        ([{"id": "b"}, {"id": "b:c"}], "$[1].id", "may hold neither"),
    ],
)
def test_bad_json_is_refused_with_its_path(form: object, path: str, reason: str) -> None:
    fault = refused(form)

    assert fault.where == f"file.json: {path}"
    assert reason in fault.reason


@pytest.mark.parametrize(
    ("data", "line"),
    [
        (b"", 0),
        (b"   ", 0),
        (b"hello", 0),
        (b'{\n"id": "b",\n"behaviors": [}', 3),
        (b'{"id": "b",\n', 2),
        (b'{"id": "b", "x": NaN}', 1),
        (b'{"id": "b",\n"x": 1e999\n}', 0),
        (b'{"id":\n"\xff"\n}', 2),
        (b"[" * 100_000, 0),
        (b'{"id": "' + b"x" * 10_000_000 + b'"}', 0),
    ],
)
def test_what_is_not_json_is_refused_with_its_line(data: bytes, line: int) -> None:
    fault = refused(data)

    assert fault.where.startswith("file.json")
    assert fault.line == line


@pytest.mark.parametrize("id", ["b\u0001", "\u0000", "b\u007f", "b\u0085"])
def test_an_id_holds_no_control_characters(id: str) -> None:
    with pytest.raises(InputRefused, match="may hold"):
        read(json.dumps({"id": id}).encode())[0]


def test_a_key_in_camel_case_is_known_for_what_it_was_meant_to_be() -> None:
    with pytest.raises(InputRefused, match="did you mean 'turn_status'"):
        read(b'{"id": "f", "turnStatus": "full"}')[0]


@pytest.mark.parametrize(
    "form",
    [
        '{"id": "b", "behaviors": [], "behaviors": []}',
        '[{"id": "b", "behaviors": [{"type": "wait", "id": "w", "duration": 1, "duration": 2}]}]',
        '{"id": "b", "i\\u0064": "c"}',
    ],
)
def test_a_key_that_stands_twice_is_refused_instead_of_half_the_input_ignored(form: str) -> None:
    with pytest.raises(InputRefused, match=r"key '(behaviors|duration|id)' stands 2 times in one object"):
        read(form.encode())

"""What the client refuses before it is sent, in words; and tool calls as models write them."""

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.tool import MOST_LETTERS, is_listed, tool_definition
from engage_hri.schemas.units import A_DAY, Vector
from engage_hri.schemas.world import Entity, World
from engage_hri.services.client.inputs import call_in, fragment_in, taken
from engage_hri.services.client.people.perceived_person import Duration

CALL = {"turn_status": "full", "parts": [{"say": "hi"}]}
TEXT = json.dumps(CALL)


@pytest.mark.parametrize(
    "call",
    [
        CALL, TEXT, TEXT.encode(), json.dumps(TEXT), json.dumps(json.dumps(TEXT)), f"```json\n{TEXT}\n```",
        f"```\n{TEXT}\n```\n", f"  {TEXT}  ", json.dumps(f"```json\n{TEXT}\n```"), f"\ufeff{TEXT}",
        {**CALL, "parts": json.dumps(CALL["parts"])}, TEXT.encode("utf-16"),
    ],
)  # fmt: skip
def test_a_call_is_read_however_it_is_wrapped(call: Any) -> None:
    fragment = call_in(call, "x")

    assert [each.text for each in fragment.behaviors] == ["hi"]  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "call",
    [
        {}, [], None, 3, True, "", " ", "null", "{}", "[]", TEXT[:20], TEXT[:-1], "Hello", "<say>hi</say>",
        {"parts": []}, {"turn_status": "full"}, {"turn_status": "full", "parts": "Hello"}, {"say": "hi"},
        {"turn_status": 3, "parts": []}, {"turn_status": "full", "parts": [3]}, {"name": "x", "arguments": TEXT},
    ],
)  # fmt: skip
def test_what_is_no_call_is_told_in_words_of_the_tool(call: Any) -> None:
    with pytest.raises(InputRefused) as refused:
        call_in(call, "x")

    told = str(refused.value)
    assert "turn_status" in told or "parts" in told
    assert "XML" not in told
    assert "`id`" not in told


def test_a_call_that_ends_too_early_is_called_truncated() -> None:
    for end in range(1, len(TEXT)):
        with pytest.raises(InputRefused, match="truncated"):
            call_in(TEXT[:end], "x")


@pytest.mark.parametrize(
    ("source", "advice"),
    [("ask.xml", "Path('ask.xml')"), ("a/b.json", "Path('a/b.json')"), ("Hello robot", '"say"'), (None, "Path"),
     (["hi"], "Path"), (3, "Path"), ({"say": "hi"}, "turn_status"), (b"hi", "JSON")],
)  # fmt: skip
def test_what_is_no_fragment_is_refused_with_what_to_write(source: Any, advice: str) -> None:
    with pytest.raises(InputRefused) as refused:
        fragment_in(source, "x")

    assert advice in refused.value.fault.advice


@pytest.mark.parametrize("value", ["left", (1, 2), (1, "2", 3), (math.nan, 0, 1), (math.inf, 0, 1), (1e99, 0, 0)])
def test_what_is_no_place_is_refused(value: Any) -> None:
    with pytest.raises(InputRefused):
        taken(value, Vector, "ann")


@pytest.mark.parametrize("value", [-5, math.nan, math.inf, "2", None, A_DAY * 2])
def test_what_is_no_time_is_refused(value: Any) -> None:
    with pytest.raises(InputRefused):
        taken(value, Duration, "ann")


def things(number: int, letters: int) -> World:
    ids = [f"{n:0{letters}d}" for n in range(number)]
    ann = Entity(id="ann", kind="person", position=(1.2, 0.0, 1.3))
    return World(entities=(ann, *(Entity(id=id, kind="object", position=(0.5, 0.0, 0.8)) for id in ids)))


@pytest.mark.parametrize(
    ("number", "letters", "listed"), [(2, 3, True), (249, 60, True), (249, 61, False), (250, 5, False)]
)
@pytest.mark.parametrize("format", ["anthropic", "openai", "openai-chat"])
def test_a_tool_has_no_more_values_than_its_readers_take(
    format: Any, number: int, letters: int, listed: bool
) -> None:
    world = things(number, letters)

    lists = list(_lists(tool_definition(format, world)))

    assert (len(lists) > len(list(_lists(tool_definition(format))))) is is_listed(world) is listed
    assert sum(map(len, lists)) <= 1000
    assert all(sum(len(str(id)) for id in each) <= MOST_LETTERS for each in lists)


def _lists(schema: Any) -> Iterator[list[Any]]:
    """All lists of values in a schema."""
    if isinstance(schema, dict):
        if "enum" in schema:
            yield schema["enum"]
        schema = [*schema.values()]
    if isinstance(schema, list):
        for each in schema:
            yield from _lists(each)


def test_a_format_that_is_none_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="gemini"):
        tool_definition("gemini")  # type: ignore[arg-type]


def test_a_file_that_is_not_there_is_named() -> None:
    with pytest.raises(InputRefused, match=r"nope\.xml"):
        fragment_in(Path("nope.xml"), "x")

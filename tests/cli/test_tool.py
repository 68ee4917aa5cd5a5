"""`engage tool`, and what of `engage play` is for language models."""

import json
from pathlib import Path

import pytest

from engage_hri.schemas.tool import tool_definition
from engage_hri.services.simulation.still import table_world
from tests.cli.command import FRAGMENT, Engage

CALL = {"turn_status": "full", "parts": [{"say": "Do you see"}, {"refer": "trapezoid", "certainty": "high"}]}
PLAY = ("play", "--embedded", "--virtual-time", "--quiet", "--outcomes", "-")


@pytest.fixture
def call(tmp_path: Path) -> Path:
    path = tmp_path / "call.json"
    path.write_text(json.dumps(CALL))
    return path


@pytest.mark.parametrize("format", ["anthropic", "openai", "openai-chat"])
def test_the_tool_is_printed_in_the_form_of_each_api(engage: Engage, format: str) -> None:
    result = engage("tool", "--format", format)

    assert result.code == 0
    assert json.loads(result.out) == tool_definition(format)  # type: ignore[arg-type]


def test_a_world_leaves_only_its_ids(engage: Engage, tmp_path: Path) -> None:
    world = tmp_path / "world.json"
    cup = {"id": "cup", "kind": "object", "position": [0.5, 0.1, 0.8]}
    world.write_text(json.dumps({"entities": [cup]}))

    made = json.loads(engage("tool", "--world", world).out)

    part = made["input_schema"]["properties"]["parts"]["items"]["anyOf"][1]
    one, several = part["properties"]["refer"]["anyOf"]
    assert (one["enum"], several["items"]["enum"]) == (["cup"], ["cup"])
    assert engage("tool", "--world", tmp_path / "none.json").code == 2


def test_a_tool_call_plays_and_its_outcome_is_compact(engage: Engage, call: Path) -> None:
    result = engage(*PLAY, call, "--human", "none")

    (line,) = result.out.splitlines()
    assert (result.code, len(line) < 300) == (0, True)
    assert json.loads(line) == {
        "fragment": "call",
        "status": "done",
        "said": "Do you see this",
        "references": [{"object": "trapezoid", "phrase": "this", "by": "pointing", "looked": False}],
        "eye_contact": False,
        "answer": "none",
    }


def test_refusals_and_failures_are_outcomes_too(engage: Engage, tmp_path: Path, call: Path) -> None:
    zone = "control.no_point_zones=[{center=[0.5, 0.0, 0.7], radius=2.0}]"
    this = tmp_path / "this.json"
    this.write_text(json.dumps({"turn_status": "full", "parts": [{"refer": "trapezoid", "phrases": ["this"]}]}))

    result = engage(*PLAY, this, call, "--set", zone)

    failed, done = map(json.loads, result.out.splitlines())
    assert result.code == 3
    assert (failed["fragment"], failed["status"], done["status"]) == ("this", "failed", "done")
    assert failed["problems"][0].startswith("refer-1: no way to refer to trapezoid: ")
    assert done["said"] == "Do you see the trapezoid"
    assert any("minimum reliability 0.95" in problem for problem in done["problems"])


def test_outcomes_may_share_a_file_with_the_other_lines(engage: Engage, tmp_path: Path) -> None:
    fragment, lines = tmp_path / "ask.xml", tmp_path / "lines"
    fragment.write_text(FRAGMENT)

    result = engage(*PLAY[:-1], lines, "--events", lines, "--feedback", lines, fragment)

    kinds = [json.loads(line).get("type", "outcome") for line in lines.read_text().splitlines()]
    assert result.code == 0
    assert {"connection_event", "block_progress", "sync_point_progress"} < set(kinds)
    assert kinds.count("outcome") == 1


def test_each_call_of_an_array_is_a_fragment_of_the_turn(engage: Engage, tmp_path: Path) -> None:
    calls = tmp_path / "talk to me.json"
    statuses = ("beginning", "middle", "end")
    calls.write_text(json.dumps([{"turn_status": status, "parts": [{"say": status}]} for status in statuses]))

    result = engage(*PLAY, calls)

    outcomes = [json.loads(line) for line in result.out.splitlines()]
    assert [(each["fragment"], each["said"]) for each in outcomes] == [
        ("fragment-1", "beginning"), ("fragment-2", "middle"), ("fragment-3", "end"),
    ]  # fmt: skip


def test_a_call_is_explained_like_any_fragment(engage: Engage, call: Path) -> None:
    result = engage("plan", "--why", call, "--format", "json")

    rows = json.loads(result.out)
    assert {row["phrase"] for row in rows} == {"this", "the trapezoid"}
    assert [row["phrase"] for row in rows if row["chosen"]] == ["this"]


def test_a_bad_call_is_one_line_with_its_path(engage: Engage, tmp_path: Path) -> None:
    bad = tmp_path / "bad.json"
    bad.write_text(json.dumps({"turn_status": "full", "parts": [{"say": "Hi"}, {"refers": "trapezoid"}]}))

    result = engage(*PLAY, bad)

    assert result.code == 2
    assert result.err.startswith(f"{bad}: $.parts[1]: a part holds only 'refers' (give each part exactly one of say,")
    assert result.err.count("\n") == 1


def test_ids_of_the_tangram_stand_in_its_tool() -> None:
    text = json.dumps(tool_definition(world=table_world()))

    assert all(f'"{thing.id}"' in text for thing in table_world().objects)

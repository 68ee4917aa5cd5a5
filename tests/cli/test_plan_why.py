"""`engage plan --why`: the table behind each choice, for people and as JSON."""

import json
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

import pytest

from tests.cli.command import ALONE, GOOD_BLOCK, Engage
from tests.random_cases import share_of

KEYS = {
    "reference", "gesture", "phrase", "distractors", "channel", "reliability", "minimum", "cost", "feasible",
    "chosen", "reason",
}  # fmt: skip
GESTURES = ["none", "gaze", "directed_gaze", "directed_gaze_with_pointing"]
TWO = """\
<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="two" turnIndex="1" turnStatus="full">
  <ebml:reference id="first" target="blue-square" minReliability="0.85">
    <speechOption text="the square" cost="2"><distractor object="red-square"/></speechOption>
    <speechOption text="the blue [b]piece[/b]" cost="3"/>
    <speechOption text="this" cost="1" deictic="true"><distractor object="red-square"/></speechOption>
  </ebml:reference>
  <ebml:reference id="second" target="rectangle" minReliability="0.99">
    <speechOption text="the rectangle" cost="2"/>
  </ebml:reference>
</ebml:ebml>
"""


def option(text: str, **fields: object) -> dict[str, object]:
    return {"text": text, "cost": 1, **fields}


def fragment(id: str, status: str, *options: dict[str, object], minimum: float = 0.85) -> dict[str, object]:
    reference = {
        "type": "reference", "id": f"{id}-r", "target": "rectangle", "minimum_reliability": minimum,
        "options": options or [option("it")],
    }  # fmt: skip
    return {"type": "fragment", "id": id, "turn_status": status, "behaviors": [reference]}


@pytest.fixture
def two(tmp_path: Path) -> Path:
    path = tmp_path / "two.xml"
    path.write_text(TWO)
    return path


def written(tmp_path: Path, things: object) -> Path:
    path = tmp_path / "things.json"
    path.write_text(json.dumps(things))
    return path


def rows(engage: Engage, *arguments: object) -> list[dict[str, Any]]:
    result = engage("plan", "--why", *arguments, "--format", "json")
    assert result.code == 0
    parsed = json.loads(result.out)
    assert isinstance(parsed, list)
    return parsed


def test_the_json_is_every_pair_of_every_reference_with_all_its_keys(engage: Engage, two: Path) -> None:
    pairs = rows(engage, two)

    assert [pair["reference"] for pair in pairs] == ["first"] * 12 + ["second"] * 4
    assert [pair["gesture"] for pair in pairs] == [each for each in GESTURES for _ in range(3)] + GESTURES
    assert all(pair.keys() == KEYS for pair in pairs)
    for pair in pairs:
        left = len(pair["distractors"])
        assert pair["reliability"] == pytest.approx(1 / (left + 1 / pair["channel"]))
        assert pair["reason"]
        if pair["feasible"]:
            assert pair["reliability"] >= pair["minimum"] - 1e-9


def test_one_pair_of_each_reference_is_chosen_and_none_is_cheaper_for_the_last(engage: Engage, two: Path) -> None:
    pairs = rows(engage, two, "--set", "generation.pointing_reliability=0.295")
    chosen = [pair for pair in pairs if pair["chosen"]]

    assert [pair["reference"] for pair in chosen] == ["first", "second"]
    cheapest = min(pair["cost"] for pair in pairs if pair["reference"] == "second" and pair["feasible"])
    assert chosen[1]["cost"] == cheapest


def test_costs_are_those_of_the_body_where_the_sequence_has_led_it(engage: Engage, tmp_path: Path) -> None:
    """The second look at the same thing is free, and so is the second point at it."""
    again = [fragment("f", "full")]
    again[0]["behaviors"] = [
        {**reference, "id": id}
        for id in ("one", "other")
        for reference in again[0]["behaviors"]  # type: ignore
    ]
    pairs = rows(engage, written(tmp_path, again))

    by = {(pair["reference"], pair["gesture"]): pair["cost"] for pair in pairs}
    assert by["one", "gaze"] > by["other", "gaze"] == by["other", "none"] == pytest.approx(0.35)
    assert next(pair["gesture"] for pair in pairs if pair["chosen"]) == "directed_gaze"
    assert by["other", "directed_gaze"] == pytest.approx(0.35 + 0.3)


def test_the_table_marks_the_choice_and_ends_with_the_total_and_warnings(
    engage: Engage, two: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    total = sum(pair["cost"] for pair in rows(engage, two) if pair["chosen"])

    result = engage("plan", "--why", two)

    assert result.code == 0
    lines = result.out.splitlines()
    assert max(map(len, lines)) <= 80
    assert [line.split(" -> ")[1].strip() for line in lines if " -> " in line] == ["blue-square", "rectangle"]
    marked = [line for line in lines if line.startswith(">")]
    assert len(marked) == 2
    assert "DG + pointing" in marked[1]
    assert "[b]piece[/b]'" in result.out  # not taken for markup
    assert f"two: 2 references, {total:.3g} s" in lines
    warnings = " ".join(lines[lines.index(f"two: 2 references, {total:.3g} s") + 1 :])
    assert "the deictic 'this' are everything else" in warnings
    assert "second: nothing reaches the minimum reliability 0.99" in warnings


def test_a_wide_table_names_the_distractors(engage: Engage, two: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "140")

    out = engage("plan", "--why", two).out

    assert "red-square" in out
    assert "and 5 more" in out
    assert max(map(len, out.splitlines())) <= 140


def test_cells_fold_so_that_a_narrow_terminal_gets_every_letter(
    engage: Engage, two: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def letters(width: int) -> Counter[str]:
        monkeypatch.setenv("COLUMNS", str(width))
        out = engage("plan", "--why", two).out
        assert max(map(len, out.splitlines())) <= width
        return Counter("".join(out.split()))

    whole = letters(109)
    widths = [60, *Random(0).sample(range(61, 109), share_of(48))]
    assert {width: lost for width in widths if (lost := whole - letters(width))} == {}


def test_the_world_decides_what_may_be_meant(engage: Engage, tmp_path: Path, two: Path) -> None:
    near = {"id": "near", "kind": "object", "position": [0.5, 0.1, 0.72], "radius": 0.02}
    things = [{**near, "id": id} for id in ("rectangle", "blue-square", "red-square")]
    person = {"id": "human", "kind": "person", "position": [1.3, 0, 1.2]}
    world = tmp_path / "world.json"
    world.write_text(json.dumps({"entities": [*things, person]}))

    pairs = rows(engage, two, "--world", world)

    pointed = next(pair for pair in pairs if pair["phrase"] == "this" and pair["gesture"] == GESTURES[3])
    assert pointed["distractors"] == ["rectangle", "red-square"]  # all in one place


def test_a_world_of_things_alone_is_enough(engage: Engage, tmp_path: Path, two: Path) -> None:
    things = [
        {"id": id, "kind": "object", "position": [0.5, y, 0.72]}
        for id, y in (("rectangle", 0.2), ("blue-square", 0.0), ("red-square", -0.2))
    ]
    world = tmp_path / "world.json"
    world.write_text(json.dumps({"entities": things}))

    pairs = rows(engage, two, "--world", world)

    assert [pair["reference"] for pair in pairs if pair["chosen"]] == ["first", "second"]


def test_all_fragments_of_a_file_are_explained_and_blocks_passed_over(engage: Engage, tmp_path: Path) -> None:
    block = {"type": "block", "id": "b", "behaviors": []}
    path = written(tmp_path, [fragment("f1", "beginning"), block, fragment("f2", "end"), fragment("f3", "full")])

    assert dict.fromkeys(pair["reference"] for pair in rows(engage, path)).keys() == {"f1-r", "f2-r", "f3-r"}
    assert "f2: 1 reference, " in engage("plan", "--why", path).out


def test_a_fragment_without_references_has_nothing_to_explain(engage: Engage, tmp_path: Path) -> None:
    path = written(tmp_path, {"type": "fragment", "id": "f", "behaviors": []})

    assert rows(engage, path) == []
    assert engage("plan", "--why", path).out == "f: no references\n"


def test_the_studys_condition_shows_in_every_row(engage: Engage, two: Path) -> None:
    pairs = rows(engage, two, "--set", "generation.condition=degraded-generation")

    assert {pair["gesture"] for pair in pairs if pair["chosen"]} == {"none"}
    assert {pair["reason"] for pair in pairs if pair["gesture"] == "gaze" and pair["phrase"] != "this"} == {
        "speech only"
    }


def test_what_cannot_be_explained_says_what_to_do(engage: Engage, tmp_path: Path) -> None:
    block, orphan, unable = tmp_path / "b.xml", tmp_path / "end.json", tmp_path / "unable.json"
    block.write_text(GOOD_BLOCK)
    orphan.write_text(json.dumps(fragment("f", "end")))
    unable.write_text(json.dumps(fragment("f", "full", option("this", deictic=True))))
    unknown = tmp_path / "unknown.xml"
    unknown.write_text(ALONE.replace("blue-square", "blue-squere"))
    zone = "control.no_point_zones=[{center=[0.5, 0.0, 0.7], radius=2.0}]"

    results = [engage("plan", "--why", path, "--set", zone) for path in (block, orphan, unknown, unable)]

    assert [result.code for result in results] == [2, 2, 2, 3]
    assert [result.out for result in results[:3]] == [""] * 3
    assert "f-r -> rectangle" in results[3].out
    assert all(result.err.count("\n") == 1 for result in results)
    assert results[0].err.startswith(f"{block}: holds no turn fragment (")
    assert results[1].err.startswith(f"{orphan}: f: $.turn_status: 'end' with no turn open (begin a turn")
    assert results[2].err.startswith(f"{unknown}:3: ")
    assert results[3].err.startswith(f"{unable}: f: f-r: no way to refer to rectangle: ")
    assert "no-point zone" in results[3].err


def test_fragments_of_a_file_know_what_those_before_them_named(engage: Engage, tmp_path: Path) -> None:
    calls = [{"turn_status": status, "parts": [{"refer": "rectangle"}]} for status in ("beginning", "end", "full")]

    chosen = [pair["phrase"] for pair in rows(engage, written(tmp_path, calls)) if pair["chosen"]]

    assert chosen == ["the rectangle", "it", "it"]


THIS = option("this", deictic=True)


def test_where_a_reference_cannot_be_made_the_tables_come_all_the_same(engage: Engage, tmp_path: Path) -> None:
    stuck = fragment("f2", "end", THIS)
    stuck["behaviors"] = [*fragment("a", "end")["behaviors"], *stuck["behaviors"]]  # type: ignore[misc]
    path = written(tmp_path, [fragment("f1", "beginning"), stuck, fragment("f3", "full")])
    speechless = ("--set", "generation.condition=degraded-generation")

    as_json, as_text = (
        engage("plan", "--why", path, "--format", "json", *speechless),
        engage("plan", "--why", path, *speechless),
    )

    pairs = json.loads(as_json.out)
    assert as_json.code == as_text.code == 3
    assert [pair["reference"] for pair in pairs] == ["f1-r"] * 4 + ["a-r"] * 4 + ["f2-r"] * 4
    assert [pair["reference"] for pair in pairs if pair["chosen"]] == ["f1-r", "a-r"]
    assert all(pair.keys() == KEYS for pair in pairs)
    assert [(pair["feasible"], pair["reason"]) for pair in pairs[8:]] == [
        *[(False, "a deictic phrase needs a point")] * 3, (False, "speech only"),
    ]  # fmt: skip
    assert [line.split(" -> ")[0] for line in as_text.out.splitlines() if " -> " in line] == ["f1-r", "a-r", "f2-r"]
    assert as_text.out.count("a deictic phrase") == 3
    for result in (as_json, as_text):
        assert result.err.splitlines()[-1].startswith(f"{path}: f2: f2-r: no way to refer to rectangle: ")


@pytest.mark.parametrize(("profile", "looks_away"), [("check-back", True), ("figure-3.3", False)])
def test_a_look_after_a_point_starts_where_the_glance_has_led_the_head(
    engage: Engage, tmp_path: Path, profile: str, looks_away: bool
) -> None:
    both = fragment("f", "full", THIS)
    both["behaviors"] = [*both["behaviors"], *fragment("g", "full")["behaviors"]]  # type: ignore[misc]

    pairs = rows(engage, written(tmp_path, both), "--set", f"generation.profile={profile}")

    costs = {(pair["reference"], pair["gesture"]): pair["cost"] for pair in pairs}
    assert (costs["g-r", "gaze"] > costs["g-r", "none"]) == looks_away
    assert costs["g-r", GESTURES[3]] > costs["g-r", GESTURES[2]]  # the arm is raised once more, wherever it is

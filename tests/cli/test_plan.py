import json
from pathlib import Path

import pytest

from tests.cli.command import FRAGMENT, GOOD_BLOCK, Engage


@pytest.fixture
def block(tmp_path: Path) -> Path:
    path = tmp_path / "hello.xml"
    path.write_text(GOOD_BLOCK)
    return path


def test_the_text_shows_the_schedule(engage: Engage, block: Path) -> None:
    result = engage("plan", block)

    assert result.code == 0
    assert result.out.startswith("block hello: ")
    assert "look:stroke = words:start" in result.out


def test_the_text_ends_with_a_drawing_of_the_net_before_it_begins(engage: Engage, block: Path) -> None:
    title, _, start, look, words, *_, legend = engage("plan", block).out.partition("\n\nblock ")[2].splitlines()

    assert title == "hello: 7 instants, 1 ●"
    assert start.split()[:2] == ["bml", "●"]
    assert look.startswith("look")
    assert look.index("*") == words.index("s", 5)  # the instant that both share
    assert "●" not in look + words
    assert legend.startswith("●=token s=start ")


def test_the_json_has_every_point_with_its_time(engage: Engage, block: Path) -> None:
    document = json.loads(engage("plan", "--format", "json", block).out)

    behaviors = document["behaviors"]
    assert behaviors["look"]["stroke"] == behaviors["words"]["start"] > 0


IN_BML_1_0 = """<bml id="b" xmlns="http://www.bml-initiative.org/bml/bml-1.0">
  <gaze id="look" target="rectangle"/>
  <faceLexeme id="smile" lexeme="RAISE_MOUTH_CORNERS" attackPeak="look:ready"/>
  <head id="nod" lexeme="NOD" repetition="2" start="look:end+0.5"/>
  <head id="shake" lexeme="SHAKE"/>
</bml>"""


def test_a_plan_names_points_as_its_block_does_and_each_once(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "b.xml"
    path.write_text(IN_BML_1_0)
    text, drawn = engage("plan", path).out, engage("plan", "--format", "dot", path).out
    document = json.loads(engage("plan", "--format", "json", path).out)

    assert "  look:ready = smile:attackPeak" in text
    for told in (text, drawn):
        assert "_start" not in told
        assert "look:stroke" not in told
        assert "nod:stroke:2" in told
    assert list(document["behaviors"]["look"]) == ["start", "ready", "relax", "end"]
    assert list(document["behaviors"]["smile"]) == ["start", "attackPeak", "relax", "end"]
    points = [point for each in document["transitions"] for point in each["points"]]
    assert {"look:ready", "smile:attackPeak", "nod:strokeStart"} <= {*points}
    assert len(points) == len({*points})


def test_what_the_block_says_is_told_apart_from_what_is_added_and_each_line_once(
    engage: Engage, tmp_path: Path
) -> None:
    path = tmp_path / "b.xml"
    path.write_text(IN_BML_1_0)
    said, added = engage("plan", path).out.split("what the block says:\n")[1].split("\n\n")[:2]

    heading, *lines = added.splitlines()
    assert heading == "what the planner adds:"
    assert said == "  nod:start  at  look:end +0.5 s"
    assert "  shake:start  no earlier than  nod:end  (line 5)" in lines
    assert len(lines) == len({*lines})


def test_of_a_block_that_names_another_it_is_told_how_to_try_the_two(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "tied.xml"
    path.write_text('<bml id="tied"><constraint id="c"><after ref="long:s:end"><sync ref="w:start"/></after>'
                    '</constraint><wait id="w" duration="1"/></bml>')  # fmt: skip
    planned = engage("plan", path)

    assert planned.code == 0
    assert "no block is known as 'long'" in planned.err
    assert "`engage play --embedded --virtual-time --at 0,1 FIRST.xml tied.xml`" in planned.err


def test_the_dot_is_a_graph(engage: Engage, block: Path) -> None:
    assert engage("plan", "--format", "dot", block).out.startswith('digraph "hello" {')


def test_durations_are_those_of_the_simulated_body_in_the_given_world(
    engage: Engage, block: Path, tmp_path: Path
) -> None:
    strokes = []
    for name, y in (("ahead", 0.0), ("aside", 0.6)):
        world = tmp_path / f"{name}.json"
        world.write_text(f'{{"entities": [{{"id": "rectangle", "kind": "object", "position": [0.6, {y}, 1.2]}}]}}')
        document = json.loads(engage("plan", "--format", "json", "--world", world, block).out)
        strokes.append(document["behaviors"]["look"]["stroke"])

    assert strokes[0] < strokes[1]


def test_a_target_the_world_does_not_know_is_dropped_with_a_problem(
    engage: Engage, block: Path, tmp_path: Path
) -> None:
    world = tmp_path / "empty.json"
    world.write_text('{"entities": []}')

    document = json.loads(engage("plan", "--format", "json", "--world", world, block).out)

    assert document["dropped"] == ["look"]
    assert [problem["kind"] for problem in document["problems"]] == ["NO_SUCH_TARGET"]


def test_a_fragment_is_planned_as_the_block_it_becomes(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "ask.xml"
    path.write_text(FRAGMENT)

    document = json.loads(engage("plan", "--format", "json", path).out)

    assert document["block"] == "ask"
    assert any("stroke_start" in points for points in document["behaviors"].values())


def test_lexemes_of_a_users_repertoire_are_planned(engage: Engage, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text('[gesture]\nCONDUIT = "BEAT"\n')
    (tmp_path / "it.xml").write_text('<bml id="b"><gesture id="g" lexeme="CONDUIT"/></bml>')
    done = engage("plan", "--set", f"control.repertoire={tmp_path / 'mine.toml'}", tmp_path / "it.xml")
    missing = engage("plan", "--set", "control.repertoire=no.toml", tmp_path / "it.xml")

    assert (done.code, "g:stroke" in done.out, done.err) == (0, True, "")
    assert missing.code == 2
    assert "no.toml: No such file" in missing.err


LOST = '<gaze id="g" target="nobody"/><gesture id="x" lexeme="NONE"/>'


@pytest.mark.parametrize(("rest", "code"), [("", 3), ('<wait id="w" duration="1"/>', 0)])
@pytest.mark.parametrize("options", [(), ("--format", "json")])
def test_a_block_of_which_nothing_is_left_is_told_so_and_ends_as_when_it_is_played(
    engage: Engage, tmp_path: Path, rest: str, code: int, options: tuple[str, ...]
) -> None:
    path = tmp_path / "lost.xml"
    path.write_text(f'<bml id="b">{LOST}{rest}</bml>')

    planned, played = engage("plan", path, *options), engage("play", path, "--embedded", "--virtual-time")
    assert (planned.code, played.code) == (code, code)
    end = f"{path}: b: it would fail: every behavior of it was dropped, and nothing is left to perform"
    assert (end in planned.err.splitlines()) == bool(code)
    assert planned.out


def test_a_strict_plan_of_which_nothing_is_left_ends_as_that(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "lost.xml"
    path.write_text(f'<bml id="b">{LOST}</bml>')

    assert engage("plan", path, "--strict").code == 3


@pytest.mark.parametrize(
    "content",
    [
        '<gaze id="a" target="blue-square" start="0"/><gaze id="b" target="red-square" start="1"/>',
        '<pointing id="a" target="blue-square" mode="RIGHT_HAND" start="0"/>'
        '<pointing id="b" target="red-square" mode="RIGHT_HAND" start="1.2"/>',
        '<speech id="s"><text>One, <sync id="m"/>two and three.</text></speech>'
        '<pointing id="a" target="red-square" stroke="s:m"/><head id="n" lexeme="NOD" start="s:end"/>',
    ],
)
def test_what_is_planned_is_what_is_performed(engage: Engage, content: str, tmp_path: Path) -> None:
    """The plan is rehearsed as the realizer has it rehearsed: a part that changes hands is where it is left."""
    block, feedback = tmp_path / "b.xml", tmp_path / "feedback.jsonl"
    block.write_text(f'<bml id="b">{content}</bml>')

    behaviors = json.loads(engage("plan", "--format", "json", block).out)["behaviors"]
    engage("play", "--embedded", "--virtual-time", "--feedback", feedback, block)

    told = [json.loads(line) for line in feedback.read_text().splitlines()]
    came = {(each["behavior"], each["sync"]): each["time"] for each in told if each["type"] == "sync_point_progress"}
    planned = {(id, sync): time for id, times in behaviors.items() for sync, time in times.items()}
    both = came.keys() & planned.keys()
    assert len(both) >= 10
    assert {each: planned[each] for each in both} == pytest.approx({each: came[each] for each in both}, abs=0.01)

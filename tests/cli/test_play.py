"""`engage play --embedded --virtual-time`: the whole way from a file to what the body did, in no time."""

import json
import re
from pathlib import Path
from typing import Any

import pytest

from tests.cli.command import FRAGMENT, GOOD_BLOCK, Engage

PLAY = ("play", "--embedded", "--virtual-time")
LONG = '<bml id="long"><speech id="s"><text>One two three four five six seven eight nine ten.</text></speech></bml>'
QUESTION = """\
<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="ask" turnIndex="1" turnStatus="full">
<speech id="s"><text>Are you ready?</text></speech></ebml:ebml>"""
REPLACE = '<bml id="new" composition="REPLACE"><gaze id="g" target="trapezoid"/></bml>'


@pytest.fixture
def files(tmp_path: Path) -> dict[str, Path]:
    texts = {"hello": GOOD_BLOCK, "ask": FRAGMENT, "long": LONG, "new": REPLACE}
    for name, text in texts.items():
        (tmp_path / f"{name}.xml").write_text(text)
    return {name: tmp_path / f"{name}.xml" for name in texts}


def lines(text: str, **fields: object) -> list[dict[str, Any]]:
    """The JSON lines that have these fields."""
    return [line for line in map(json.loads, text.splitlines()) if fields.items() <= line.items()]


def points(text: str, behavior: str) -> dict[str, float]:
    return {line["sync"]: line["time"] for line in lines(text, type="sync_point_progress", behavior=behavior)}


def test_a_block_is_performed_and_its_feedback_is_json_lines(engage: Engage, files: dict[str, Path]) -> None:
    result = engage(*PLAY, "--feedback", "-", files["hello"])

    assert result.code == 0, result.err
    assert [line["status"] for line in lines(result.out, type="block_progress", progress="end")] == ["done"]
    assert points(result.out, "words")["start"] == pytest.approx(points(result.out, "look")["stroke"], abs=1e-3)
    assert list(points(result.out, "look")) == [
        "start",
        "ready",
        "stroke_start",
        "stroke",
        "stroke_end",
        "relax",
        "end",
    ]


def test_only_the_played_block_is_written(engage: Engage, files: dict[str, Path]) -> None:
    result = engage(*PLAY, "--feedback", "-", files["ask"])

    assert {line["block"] for line in map(json.loads, result.out.splitlines())} == {"ask"}


def test_no_policy_moves_the_head_beside_a_plain_block(
    engage: Engage, files: dict[str, Path], tmp_path: Path
) -> None:
    events = tmp_path / "events.jsonl"

    result = engage(*PLAY, "--events", events, files["hello"])

    assert result.code == 0, result.err
    assert events.read_text() == ""


def test_a_fragment_starts_its_connection_events(engage: Engage, files: dict[str, Path]) -> None:
    result = engage(*PLAY, "--events", "-", files["ask"])

    assert result.code == 0, result.err
    kinds = [line["kind"] for line in lines(result.out, state="started", initiator="robot")]
    assert kinds == ["adjacency_pair", "directed_gaze", "mutual_facial_gaze"]


def test_the_events_of_a_fragment_are_followed_to_their_ends(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "ready.xml"
    path.write_text(QUESTION)

    result = engage(*PLAY, "--human", "none", "--events", "-", path)

    assert result.code == 0, result.err
    states = [(line["kind"], line["state"]) for line in map(json.loads, result.out.splitlines())]
    assert states == [
        ("adjacency_pair", "started"),
        ("mutual_facial_gaze", "started"),
        ("mutual_facial_gaze", "failed"),
        ("adjacency_pair", "failed"),
    ]


def test_the_events_of_a_block_are_followed_to_their_ends(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "look.json"
    path.write_text(
        """{"type": "block", "id": "look", "behaviors": [
          {"type": "gaze", "id": "g", "target": "rectangle"},
          {"type": "event", "id": "e", "kind": "directed_gaze", "responder": "human", "objects": ["rectangle"],
           "timing": [{"sync": "start", "ref": "g:end"}]}]}"""
    )

    result = engage(*PLAY, "--human", "none", "--events", "-", path)

    assert result.code == 0, result.err
    (started,) = lines(result.out, type="connection_event", state="started")
    (failed,) = lines(result.out, type="connection_event", state="failed", id=started["id"])
    assert failed["at"] - started["at"] == pytest.approx(2.5)


def test_a_turn_that_goes_on_is_not_held_up_by_its_pair(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "begin.xml"
    path.write_text(QUESTION.replace("full", "beginning"))

    result = engage(*PLAY, "--events", "-", path)

    assert result.code == 0, result.err
    assert [line["state"] for line in map(json.loads, result.out.splitlines())] == ["started"]


def test_a_reference_that_is_less_reliable_than_asked_is_a_warning(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "ask.xml"
    path.write_text(FRAGMENT.replace("0.95", "0.99"))

    result = engage(*PLAY, "--feedback", "-", path)

    (warning,) = lines(result.out, type="warning")
    assert (result.code, warning["block"], warning["kind"]) == (0, "ask", "POLICY")
    assert "nothing reaches the minimum reliability 0.99" in warning["message"]


def test_files_come_one_after_the_other(engage: Engage, files: dict[str, Path]) -> None:
    result = engage(*PLAY, "--feedback", "-", files["long"], files["hello"])

    (end,) = lines(result.out, block="long", progress="end")
    (start,) = lines(result.out, block="hello", progress="start")
    assert result.code == 0, result.err
    assert start["at"] >= end["at"]


def test_at_gives_each_file_its_time(engage: Engage, files: dict[str, Path]) -> None:
    result = engage(*PLAY, "--at", "0.5,0", "--feedback", "-", files["hello"], files["long"])

    (first,) = lines(result.out, block="long", progress="start")
    (second,) = lines(result.out, block="hello", progress="start")
    assert result.code == 0, result.err
    assert second["at"] - first["at"] == pytest.approx(0.5)


def test_a_block_that_another_file_replaces_counts_as_done(engage: Engage, files: dict[str, Path]) -> None:
    result = engage(*PLAY, "--at", "0,1", "--feedback", "-", files["long"], files["new"])

    assert [line["status"] for line in lines(result.out, block="long", progress="end")] == ["interrupted"]
    assert result.code == 0, result.err


def test_the_log_tells_of_a_block_that_is_replaced_while_it_waits_for_its_turn(
    engage: Engage, files: dict[str, Path], tmp_path: Path
) -> None:
    (tmp_path / "waiting.xml").write_text('<bml id="waiting" composition="APPEND"><wait id="w" duration="1"/></bml>')
    result = engage(*PLAY, "--at", "0,0.5,1", files["long"], tmp_path / "waiting.xml", files["new"])

    ends = [line.split(maxsplit=1)[1] for line in result.out.splitlines() if " block " in line]
    assert sorted(ends) == [
        "block long: interrupted",
        "block new: done",
        "block waiting: interrupted before its turn came, replaced by new",
    ]
    assert result.code == 0, result.err


def test_a_fragment_that_another_file_replaces_counts_as_done(engage: Engage, files: dict[str, Path]) -> None:
    result = engage(*PLAY, "--at", "0,1", "--feedback", "-", files["ask"], files["new"])

    assert [line["status"] for line in lines(result.out, block="ask", progress="end")] == ["interrupted"]
    assert result.code == 0, result.err


def test_failing_at_run_time_is_exit_code_3(engage: Engage, files: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "must.xml"
    path.write_text('<bml id="must"><pointing id="p" target="rectangle" required="true"/></bml>')

    result = engage(*PLAY, "--set", "control.variability.overheated=['left_arm','right_arm']", path, files["hello"])

    assert result.code == 3
    warning, failed = result.err.splitlines()
    assert warning.startswith("! EXECUTION_FAILURE must:p: ")
    assert failed.startswith(f"{path}:1: must: p: ")


def test_what_only_pointing_could_mean_fails_if_it_is_out_of_reach(engage: Engage, tmp_path: Path) -> None:
    path, world = tmp_path / "ask.xml", tmp_path / "world.json"
    path.write_text(
        FRAGMENT.replace("blue-square", "cup").replace('text="the blue piece"', 'text="this" deictic="true"')
    )
    world.write_text(
        """{"entities": [{"id": "cup", "kind": "object", "position": [-1.5, 0.1, 0.8]},
                         {"id": "ann", "kind": "person", "position": [1.2, 0.0, 1.3]}]}"""
    )

    result = engage(*PLAY, "--world", world, "--events", "-", "--feedback", "-", path)

    assert result.code == 3
    assert result.out == ""
    assert result.err.startswith(f"{path}: piece: no way to refer to cup: ")
    assert result.err.count("\n") == 1


def test_the_log_says_what_happens(engage: Engage, files: dict[str, Path]) -> None:
    result = engage(*PLAY, files["hello"])

    assert 'robot: "A rectangle." (from ' in result.out
    assert "robot looks at rectangle" in result.out
    assert "block hello: done" in result.out


def test_the_log_says_each_thing_that_the_robot_does_when_it_is_seen(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "all.xml"
    path.write_text(
        """<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="b">
            <gesture id="wave" lexeme="WAVE" mode="LEFT_HAND" strokeStart="1"/>
            <head id="n" lexeme="NOD" strokeStart="2"/>
            <posture id="p" start="3" end="5"><pose part="ARMS" lexeme="ARMS_OPEN"/></posture>
            <faceLexeme id="f" lexeme="SMILE" attackPeak="6" end="7"/></bml>"""
    )
    result = engage(*PLAY, path)

    told = [line.strip() for line in result.out.splitlines() if " robot " in line]
    assert (result.code, result.err) == (0, "")
    assert told[:2] == ["0:01.0  robot makes the gesture WAVE with the left hand", "0:02.0  robot nods"]
    assert told[2].endswith("robot takes the posture ARMS_OPEN ARMS")
    assert told[3:] == ["0:06.0  robot shows the face SMILE"]


def test_a_block_whose_id_is_taken_is_refused_in_one_line_without_its_id_twice(
    engage: Engage, files: dict[str, Path]
) -> None:
    result = engage(*PLAY, "--at", "0,0.5", files["long"], files["long"])

    (refusal,) = result.err.splitlines()
    assert refusal.startswith(f"{files['long']}: long: a block of this id is still being performed (")
    assert result.code == 2


def test_a_warning_about_a_behavior_names_it_once(engage: Engage, tmp_path: Path) -> None:
    (tmp_path / "x.xml").write_text('<bml id="b"><gesture id="g" lexeme="NOBODYS"/></bml>')
    result = engage(*PLAY, tmp_path / "x.xml")

    assert result.err.splitlines()[0].startswith("! CANNOT_CREATE_BEHAVIOR b:g: line 1: no gesture 'NOBODYS'")


def test_an_id_that_names_an_emoji_is_printed_as_it_is(engage: Engage, tmp_path: Path) -> None:
    (tmp_path / "x.xml").write_text('<bml id="b"><wait id="x" duration="0.1"/></bml>')
    result = engage(*PLAY, "-v", tmp_path / "x.xml")

    assert "b:x:start" in result.out


def test_quiet_prints_nothing(engage: Engage, files: dict[str, Path]) -> None:
    assert engage(*PLAY, "--quiet", files["hello"]) == (0, "", "")


def test_json_is_as_good_as_xml(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "look.json"
    path.write_text('{"type": "block", "id": "j", "behaviors": [{"type": "gaze", "id": "g", "target": "rectangle"}]}')

    result = engage(*PLAY, "--feedback", "-", path)

    assert result.code == 0, result.err
    assert "stroke" in points(result.out, "g")


def test_a_world_of_ones_own(engage: Engage, tmp_path: Path) -> None:
    world, block = tmp_path / "world.json", tmp_path / "cup.xml"
    world.write_text('{"entities": [{"id": "cup", "kind": "object", "position": [0.5, 0.1, 0.8]}]}')
    block.write_text('<bml id="b"><gaze id="g" target="cup"/></bml>')

    result = engage(*PLAY, "--world", world, "--feedback", "-", block)

    assert result.code == 0, result.err
    assert "stroke" in points(result.out, "g")


def test_a_block_may_wait_for_a_point_of_another_file(engage: Engage, files: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "after.xml"
    path.write_text('<bml id="after"><gaze id="g" target="trapezoid" start="long:s:end"/></bml>')

    result = engage(*PLAY, "--at", "0,0.5", "--feedback", "-", files["long"], path)

    (said,) = lines(result.out, block="long", behavior="s", sync="end")
    (looked,) = lines(result.out, block="after", behavior="g", sync="start")
    assert result.code == 0, result.err
    assert looked["at"] == pytest.approx(said["at"])


def test_a_point_of_a_block_that_is_not_there_costs_the_tie_and_is_told(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "after.xml"
    path.write_text('<bml id="after">\n<gaze id="g" target="trapezoid" start="long:s:end"/>\n</bml>')

    result = engage(*PLAY, path)

    assert result.code == 0
    assert "PARSING_FAILURE after:g: line 2: " in result.err
    assert "'long:s:end': no block is known as 'long'" in result.err


def test_both_kinds_of_lines_may_share_a_file(engage: Engage, files: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "lines.jsonl"

    result = engage(*PLAY, "--quiet", "--events", path, "--feedback", path, files["ask"])

    assert result == (0, "", "")
    types = {json.loads(line)["type"] for line in path.read_text().splitlines()}
    assert types == {"connection_event", "block_progress", "sync_point_progress"}


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux has a file that is always full")
def test_a_full_disk_stops_nothing_and_fails_the_command_at_the_end(engage: Engage, files: dict[str, Path]) -> None:
    result = engage(*PLAY, "--feedback", "/dev/full", files["hello"])

    assert result.code == 3
    assert result.err == (
        "/dev/full: cannot write: No space left on device; lines are lost until there is room\n"
        "/dev/full: 11 lines are lost: cannot write: No space left on device\n"
    )
    assert "block hello: done" in result.out


def test_the_person_minds_the_robot_and_a_line_of_prose_says_so(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "ask.xml"
    path.write_text(FRAGMENT)

    result = engage(*PLAY, "--events", tmp_path / "events.jsonl", path)

    states = [line["state"] for line in map(json.loads, (tmp_path / "events.jsonl").read_text().splitlines())]
    assert result.code == 0, result.err
    assert "failed" not in states
    assert states.count("succeeded") == states.count("started") == 3
    last = result.out.splitlines()[-1]
    assert re.search(r'Said: "Please move the blue piece".* they looked after .* Answered by human: nod', last)
    assert " (planned" not in result.out


def test_a_misspelt_target_is_said_on_standard_error_and_fails_a_strict_play(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "look.xml"
    path.write_text('<bml id="x"><gaze id="g" target="nobody"/><wait id="w" duration="0.1"/></bml>')

    lenient, strict = engage(*PLAY, path), engage(*PLAY, "--strict", path)

    assert (lenient.code, strict.code) == (0, 2)
    assert "! NO_SUCH_TARGET x:g: " in lenient.err
    assert f"{path}: x was done without g" in lenient.err
    assert "!" not in lenient.out
    assert "1 warning; --strict allows none" in strict.err

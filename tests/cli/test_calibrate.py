"""`engage calibrate body`: measured, asked, or from a file; and what comes of it for a choice of generation."""

import asyncio
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.cli.command import Engage, start
from tests.cli.test_processes import PATIENCE

OFF = "control.variability.miscalibrated=[{part='right_shoulder_yaw',angle=5},{part='neck_yaw',angle=-2}]"
SCENE = """\
<ebml:ebml xmlns:ebml="edu.wpi.ebml" xmlns="org.mindmakers.bml" id="ask" turnIndex="1" turnStatus="full">
  <ebml:reference id="piece" target="blue-square" minReliability="0.7">
    <speechOption text="this piece" cost="2" deictic="true"/>
    <speechOption text="the blue square between the other pieces, on my side" cost="10"/>
  </ebml:reference>
</ebml:ebml>
"""


def chosen(engage: Engage, tmp_path: Path, *more: str) -> tuple[str, str]:
    path = tmp_path / "scene.xml"
    path.write_text(SCENE)
    result = engage("plan", "--why", path, "--format", "json", *more)
    assert result.code == 0
    (pair,) = [pair for pair in json.loads(result.out) if pair["chosen"]]
    return pair["gesture"], pair["phrase"]


def test_what_is_measured_corrects_the_body_and_says_how_well(engage: Engage, tmp_path: Path) -> None:
    out, record, again = (tmp_path / name for name in ("c.toml", "m.jsonl", "again.toml"))
    result = engage("calibrate", "body", "--set", OFF, "--out", out, "--record", record)
    made = tomllib.loads(out.read_text())

    assert result.code == 0
    assert made["offsets"]["right_shoulder_yaw"] == pytest.approx(5.0, abs=0.5)
    assert made["offsets"]["neck_yaw"] == pytest.approx(-2.0, abs=0.5)
    assert set(made["errors"]) == {"head", "left_arm", "right_arm"}
    assert max(made["errors"].values()) < 1.5
    told = result.out[result.out.index("right_arm: ") :]
    before = re.search(r"right_arm: 24 measurements, (\S+) degrees", told)
    after = re.search(r"at \d+ other marks (\S+),", told)
    assert before is not None
    assert float(before[1]) > 4.0
    assert after is not None
    assert float(after[1]) < 0.6
    assert engage("calibrate", "body", "--measurements", record, "--out", again).code == 0
    assert tomllib.loads(again.read_text()) == made


def test_only_what_is_named_is_measured(engage: Engage, tmp_path: Path) -> None:
    out = tmp_path / "c.toml"
    assert engage("calibrate", "body", "--part", "head", "--out", out).code == 0

    assert set(tomllib.loads(out.read_text())["errors"]) == {"head"}


def test_a_poor_calibration_has_generation_use_more_words(engage: Engage, tmp_path: Path) -> None:
    """The scene of docs/faults.md: with its arms known, a point and two words are enough."""
    poor = tmp_path / "poor.toml"
    poor.write_text("[errors]\nhead = 6\nleft_arm = 8\nright_arm = 8\n")

    assert chosen(engage, tmp_path) == ("directed_gaze_with_pointing", "this piece")
    gesture, phrase = chosen(engage, tmp_path, "--set", f"control.calibration={poor}")
    assert gesture != "directed_gaze_with_pointing"
    assert phrase.startswith("the blue square between")
    good = tmp_path / "good.toml"
    engage("calibrate", "body", "--set", OFF, "--out", good)
    assert chosen(engage, tmp_path, "--set", f"control.calibration={good}", "--set", OFF)[1] == "this piece"


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["--part", "tail"], "--part: no part 'tail' (known: head, left_arm, right_arm)"),
        (["--measurements", "none.jsonl"], "none.jsonl: No such file or directory"),
    ],
)
def test_bad_arguments_are_refused_by_name(engage: Engage, arguments: list[str], error: str) -> None:
    result = engage("calibrate", "body", *arguments)

    assert (result.code, result.err.strip()) == (2, error)


def test_a_line_that_is_no_measurement_is_named(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "m.jsonl"
    path.write_text('\n{"part": "head"}\n')
    result = engage("calibrate", "body", "--measurements", path)

    assert result.code == 2
    assert f"{path}:2: Object missing required field `joints`" in result.err
    path.write_text("")
    result = engage("calibrate", "body", "--measurements", path)
    assert (result.code, result.err.strip()) == (3, f"{path}: no part was measured 3 times or more")


def test_a_body_that_gets_stuck_ends_it_with_a_reason(engage: Engage, tmp_path: Path) -> None:
    stuck = "control.variability.stall=[{part='right_arm',before='stroke'}]"
    result = engage("calibrate", "body", "--part", "right_arm", "--set", stuck, "--out", tmp_path / "c.toml")

    assert (result.code, result.err.strip()) == (3, "marks: no part was measured 3 times or more")
    assert "nothing has come of it for" in result.out


@pytest.mark.real_time
async def test_who_sits_before_it_types_where_it_points(tmp_path: Path) -> None:
    world = tmp_path / "world.json"
    places = {"a": (0.5, -0.1, 0.73), "b": (0.55, 0.1, 0.73), "c": (0.65, 0.0, 0.73)}
    entities = [{"id": id, "kind": "object", "position": place} for id, place in places.items()]
    world.write_text(json.dumps({"entities": entities}))
    out = tmp_path / "c.toml"
    process = await start("calibrate", "body", "--ask", "--part", "head", "--world", world, "--out", out)
    typed = "".join(f"{x:.3f} {y + 0.02:.3f} {z:.3f}\n" for x, y, z in places.values())
    told, error = await asyncio.wait_for(process.communicate(("somewhere\n" + typed).encode()), PATIENCE)

    assert process.returncode == 0, error.decode()
    assert "head is on a (0.500 -0.100 0.730). Where really? x y z in metres, or nothing: " in told.decode()
    assert "three numbers, such as 0.500 -0.100 0.730" in told.decode()
    assert tomllib.loads(out.read_text())["offsets"]["neck_yaw"] > 0.5  # 2 cm to the left, at half a metre


@pytest.mark.real_time
@pytest.mark.parametrize("lines", [0, 1])
def test_the_end_of_a_file_on_standard_input_is_told(tmp_path: Path, lines: int) -> None:
    (tmp_path / "typed.txt").write_text("\n" * lines)
    with open(tmp_path / "typed.txt" if lines else os.devnull) as places:
        command = [sys.executable, "-m", "engage_hri", "calibrate", "body", "--ask", "--part", "head"]
        ended = subprocess.run(command, stdin=places, capture_output=True, timeout=PATIENCE, cwd=tmp_path, text=True)

    error = "--ask: standard input has ended before all places were typed"
    assert (ended.returncode, ended.stderr.strip()) == (3, error)
    assert ended.stdout.count("Where really?") == lines + 1
    assert not list(tmp_path.glob("*.toml"))


@pytest.mark.parametrize("option", ["--out", "--record"])
def test_a_file_that_cannot_be_written_is_refused_before_anything_moves(
    engage: Engage, tmp_path: Path, option: str
) -> None:
    result = engage("calibrate", "body", "--part", "head", option, tmp_path / "nosuch" / "c.toml")

    assert (result.code, result.out) == (2, "")
    assert result.err.strip() == f"{tmp_path}/nosuch/c.toml: there is no folder {tmp_path}/nosuch"
    assert "is a folder" in engage("calibrate", "body", option, tmp_path).err

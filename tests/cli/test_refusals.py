"""Bad input: one line on standard error, `file:line: reason (advice)`, exit code 2, and nothing has moved."""

import json
from importlib import metadata
from pathlib import Path

import pytest

from engage_hri.services.commandline.shell.process import UNREADY
from tests.cli.command import ALONE, FRAGMENT, GOOD_BLOCK, Engage

BAD = {
    "cut.xml": ('<bml id="b">\n  <gaze id="g" target="rectangle"', "2", "malformed XML"),
    "crossed.xml": ('<bml id="b">\n  <gaze id="g" target="x">\n</bml>', "3", "malformed XML"),
    "foreign.xml": ("<html/>", "1", "neither BML nor EBML"),
    "typo.xml": ('<bml id="b">\n  <gaze id="g" target="x"/>\n  <face id="h" start="k:end"/>\n</bml>', "3", "unknown"),
    "twice.xml": ('<bml id="b">\n  <gaze id="g" target="x"/>\n  <gaze id="g" target="y"/>\n</bml>', "3", "duplicate"),
    "nameless.xml": ('<bml>\n  <gaze id="g" target="x"/>\n</bml>', "", "id"),
    "bomb.xml": ('<!DOCTYPE a [<!ENTITY b "c">]>\n<bml id="b"/>', "", "<!DOCTYPE>"),
    "empty.xml": ("", "", "empty"),
    "text.txt": ("hello", "", "neither XML nor JSON"),
    "cut.json": ('{"id": "b",\n "behaviors": [', "", "JSON"),
    "wrong.json": ('{"type": "block", "id": "b", "behaviors": [{"type": "gaze", "id": "g", "target": 3}]}', "",
                   "behaviors[0].target"),
    "unknown.json": ('{"type": "block", "id": "b", "behaviours": []}', "", "behaviours"),
    "reliability.xml": (FRAGMENT.replace("0.95", "1.5"), "3", "1.5"),
    "optionless.xml": (FRAGMENT.replace('<ebml:speechOption text="the blue piece" cost="3"/>', ""), "3", "phrase"),
}  # fmt: skip


@pytest.fixture(params=BAD)
def bad(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, str, str]:
    text, line, reason = BAD[request.param]
    path = tmp_path / request.param
    path.write_text(text)
    return path, line, reason


@pytest.mark.parametrize(
    "command", [("plan",), ("plan", "--why"), ("play", "--embedded", "--virtual-time")], ids=["plan", "why", "play"]
)
def test_a_bad_file_is_refused_with_place_and_reason(
    engage: Engage, bad: tuple[Path, str, str], command: tuple[str, ...]
) -> None:
    path, line, reason = bad

    result = engage(*command, path)

    assert result.code == 2
    assert result.out == ""
    assert result.err.startswith(f"{path}:{line}: " if line else f"{path}:")
    assert reason in result.err
    assert result.err.count("\n") == 1


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (ALONE.replace("blue-square", "blue-squere"), "the world does not know the object 'blue-squere'"),
        (FRAGMENT.replace('id="ask"', 'id="ask" addressee="nobody"'), "the world does not know the person 'nobody'"),
    ],
)
def test_a_fragment_about_unknown_things_is_refused(engage: Engage, tmp_path: Path, text: str, reason: str) -> None:
    path = tmp_path / "ask.xml"
    path.write_text(text)

    result = engage("play", "--embedded", "--virtual-time", path)

    assert result.code == 2
    assert result.err.startswith(f"{path}:")
    assert reason in result.err


@pytest.mark.parametrize(
    "command", [("plan",), ("plan", "--why"), ("bml",), ("play", "--embedded", "--virtual-time")]
)
@pytest.mark.parametrize("is_call", [True, False])
def test_an_unknown_object_costs_only_itself_in_every_command(
    engage: Engage, tmp_path: Path, command: tuple[str, ...], is_call: bool
) -> None:
    call = {"turn_status": "full", "parts": [{"say": "Please move"}, {"refer": "blue-squere"}]}
    path = tmp_path / "ask"
    path.write_text(json.dumps(call) if is_call else FRAGMENT.replace("blue-square", "blue-squere"))

    result = engage(*command, path)

    told = " ".join((result.out + result.err).split())
    assert result.code == 0
    said = "blue squere" if is_call else "the blue piece"
    assert (
        f"the world does not know the object 'blue-squere' (did you mean 'blue-square'?); only said: '{said}'" in told
    )
    if command[0] in ("plan", "play"):
        assert engage(*command, "--strict", path).code == 2


def test_contradictory_constraints_are_refused_by_line(engage: Engage, tmp_path: Path) -> None:
    path = tmp_path / "circle.xml"
    path.write_text(
        """<bml id="b">
  <gaze id="a" target="rectangle"/>
  <gaze id="b1" target="trapezoid"/>
  <constraint>
    <after ref="a:end"><sync ref="b1:start"/></after>
    <after ref="b1:end"><sync ref="a:start"/></after>
  </constraint>
</bml>"""
    )

    result = engage("plan", path)

    assert result.code == 2
    assert result.err.startswith(f"{path}:")
    assert "5" in result.err
    assert "6" in result.err


def test_nothing_of_a_good_file_moves_when_another_is_bad(engage: Engage, tmp_path: Path) -> None:
    good, bad, feedback = tmp_path / "good.xml", tmp_path / "bad.xml", tmp_path / "feedback.jsonl"
    good.write_text(GOOD_BLOCK)
    bad.write_text(BAD["typo.xml"][0])

    result = engage("play", "--embedded", "--virtual-time", "--feedback", feedback, good, bad)

    assert result.code == 2
    (line,) = map(json.loads, feedback.read_text().splitlines())
    assert (line["type"], line["block"], line["kind"]) == ("warning", "b", "PARSING_FAILURE")


def test_malformed_xml_warns_about_no_block(engage: Engage, tmp_path: Path) -> None:
    bad, feedback = tmp_path / "bad.xml", tmp_path / "feedback.jsonl"
    bad.write_text(BAD["cut.xml"][0])

    engage("play", "--embedded", "--virtual-time", "--feedback", feedback, bad)

    (line,) = map(json.loads, feedback.read_text().splitlines())
    assert (line["type"], line["block"]) == ("warning", None)


@pytest.mark.parametrize(
    ("world", "reason"),
    [
        ("{", "truncated"),
        ('{"entities": 3}', "array"),
        ('{"things": []}', "things"),
        ('{"entities": [{"id": "cup", "kind": "mug", "position": [0, 0, 0]}]}', "mug"),
        ('{"entities": [{"id": "cup", "kind": "object", "position": [0, 0]}]}', "position"),
        ('{"entities": [{"id": "", "kind": "object", "position": [1, 0, 0]}]}', "$.entities[0].id"),
        ('{"entities": [{"id": "cup", "kind": "object", "position": [1e308, 0, 0]}]}', "$.entities[0].position[0]"),
    ],
)  # fmt: skip
def test_a_bad_world_is_refused(engage: Engage, tmp_path: Path, world: str, reason: str) -> None:
    block, path = tmp_path / "b.xml", tmp_path / "world.json"
    block.write_text(GOOD_BLOCK)
    path.write_text(world)

    for command in (("plan",), ("play", "--embedded", "--virtual-time")):
        result = engage(*command, block, "--world", path)
        assert result.code == 2
        assert result.err.startswith(f"{path}: ")
        assert reason in result.err


@pytest.mark.parametrize(
    ("toml", "reason"),
    [
        ("[recognition", "not TOML"),
        ("robbot = 'x'", "robbot"),
        ("[recognition]\ngaze_resolution = 'room'", "recognition.gaze_resolution"),
        ("[recognition]\nspeed = 3", "`speed`"),
        ("[generation]\nglance_factor = -1", "glance_factor must be positive"),
        ("[bus]\nrobot = 'a/b'", "a/b"),
        ("generation = 3", "generation"),
    ],
)
def test_a_bad_configuration_is_refused_with_file_and_key(
    engage: Engage, tmp_path: Path, toml: str, reason: str
) -> None:
    path = tmp_path / "engage.toml"
    path.write_text(toml)

    for command in (["demo"], ["run", "realizer"], ["up"], ["watch"]):
        result = engage(*command, "--config", path)
        assert result.code == 2
        assert result.err.startswith(f"{path}: ")
        assert reason in result.err


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["fly"], "No such command 'fly'"),
        (["run", "nobody"], "'nobody' is not one of"),
        (["plan"], "Missing argument 'FILE'"),
        (["demo", "--events", "no/such/folder/x"], "no/such/folder/x: cannot write"),
        (["demo", "--config", "missing.toml"], "missing.toml: No such file"),
        (["play", "missing.xml"], "missing.xml: No such file"),
        (["play", "--virtual-time", "x.xml"], "add --embedded"),
        (["play", "--human", "attentive", "x.xml"], "--human is for a private system (add --embedded)"),
        (["play", "--human", "none", "x.xml"], "--human is for a private system (add --embedded)"),
        (["play", "--embedded", "--at", "1,2", "x.xml"], "2 times for 1 files"),
        (["play", "--embedded", "--at", "soon", "x.xml"], "not a list of seconds"),
        (["play", "--embedded", "--at=-1", "x.xml"], "not from 0 to 86400 seconds"),
        (["play", "--embedded", "--at", "nan", "x.xml"], "not from 0 to 86400 seconds"),
        (["play", "--embedded", "--virtual-time", "--at", "1e9", "x.xml"], "not from 0 to 86400 seconds"),
        (["play", "--embedded", "--connect", "tcp/127.0.0.1:7447", "x.xml"], "leave out --embedded"),
        (["watch", "--connect", "here"], "'here' is not an endpoint"),
        (["play", "--connect", "tcp/127.0.0.1", "hello.xml"], "'tcp/127.0.0.1' is not an endpoint"),
        (["up", "--listen", "tcp/127.0.0.1:65536"], "'tcp/127.0.0.1:65536' is not an endpoint"),
        (["run", "realizer", "--listen", "udp/127.0.0.1:7447"], "'udp/127.0.0.1:7447' is not an endpoint"),
        (["watch", "--robot", ""], "it is empty"),
        (["demo", "--set", "recognition"], "section.key=value"),
        (["demo", "--set", "recognition.speed=1"], "speed"),
    ],
)
def test_a_misused_command_is_one_line(
    engage: Engage, arguments: list[str], reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "hello.xml").write_text(GOOD_BLOCK)
    monkeypatch.chdir(tmp_path)

    result = engage(*arguments)

    assert result.code == (UNREADY if "--config" in arguments else 2)  # a file that is not there yet may come
    assert reason in result.err
    assert result.err.count("\n") == 1


def test_the_version_is_told(engage: Engage) -> None:
    result = engage("--version")

    assert (result.code, result.out) == (0, f"engage {metadata.version('engage-hri')}\n")


NOT_UTF_8 = {
    "world.json": b'{"entities":\n [{"id":"caf\xe9","kind":"object","position":[0.5,0,0.7]}]}',
    "turn.json": b'{"turn_status": "full",\n "parts": [{"say": "caf\xe9"}]}',
    "block.xml": b'<bml id="b">\n<speech id="s">caf\xe9</speech></bml>',
    "engage.toml": b'# one\nrobot = "caf\xe9"',
}


@pytest.mark.parametrize("name", NOT_UTF_8)
def test_a_file_that_is_not_utf_8_is_refused_with_its_line(engage: Engage, tmp_path: Path, name: str) -> None:
    bad, block = tmp_path / name, tmp_path / "good.xml"
    bad.write_bytes(NOT_UTF_8[name])
    block.write_text(GOOD_BLOCK)
    arguments = {"world.json": (block, "--world", bad), "engage.toml": (block, "--config", bad)}.get(name, (bad,))

    for command in (("plan",), ("play", "--embedded", "--virtual-time")):
        result = engage(*command, *arguments)

        assert (result.code, result.out) == (2, "")
        assert result.err.startswith(f"{bad}:2: ")
        assert "UTF-8" in result.err
        assert result.err.count("\n") == 1


@pytest.mark.parametrize("option", [("--robot", "caf\udce9"), ("--set", "robot=caf\udce9")])
def test_an_option_that_is_not_utf_8_is_refused(engage: Engage, tmp_path: Path, option: tuple[str, str]) -> None:
    (tmp_path / "block.xml").write_text(GOOD_BLOCK)

    result = engage("play", "--embedded", "--virtual-time", tmp_path / "block.xml", *option)

    assert result.code == 2
    assert "not UTF-8" in result.err


def test_the_name_of_a_file_need_not_be_utf_8(engage: Engage, tmp_path: Path) -> None:
    good, bad = tmp_path / "caf\udce9.json", tmp_path / "\udce9.json"
    good.write_text('{"turn_status": "full", "parts": [{"say": "Hello"}]}')
    bad.write_text("{")

    assert engage("play", "--embedded", "--virtual-time", good).code == 0
    result = engage("play", "--embedded", "--virtual-time", "--feedback", tmp_path / "feedback", bad)

    assert result.code == 2
    assert "\\udce9.json:1: " in result.err

"""What `engage play` writes as feedback and returns as exit code, for what is refused, dropped and failing."""

from pathlib import Path

import pytest

from tests.cli.command import Engage
from tests.cli.test_play import lines

PLAY = ("play", "--embedded", "--virtual-time", "--quiet")
REFUSED = {
    "malformed": ('<bml id="b">\n<gaze</bml>', 2, None),
    "nameless": ('<bml>\n<gaze id="g" target="human"/></bml>', 1, None),
    "dangling": ('<bml id="b">\n<gaze id="g" target="human" start="x:end"/></bml>', 2, "b"),
    "valueless": ('<bml id="b">\n<gaze id="g"/></bml>', 2, "b"),
    "refless": ('<bml id="b"><constraint>\n<after ref="1"><sync/></after></constraint></bml>', 2, "b"),
    "required": ('<bml id="b">\n<required><dance id="d"/></required></bml>', 2, "b"),
    "required target": ('<bml id="b">\n<gaze id="g" target="unicorn" required="true"/></bml>', 2, "b"),
    "deadlock": (
        '<bml id="b"><wait id="v" duration="1"/><wait id="w" duration="1"/>\n<constraint><after ref="v:end">'
        '<sync ref="w:start"/></after><after ref="w:end"><sync ref="v:start"/></after></constraint></bml>',
        1,
        "b",
    ),
}


@pytest.fixture
def block(tmp_path: Path) -> Path:
    return tmp_path / "block.xml"


@pytest.mark.parametrize("name", REFUSED)
def test_a_refused_block_is_told_once_with_its_line(engage: Engage, block: Path, name: str) -> None:
    text, line, id = REFUSED[name]
    block.write_text(text)

    result = engage(*PLAY, "--feedback", "-", block)

    (warning,) = lines(result.out)
    assert (warning["type"], warning["block"], warning["behavior"]) == ("warning", id, "")
    assert result.code == 2
    assert result.err.startswith(f"{block}:{line}: ")
    assert result.err.count("\n") == 1


def test_what_is_dropped_is_told_and_the_rest_runs(engage: Engage, block: Path) -> None:
    block.write_text('<bml id="b"><gaze id="g" target="unicorn"/><dance id="d"/><speech id="s">Hello</speech></bml>')

    result = engage(*PLAY, "--feedback", "-", block)

    assert [(each["behavior"], each["kind"]) for each in lines(result.out, type="warning")] == [
        ("g", "NO_SUCH_TARGET"),
        ("d", "BEHAVIOR_TYPE_NOT_SUPPORTED"),
    ]
    assert lines(result.out, behavior="s", sync="end")
    assert result.code == 0, result.err


def test_what_is_required_and_fails_while_running_is_a_failure(engage: Engage, block: Path) -> None:
    block.write_text('<bml id="b"><required><pointing id="p" target="rectangle" mode="LEFT_HAND"/></required></bml>')

    result = engage(*PLAY, "--set", "control.variability.overheated=['left_arm']", "--feedback", "-", block)

    (end,) = lines(result.out, type="block_progress", progress="end")
    assert end["status"] == "failed"
    assert result.code == 3


def test_a_fragment_of_which_no_word_is_spoken_has_failed(engage: Engage, tmp_path: Path) -> None:
    fragment = tmp_path / "ask.json"
    fragment.write_text('{"turn_status": "full", "parts": [{"say": "Hello there"}, {"look": "human"}]}')

    result = engage(*PLAY, "--set", "control.variability.mute=refuse", "--outcomes", "-", fragment)

    assert result.code == 3
    assert f"{fragment}: ask: none of its words was spoken: say-1 was dropped: the voice cannot speak\n" in result.err
    assert lines(result.out)[0]["status"] == "failed"

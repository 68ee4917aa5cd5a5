"""`--log FILE`: what of a run is in the file, at which level, and what is not."""

import logging
import re
from pathlib import Path

import pytest

from engage_hri.services.commandline import logs
from tests.cli.command import FRAGMENT, Engage

LINE = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}[+-]\d\d:\d\d (DEBUG|INFO|WARNING|ERROR) ([a-z]+): .+")


def played(engage: Engage, folder: Path, *options: object, text: str = FRAGMENT) -> list[str]:
    file, log = folder / "ask.xml", folder / "robot.log"
    file.write_text(text)
    engage("play", file, "--embedded", "--virtual-time", "--quiet", "--log", log, *options)
    lines = log.read_text().splitlines()
    assert [line for line in lines if LINE.fullmatch(line)] == lines
    return lines


def test_the_file_has_a_line_for_each_thing_that_happened(engage: Engage, tmp_path: Path) -> None:
    text = "\n".join(played(engage, tmp_path))

    for expected in (
        "INFO peers: peer realizer: here", "INFO peers: peer realizer: gone", "INFO simulation: person human: here",
        "INFO realizer: block ask: done after", "INFO recognition: event ", "directed_gaze from robot to human",
        "INFO generation: fragment ask of ", "INFO generation: turn ask to human: done",
    ):  # fmt: skip
        assert expected in text
    assert "Please" not in text, "words that are said"


def test_a_second_run_is_added(engage: Engage, tmp_path: Path) -> None:
    once = len(played(engage, tmp_path))

    assert len(played(engage, tmp_path)) == 2 * once


def test_levels_are_set_for_each_source(engage: Engage, tmp_path: Path) -> None:
    lines = played(engage, tmp_path, "--log-level", "realizer=debug", "--log-level", "recognition=error")
    sources = {(match[2], match[1]) for line in lines if (match := LINE.fullmatch(line))}

    assert ("realizer", "DEBUG") in sources
    assert not [source for source, _ in sources if source == "recognition"]
    assert ("generation", "DEBUG") not in sources


def test_debug_holds_every_message_but_not_the_words(engage: Engage, tmp_path: Path) -> None:
    text = "\n".join(played(engage, tmp_path, "--log-level", "debug"))

    assert "DEBUG control: sync_point_reached" in text
    assert "DEBUG generation: perform_block" in text
    assert "robot_state" not in text, "a stream"
    assert "Please" not in text


def test_a_warning_is_a_line_and_is_not_printed_twice(engage: Engage, tmp_path: Path) -> None:
    block = tmp_path / "b.xml"
    block.write_text('<bml id="x"><gaze id="g" target="nobody"/></bml>')
    result = engage("play", block, "--embedded", "--virtual-time", "--log", tmp_path / "log")

    assert "WARNING realizer: block x:g: NO_SUCH_TARGET" in (tmp_path / "log").read_text()
    assert result.err.count("NO_SUCH_TARGET") == 1


def test_a_line_stays_one_line_whatever_a_target_is_called(engage: Engage, tmp_path: Path) -> None:
    lines = played(engage, tmp_path, text='<bml id="x"><gaze id="g" target="no&#10;body"/></bml>')

    assert [line for line in lines if "no\\nbody" in line]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--log", "/nowhere/robot.log"), "--log /nowhere/robot.log: cannot be written: No such file or directory"),
        (("--log", "robot.log", "--log-level", "loud"), "--log-level: unknown 'loud'"),
        (("--log", "robot.log", "--log-level", "voice=debug"), "--log-level: unknown 'voice'"),
        (("--log", "robot.log", "--log-level", "=debug"), "--log-level: unknown ''"),
        (("--log-level", "debug"), "--log-level: there is no log whose level it could be (add --log FILE)"),
        (("--log", "-"), "--log -: cannot be written: it is no file"),
    ],
)
def test_what_cannot_be_done_is_refused(engage: Engage, tmp_path: Path, options: tuple[str, ...], told: str) -> None:
    file = tmp_path / "ask.xml"
    file.write_text(FRAGMENT)
    result = engage("play", file, "--embedded", "--virtual-time", *options)

    assert result.code == 2
    assert result.err.startswith(told)


@pytest.mark.contained
def test_a_traceback_can_forge_no_line_and_no_colour(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log, evil = tmp_path / "robot.log", "x\n2026 INFO forged\x1b[2J\r\u2028\x85"
    logs.configure(log)
    try:
        raise ValueError(evil)
    except ValueError:
        logging.getLogger("engage.realizer").exception("bad %s", evil)
    logs.configure()
    head, *rest = log.read_text().split("\n")[:-1]

    assert LINE.fullmatch(head)
    assert rest
    assert all(line.startswith("  ") for line in rest)
    for text in (log.read_text(), capsys.readouterr().err):
        assert all(line.isprintable() for line in text.split("\n"))
        assert text.count("forged") == 2

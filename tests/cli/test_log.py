"""`--log FILE`: what of a run is in the file, at which level, and what is not."""

import asyncio
import logging
import re
import signal
from pathlib import Path

import pytest

from engage_hri.services.bus import journal
from engage_hri.services.commandline.shell import logs
from tests.bus.places import free_endpoint
from tests.cli.command import FRAGMENT, Engage, start

LOSING = """
from engage_hri.schemas.faults import Fault
from engage_hri.services.control.torso.body import SimulatedBody

class Losing(SimulatedBody):
    async def perform(self, behavior, authority):
        self.on_fault(Fault(reason="the daemon is gone", advice="start it", service="control"))
        async for progress in super().perform(behavior, authority):
            yield progress
        self.on_recovery("it is back")
"""
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


@pytest.mark.parametrize("alerts", [True, False])
def test_what_a_person_has_to_see_to_is_printed_by_commands_that_serve(
    capsys: pytest.CaptureFixture[str], alerts: bool
) -> None:
    logs.configure(alerts=alerts)
    log = logging.getLogger("engage.control")
    journal.alert(log, "control: %s", "the daemon is gone (start it)")
    log.warning("refused perform_behavior of realizer")
    logs.configure()

    assert capsys.readouterr().err == ("control: the daemon is gone (start it)\n" if alerts else "")


def test_what_comes_again_and_again_is_printed_at_the_first_tenth_and_hundredth_time(
    capsys: pytest.CaptureFixture[str],
) -> None:
    logs.configure(alerts=True)
    for _ in range(120):
        journal.alert(logging.getLogger("engage.control"), "lost")
    journal.alert(logging.getLogger("engage.control"), "found")
    logs.configure()

    assert capsys.readouterr().err == "lost\nlost (for the 10th time)\nlost (for the 100th time)\nfound\n"


@pytest.mark.real_time
async def test_a_fault_of_the_body_and_its_end_are_once_in_the_terminal_of_up(tmp_path: Path) -> None:
    (tmp_path / "losing.py").write_text(LOSING)
    (tmp_path / "nod.xml").write_text('<bml id="b"><head id="n" lexeme="NOD"/></bml>')
    where = free_endpoint()
    alone = ("--set", "simulation.human=none")  # so that the robot does nothing but the block
    up = await start("up", "--robot", "losing", "--listen", where, "--body", tmp_path / "losing.py", *alone)
    assert up.stdout is not None
    try:
        async with asyncio.timeout(60):
            lines = []
            while not lines or "all services are up" not in lines[-1]:
                lines.append((await up.stdout.readline()).decode())
            play = await start("play", tmp_path / "nod.xml", "--robot", "losing", "--connect", where)
            await play.communicate()
            while "back" not in lines[-1]:
                lines.append((await up.stdout.readline()).decode())
            up.send_signal(signal.SIGINT)
            lines += (await up.communicate())[0].decode().splitlines()
    finally:
        if up.returncode is None:
            up.kill()

    told = "\n".join(lines)
    assert told.count("the daemon is gone (start it)") == 1
    assert told.count("it is back") == 1


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

"""A disk that is full ends no robot: what finds no room is told once and counted, and writing goes on later."""

import asyncio
import json
import logging
import os
import resource
import sys
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.schemas.faults import RunFailed
from engage_hri.services.commandline.shell import logs
from engage_hri.services.commandline.shell.outputs import Outputs, Patient, complain, without_waiting
from tests.bus.places import free_endpoint
from tests.cli.command import FRAGMENT, GOOD_BLOCK, Engage, start
from tests.cli.test_processes import PATIENCE, line

FULL = Path("/dev/full")
has_full = pytest.mark.skipif(not FULL.exists(), reason="Linux has a file that is always full")


class Disk:
    """A file on a disk with so much room."""

    def __init__(self, room: int) -> None:
        self.room = room
        self.content = b""

    def put(self, data: bytes) -> int:
        if not self.room:
            raise OSError(28, os.strerror(28))
        taken = data[: self.room]
        self.content += taken
        self.room -= len(taken)
        return len(taken)


def test_it_is_told_once_counted_and_written_again_without_a_torn_line() -> None:
    disk, told = Disk(12), list[str]()
    file = Patient("events", disk.put, told.append)
    for number in range(6):
        file.write(f"line {number}\n")
    disk.room = 100
    file.write("line 6\n")

    assert disk.content == b"line 0\nline 1\nline 6\n"
    assert told == [
        "events: cannot write: No space left on device; lines are lost until there is room",
        "events is written again; 4 lines are lost",
    ]
    assert str(file.settle()) == "events: 4 lines are lost: cannot write: No space left on device"


def test_a_disk_that_is_full_again_and_again_is_told_once() -> None:
    disk, told = Disk(0), list[str]()
    file = Patient("events", disk.put, told.append)
    for _ in range(120):
        disk.room = 0
        file.write("lost\n")
        disk.room = 100
        file.write("kept\n")

    assert told[1:] == ["events is written again; 1 line is lost"]
    assert disk.content == b"kept\n" * 120
    assert str(file.settle()).startswith("events: 120 lines are lost")


@given(st.lists(st.tuples(st.sampled_from(("a\n", "bcd\n", "two\nlines\n")), st.integers(0, 9)), max_size=30))
def test_what_is_written_is_whole_lines_in_order_and_the_rest_is_counted(steps: list[tuple[str, int]]) -> None:
    disk = Disk(0)
    file = Patient("events", disk.put, lambda line: None)
    for text, room in steps:
        disk.room = room
        file.write(text)
    disk.room = 100
    file.settle()

    written, kept = disk.content.decode(), 0
    for text, _ in steps:
        if written.startswith(text):
            written = written.removeprefix(text)
            kept += text.count("\n")
    assert not written
    assert file.lost == sum(text.count("\n") for text, _ in steps) - kept


def test_a_reader_that_has_gone_is_another_matter() -> None:
    def put(data: bytes) -> int:
        raise BrokenPipeError

    with pytest.raises(BrokenPipeError):
        Patient("events", put, lambda line: None).write("x\n")


@has_full
def test_what_a_robot_prints_may_find_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    with FULL.open("w") as full:
        monkeypatch.setattr(sys, "stdout", full)
        outputs = Outputs(None, None).__enter__()
        console = outputs.console(quiet=False)
        for name in ("control is here", "realizer is here"):
            console.print(name)
        with pytest.raises(RunFailed, match="standard output: 2 lines are lost"):
            outputs.__exit__(None, None, None)


def test_a_router_waits_for_no_reader() -> None:
    told: list[str] = []
    reading, writing = os.pipe()
    with open(reading, "rb", buffering=0) as reader, open(writing, "w"):
        lines = Patient("standard output", partial(without_waiting, writing), told.append)
        for number in range(1000):  # more than a pipe holds
            lines.write(f"{number:9999}\n" if number < 3 else f"{number:100}\n")
        written = reader.read(2**20)
        lines.write("again\n")
        written += reader.read(2**20)

    kept = [int(line) for line in written.split(b"\n")[:-2]]
    assert kept == list(range(len(kept)))
    assert written.endswith(b"\nagain\n")
    assert lines.lost == 1000 - len(kept) > 0
    assert told == [
        "standard output: cannot write: nobody reads; lines are lost until there is room",
        f"standard output is written again; {lines.lost} lines are lost",
    ]


@pytest.mark.contained
def test_a_warning_waits_for_no_reader(monkeypatch: pytest.MonkeyPatch) -> None:
    """As of a terminal that is paused: a service that waited for it would stand still, and the robot with it."""
    reading, writing = os.pipe()
    with open(reading, "rb", buffering=0) as reader, open(writing, "w") as stream:
        os.set_blocking(writing, False)  # so that a writer who does not ask for room fails here, and does not hang
        monkeypatch.setattr(sys, "stderr", stream)
        logs.configure()
        for number in range(1000):  # more than a pipe holds
            logging.getLogger("engage").warning("%100d", number)
        written = reader.read(2**20)
        logging.getLogger("engage").warning("again")
        written += reader.read(2**20)
        monkeypatch.undo()

    *kept, last, told = written.decode().splitlines()
    assert [int(each) for each in kept] == list(range(len(kept)))
    assert last == "again"
    lost = 1000 - len(kept) + 1  # and the line that says so
    assert told == f"standard error is written again; {lost} lines are lost"


@has_full
@pytest.mark.contained
def test_complaints_that_find_no_room_end_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    full = FULL.open("w", buffering=1)
    monkeypatch.setattr(sys, "stderr", full)
    logs.configure()
    logging.getLogger("engage").error("a bug")
    complain("control is ready")
    monkeypatch.undo()

    with pytest.raises(OSError, match="No space"):  # So it was tried.
        full.close()


@has_full
def test_a_log_on_a_full_disk_is_told_once(engage: Engage, tmp_path: Path) -> None:
    file = tmp_path / "ask.xml"
    file.write_text(FRAGMENT)
    result = engage("play", file, "--embedded", "--virtual-time", "--quiet", "--log", FULL)

    told = "--log /dev/full: cannot write: No space left on device; lines are lost until there is room\n"
    assert (result.code, result.err) == (0, told)


@pytest.mark.real_time
@has_full
@pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="Linux sets limits of another process")
async def test_a_robot_goes_on_and_writes_again_when_there_is_room(tmp_path: Path) -> None:
    endpoint, feedback = free_endpoint(), tmp_path / "feedback.jsonl"
    (tmp_path / "block.xml").write_text(GOOD_BLOCK)
    up = await start("up", "--listen", endpoint, "--events", FULL, "--feedback", feedback)

    async def play(*options: object) -> int | None:
        playing = await start("play", "--connect", endpoint, *options)
        async with asyncio.timeout(PATIENCE):
            await playing.communicate()
        return playing.returncode

    def limit(size: int) -> None:
        most = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
        resource.prlimit(up.pid, resource.RLIMIT_FSIZE, (size, most))

    try:
        await line(up, "all services are up", log=False)
        limit(0)
        codes = [await play(tmp_path / "block.xml")]
        told = await line(up, "feedback.jsonl")
        assert feedback.read_text() == ""
        limit(2**20)
        (tmp_path / "ask.xml").write_text(FRAGMENT)
        codes += [await play(tmp_path / "ask.xml"), await play(tmp_path / "block.xml")]
        again = await line(up, "feedback.jsonl")
    finally:
        up.send_signal(2)
        _, err = await up.communicate()

    assert codes == [0, 0, 0]
    assert told == f"{feedback}: cannot write: File too large; lines are lost until there is room\n"
    assert again.startswith(f"{feedback} is written again; ")
    assert {json.loads(each)["type"] for each in feedback.read_text().splitlines()} >= {"block_progress"}
    assert up.returncode == 3
    assert f"{FULL}: " in err.decode()
    assert " lines are lost: cannot write: No space left on device" in err.decode()

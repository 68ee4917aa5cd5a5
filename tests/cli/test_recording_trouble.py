"""`engage record` as a process whose disk fills up, or whose file goes: what it says, and how it ends."""

import asyncio
import importlib.util
import shutil
import signal
from asyncio.subprocess import Process
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from tests.bus.places import PATIENCE, free_endpoint
from tests.cli.command import start
from tests.cli.test_processes import line

resource = pytest.importorskip("resource")  # Windows has none

pytestmark = [
    pytest.mark.real_time,
    pytest.mark.skipif(importlib.util.find_spec("mcap") is None, reason="the extra `record` is not installed"),
    pytest.mark.skipif(not hasattr(resource, "prlimit"), reason="no limit can be given to another process here"),
]


@asynccontextmanager
async def recorder_of(path: Path) -> AsyncIterator[tuple[Bus, Process]]:
    """A participant, and a recorder that listens to it."""
    endpoint = free_endpoint()
    async with await open_hub("told", listen=[endpoint]) as hub:
        there = hub.join("there")
        there.declare_alive()
        with there.subscribe(keys.ANY_ALIVE) as presence:
            recorder = await start("record", path, "--robot", "told", "--connect", endpoint)
            await line(recorder, "recording told into")
            async for received in presence:
                if received.source.startswith("record-"):
                    break
        yield there, recorder


async def ended(recorder: Process) -> tuple[int | None, str]:
    recorder.send_signal(signal.SIGINT)
    _, said = await asyncio.wait_for(recorder.communicate(), PATIENCE)
    return recorder.returncode, said.decode()


async def test_who_records_is_told_at_once_of_a_disk_without_room_and_by_the_exit_code_after_ctrl_c(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.mcap"
    async with recorder_of(path) as (there, recorder):
        resource.prlimit(recorder.pid, resource.RLIMIT_FSIZE, (10, resource.RLIM_INFINITY))  # a full disk
        there.publish(keys.fault("there"), Fault(reason="no room for this"))
        await line(recorder, "a.mcap: File too large; what comes waits in memory, at most 32 MiB of it")
        code, said = await ended(recorder)

    assert code == 3
    assert "for want of room on the disk" in said
    assert "engage record --repair" in said


async def test_a_recording_that_was_removed_with_its_folder_is_not_said_to_be_there(tmp_path: Path) -> None:
    path = tmp_path / "day" / "a.mcap"
    path.parent.mkdir()
    async with recorder_of(path) as (_, recorder):
        shutil.rmtree(path.parent)
        await line(recorder, "a.mcap: removed while it is recorded, and lost with the end of its recorder")
        code, said = await ended(recorder)

    assert code == 3
    assert said.strip().endswith("a.mcap: it was removed while it was recorded, and is lost")

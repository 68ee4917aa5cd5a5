"""Recorder as a process of its own on real sockets, killed: the file opens, and a second at most is missing."""

import asyncio
import signal
import sys
from asyncio.subprocess import PIPE
from pathlib import Path

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.participants import PeerAlive
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.recording.disk import read, repair
from engage_hri.services.recording.service import FLUSH
from tests.bus.places import PATIENCE, free_endpoint

pytestmark = pytest.mark.real_time


async def test_what_a_killed_recorder_took_before_its_last_write_is_in_the_file(tmp_path: Path) -> None:
    path, endpoint = tmp_path / "a.mcap", free_endpoint()
    async with await open_hub("killed", listen=[endpoint]) as hub:
        bus = hub.join("there")
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "engage_hri", "record", str(path), "--robot", "killed", "--connect", endpoint),
            stderr=PIPE,
        )
        with bus.subscribe(keys.ANY_ALIVE) as presence:
            while (received := await presence.next(bus.now() + PATIENCE)) is not None:
                if isinstance(received.message, PeerAlive) and received.source.startswith("record-"):
                    break
            assert received is not None
        published = 0
        loop = asyncio.get_running_loop()
        turned: list[int] = []
        while len(turned) < 4:  # until some chunks are on the disk, whatever the speed of this machine
            bus.publish(keys.fault("there"), Fault(reason=str(published)))
            published += 1
            size = path.stat().st_size
            if size not in turned:
                turned.append(size)
            await _soon(loop)
        process.send_signal(signal.SIGKILL)
        await process.wait()

    recording = read(path)
    mine = [one for n in range(len(recording)) if (one := recording.received(n)) and one.key == keys.fault("there")]
    numbers = [int(one.message.reason) for one in mine if isinstance(one.message, Fault)]
    assert not recording.is_whole
    assert numbers == [*range(len(numbers))]
    assert numbers
    assert mine[-1].at - mine[0].at >= FLUSH
    repair(recording, tmp_path / "b.mcap", print)
    assert read(tmp_path / "b.mcap").is_whole
    assert len(read(tmp_path / "b.mcap")) == len(recording)


async def _soon(loop: asyncio.AbstractEventLoop) -> None:
    """Let the bus do its work."""
    done = loop.create_future()
    loop.call_later(0.005, done.set_result, None)
    await done

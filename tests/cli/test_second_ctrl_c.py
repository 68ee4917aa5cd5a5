"""A second Ctrl-C, sent to a process of its own that waits for what does not come."""

import asyncio
import os
import signal
import sys
from contextlib import suppress
from pathlib import Path

import pytest

from engage_hri.services.bus.zenoh.hub import open_hub
from tests.bus.places import free_endpoint
from tests.cli.command import start
from tests.cli.test_processes import PATIENCE, children, gone, line, stopped
from tests.realizer.fake_body import FakeBody

pytestmark = pytest.mark.real_time


async def later(seconds: float) -> None:
    """Let time pass, which is what a second signal is told by."""
    passed = asyncio.Event()
    asyncio.get_running_loop().call_later(seconds, passed.set)
    await passed.wait()


BLOCKING = """
import time
from tests.control.test_drivers import Bare

class Forever(Bare):
    def see(self, world):
        print("blocks", flush=True)
        while True:
            time.sleep(60.0)
"""


@pytest.mark.parametrize(("how", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
async def test_a_driver_that_never_comes_back_is_left_at_the_second_and_named(
    tmp_path: Path, how: signal.Signals, code: int
) -> None:
    (tmp_path / "b.xml").write_text('<bml id="b"><wait id="w" duration="60"/></bml>')
    (tmp_path / "liar.py").write_text(BLOCKING)
    play = await start("play", tmp_path / "b.xml", "--embedded", "--body", tmp_path / "liar.py")
    await line(play, "blocks", log=False)
    play.send_signal(how)
    await later(1.1)
    assert play.returncode is None
    play.send_signal(how)
    async with asyncio.timeout(PATIENCE):
        _, err = await play.communicate()

    assert play.returncode == code
    assert f"a driver's call had not come back: see, {tmp_path}/liar.py, line 9\n" in err.decode()


DEADLOCK = """
import ctypes
from engage_hri.services.control.torso.body import SimulatedBody

class Deadlock(SimulatedBody):
    def see(self, world):
        print("blocks", flush=True)
        library, mutex = ctypes.CDLL(None), ctypes.create_string_buffer(64)
        library.pthread_mutex_lock(mutex)
        library.pthread_mutex_lock(mutex)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the system is told what to do on Linux alone")
async def test_a_driver_that_blocks_in_c_is_ended_by_the_second_ctrl_c(tmp_path: Path) -> None:
    (tmp_path / "b.xml").write_text('<bml id="b"><wait id="w" duration="60"/></bml>')
    (tmp_path / "dead.py").write_text(DEADLOCK)
    play = await start("play", tmp_path / "b.xml", "--embedded", "--body", tmp_path / "dead.py")
    await line(play, "blocks", log=False)
    play.send_signal(signal.SIGINT)
    await later(1.1)
    assert play.returncode is None
    play.send_signal(signal.SIGINT)
    await later(1.1)
    with suppress(ProcessLookupError):  # the first may have been taken up just before the driver blocked
        os.kill(play.pid, signal.SIGINT)
    async with asyncio.timeout(PATIENCE):
        await play.communicate()

    assert play.returncode == -signal.SIGINT  # 130, as shells count


@pytest.mark.skipif(sys.platform != "linux", reason="the system is told what to do on Linux alone")
@pytest.mark.parametrize("is_killed", [False, True])
async def test_no_service_outlives_up_though_it_blocks_in_c(tmp_path: Path, is_killed: bool) -> None:
    (tmp_path / "dead.py").write_text(DEADLOCK)
    where = free_endpoint()
    up = await start("up", "--robot", "dead", "--listen", where, "--body", tmp_path / "dead.py")
    await line(up, "│ blocks", log=False)
    offspring = children(up.pid)
    for _ in range(1 if is_killed else 2):
        up.send_signal(signal.SIGKILL if is_killed else signal.SIGINT)
        await later(0.2)
    async with asyncio.timeout(PATIENCE):
        _, err = await up.communicate()
        for pid in offspring:
            await gone(pid)

    assert is_killed or "not waited for: control" in err.decode()


@pytest.mark.parametrize("pause", [0.0, 0.0005, 0.005, 0.05])
async def test_a_second_ctrl_c_ends_it_at_once_without_a_word(tmp_path: Path, pause: float) -> None:
    """Whatever it does then. The realizer stands still: it does not say that the block has ended."""
    endpoint = free_endpoint()
    (tmp_path / "b.xml").write_text('<bml id="b"><wait id="w" duration="60"/></bml>')
    where = ("--robot", "patient", "--connect", endpoint)
    async with await open_hub("patient", listen=[endpoint]) as hub:
        realizer = await start("run", "realizer", *where)
        control = asyncio.create_task(FakeBody().serve(hub.join("control"), lambda: None))
        try:
            await line(realizer, "realizer is ready")
            play = await start("play", tmp_path / "b.xml", *where, "--verbose")
            await line(play, "b:w:start", log=False)
            realizer.send_signal(signal.SIGSTOP)
            play.send_signal(signal.SIGINT)
            for seconds in (pause, 0.05):  # of two that are pending at once the process sees one
                await later(seconds)
                with suppress(ProcessLookupError):  # `play.send_signal` would take its exit code
                    os.kill(play.pid, signal.SIGINT)
            async with asyncio.timeout(PATIENCE):
                _, err = await play.communicate()
        finally:
            realizer.send_signal(signal.SIGCONT)
            await stopped(realizer)
            control.cancel()
            await asyncio.wait([control])

    # So soon after the first the system may end it, before Python has taken that up: shells tell 130 of both.
    assert play.returncode in (130, -signal.SIGINT)
    assert err == b""

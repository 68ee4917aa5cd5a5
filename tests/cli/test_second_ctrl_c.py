"""A second Ctrl-C, sent to a process of its own that waits for what does not come."""

import asyncio
import os
import signal
from contextlib import suppress
from pathlib import Path

import pytest

from engage_hri.services.bus.zenoh.hub import open_hub
from tests.bus.places import free_endpoint
from tests.cli.command import start
from tests.cli.test_processes import PATIENCE, line, stopped
from tests.realizer.fake_body import FakeBody

pytestmark = pytest.mark.real_time


async def later(seconds: float) -> None:
    """Let time pass, which is what a second signal is told by."""
    passed = asyncio.get_running_loop().create_future()
    asyncio.get_running_loop().call_later(seconds, passed.set_result, None)
    await passed


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

    assert (play.returncode, err) == (130, b"")

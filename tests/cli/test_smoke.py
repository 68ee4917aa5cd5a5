"""The least that real processes must do, in `make test`: start, perform, notice a death, recover, stop.

All else about real processes is in the long share (`tests/long_share.py`).
"""

import asyncio
import signal
from pathlib import Path

import pytest

from tests.bus.places import free_endpoint
from tests.cli.command import start
from tests.cli.test_processes import PATIENCE, line, stopped

pytestmark = pytest.mark.real_time

HELLO = '<bml id="hello"><speech id="words"><text>Hello.</text></speech></bml>'
COUNT = '<bml id="count"><speech id="words"><text>One, two, three, four, five, six, seven.</text></speech></bml>'


async def test_a_killed_body_fails_what_it_performs_and_the_next_one_performs_again(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    (tmp_path / "count.xml").write_text(COUNT)
    (tmp_path / "hello.xml").write_text(HELLO)
    where = ("--robot", "smoke", "--connect", endpoint)
    realizer = await start("run", "realizer", "--robot", "smoke", "--listen", endpoint)
    former = control = await start("run", "control", *where)
    try:
        await line(realizer, "realizer is ready")
        await line(control, "control is ready")
        count = await start("play", "-v", *where, tmp_path / "count.xml")
        await line(count, "count:words:start", log=False)
        control.kill()
        control = await start("run", "control", *where)
        async with asyncio.timeout(PATIENCE):
            failed, _ = await count.communicate()
        await line(control, "control is ready")
        hello = await start("play", *where, tmp_path / "hello.xml")
        async with asyncio.timeout(PATIENCE):
            done, why = await hello.communicate()
    finally:
        killed = await stopped(former, signal.SIGKILL)
        codes = [await stopped(process) for process in (control, realizer)]

    assert (count.returncode, killed) == (3, -signal.SIGKILL)
    assert b"block count: failed" in failed
    assert (hello.returncode, why) == (0, b"")
    assert b"block hello: done" in done
    assert codes == [0, 0]

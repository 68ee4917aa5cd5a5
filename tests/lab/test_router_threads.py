"""A machine that is cut off takes nothing from the others: the router goes on while it closes the dead links."""

import asyncio
import sys
from pathlib import Path

import pytest

from tests.lab.lab import Process, laboratory, missing
from tests.lab.test_reach import engage, start, until

pytestmark = [pytest.mark.real_time, pytest.mark.skipif(bool(missing()), reason=missing())]
WATCHERS = 4
CUT = 9.0
"""Seconds: the links of a machine are taken to be dead after two, and Zenoh closes each for several."""


async def said(asker: Process, seconds: float) -> list[str]:
    """What the asker prints in so many seconds."""
    assert asker.stdout is not None
    lines = []
    deadline = asyncio.get_running_loop().time() + seconds
    while (left := deadline - asyncio.get_running_loop().time()) > 0:
        try:
            lines.append((await asyncio.wait_for(asker.stdout.readline(), left)).decode().strip())
        except TimeoutError:
            break
    return lines


async def test_processes_of_a_machine_that_is_cut_off_stop_neither_the_robot_nor_others(tmp_path: Path) -> None:
    """They are some dead links at once, with messages for all: each keeps one of the threads by which Zenoh receives.

    Zenoh has two of these, with which this fails; `engage router` has 32.
    """
    async with laboratory(tmp_path, seed=1) as lab:
        address = f"tcp/{lab.machines[1].ip}:7447"
        await until(await engage(lab.machines[1], "router", "--listen", address), "router is ready")
        await start(lab, "--connect", address)  # generation and recognition are on the second machine
        for _ in range(WATCHERS):  # Their links have all messages of the robot.
            await lab.machines[2].spawn(
                sys.executable, "-m", "engage_hri", "watch", "--connect", address, stdout=asyncio.subprocess.DEVNULL
            )
        shouter = await lab.machines[3].spawn(
            sys.executable, "-m", "tests.lab.shouter", address, stdout=asyncio.subprocess.PIPE
        )
        await until(shouter, "ready")
        asker = await lab.machines[3].spawn(
            sys.executable, "-m", "tests.lab.asker", address, "control", "simulation", "recognition",
            stdout=asyncio.subprocess.PIPE,
        )  # fmt: skip
        await until(asker, "recognition answers")
        await lab.isolate(2)
        during = await said(asker, CUT)
        await lab.isolate(2, is_cut=False)
        await until(asker, "recognition answers")

    others = [line for line in during if not line.startswith("recognition")]
    assert {line for line in others if line.endswith("is silent")} == set()
    assert {line.split()[0] for line in others} == {"control", "simulation"}
    assert "recognition is silent" in during

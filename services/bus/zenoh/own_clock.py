"""The clock of this process, and its name."""

import asyncio
import time
from collections.abc import Callable
from pathlib import Path

from engage_hri.schemas.units import Seconds

FIRST_TIME_SPACE = 0xEFFFFFFA
"""Number of the time namespace that Linux begins with."""


def own_clock(loop: asyncio.AbstractEventLoop, run: str) -> tuple[str, Callable[[], Seconds]]:
    """Name of the clock that loop time is, and how to read it: the machine's, one since boot, or the loop's own.

    uvloop tells time in whole milliseconds, as of when its turn began: too coarse to measure by. A machine has more
    than one such clock if its containers have time namespaces.
    """
    boot, space = Path("/proc/sys/kernel/random/boot_id"), Path("/proc/self/ns/time")
    if abs(loop.time() - time.monotonic()) < 0.1 and boot.exists():
        number = space.stat().st_ino if space.exists() else FIRST_TIME_SPACE
        more = "" if number == FIRST_TIME_SPACE else f"-{number}"
        return f"boot-{boot.read_text()[:8]}{more}", time.monotonic
    return f"loop-{run[:8]}", loop.time

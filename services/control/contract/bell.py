"""Waiting for an instant or for news, whichever comes first."""

import asyncio
from collections.abc import Awaitable
from math import inf
from typing import TypeVar

from engage_hri.schemas.units import Seconds

T = TypeVar("T")

EARLY: Seconds = 1e-9
"""A loop may run a timer this much too early: a task that then still found its instant ahead would wait for ever."""


class Bell:
    """Wakes the one task that waits in `wait`; `ring` may come before or during that. Tells the loop time, too."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._rung = asyncio.Event()

    def now(self) -> Seconds:
        """Loop time."""
        return self._loop.time()

    def is_past(self, at: Seconds) -> bool:
        return self._loop.time() >= at - EARLY

    def ring(self) -> None:
        self._rung.set()

    async def wait(self, until: Seconds) -> None:
        """Return once the bell has been rung since the last time, or at loop time `until` (inf: never)."""
        if self.is_past(until):
            return
        timer = None if until == inf else self._loop.call_at(until, self._rung.set)
        try:
            await self._rung.wait()
            self._rung.clear()
        finally:
            if timer is not None:
                timer.cancel()


async def within(seconds: Seconds, awaited: Awaitable[T]) -> T:
    """Await something for some seconds at most. Raises TimeoutError."""
    async with asyncio.timeout(seconds):
        return await awaited

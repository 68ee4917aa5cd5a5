"""Work on the event loop that is for later: timers that are set again and again, and long work a slice at a time.

All of a process runs on one loop, so whoever takes long holds up everybody else, the stop of a robot among them.
"""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

from engage_hri.schemas.units import Seconds
from engage_hri.services.runtime.steps import SLICE, Steps, T


class Alarm:
    """A timer that calls `ring` at a deadline. A later deadline does not move it: then it rings too early."""

    def __init__(self, ring: Callable[[], None]) -> None:
        self._ring = ring
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        self._at: Seconds = 0.0

    def set(self, at: Seconds | None) -> None:
        if at is None or (self._timer is not None and self._at <= at):
            return
        self.stop()
        self._at = at
        self._timer = self._loop.call_at(at, self._rings)

    def _rings(self) -> None:
        self._timer = None
        self._ring()

    def stop(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None


class Timer:
    """A timer that calls `ring` at the instant to which it was set last; never, if that is None."""

    def __init__(self, ring: Callable[[], None]) -> None:
        self._ring = ring
        self._loop = asyncio.get_running_loop()
        self._handle: asyncio.TimerHandle | None = None
        self._at: Seconds | None = None
        """Kept here: the handles of uvloop do not tell their time when it has come."""

    @property
    def at(self) -> Seconds | None:
        """Time when the timer is to ring; None: never."""
        return None if self._handle is None else self._at

    def set(self, at: Seconds | None) -> None:
        if self._handle is not None:
            if self._at == at:
                return
            self._handle.cancel()
        self._at = at
        self._handle = None if at is None else self._loop.call_at(at, self._rings)

    def _rings(self) -> None:
        self._handle = None
        self._ring()


class Afterwards:
    """A call of `ring` a few turns of the loop after the last `set`: after all that is under way by then.

    Nor later than `LONGEST` after the first.
    """

    TURNS = 5
    """Turns until the answer to a message is here if it is made at once: a task is woken, the message is delivered,
    its receiver is woken, the answer is delivered."""
    LONGEST: Seconds = 0.005

    def __init__(self, ring: Callable[[], None]) -> None:
        self._ring = ring
        self._loop = asyncio.get_running_loop()
        self._left = 0
        self._since: Seconds = 0.0
        self._handle: asyncio.Handle | None = None

    def set(self) -> None:
        if self._handle is None:
            self._since = self._loop.time()
            self._handle = self._loop.call_soon(self._turn)
        elif self._loop.time() > self._since + self.LONGEST:
            return
        self._left = self.TURNS

    def stop(self) -> None:
        if self._handle is not None:
            self._handle.cancel()
            self._handle = None

    def _turn(self) -> None:
        self._left -= 1
        if self._left:
            self._handle = self._loop.call_soon(self._turn)
        else:
            self._handle = None
            self._ring()


async def unhurried(steps: Steps[T]) -> T:
    """The result of long work, done a slice at a time: whatever else is due comes in between.

    A cancellation takes effect at the end of the slice.
    """
    done = 0
    try:
        while True:
            done += next(steps)
            if done >= SLICE:
                done = 0
                await asyncio.sleep(0)
    except StopIteration as end:
        result: T = end.value
        return result
    finally:
        steps.close()


class InTurns:
    """Long works one after the other, in slices: two at once would only make both late."""

    def __init__(self) -> None:
        self._turn = asyncio.Lock()

    def answer(self, steps: Steps[T]) -> T | Coroutine[Any, Any, T]:
        """The result, if one slice is enough for it, else what is to be awaited for it."""
        done = 0
        try:
            while done < SLICE:
                done += next(steps)
        except StopIteration as end:
            result: T = end.value
            return result
        return self._rest(steps)

    async def _rest(self, steps: Steps[T]) -> T:
        try:
            async with self._turn:
                await asyncio.sleep(0)
                return await unhurried(steps)
        finally:
            steps.close()

"""Timers on the event loop that are set again and again."""

import asyncio
from collections.abc import Callable

from engage_hri.schemas.units import Seconds


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

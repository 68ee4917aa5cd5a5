"""An event loop with a clock that jumps to the next timer: hours pass in seconds, times are exact, deadlocks show."""

import asyncio
import heapq
import itertools
import math
import selectors
from collections.abc import Callable, Coroutine
from contextvars import Context
from functools import partial
from pathlib import Path
from typing import Any, TypeVar, TypeVarTuple, Unpack

T = TypeVar("T")
Ts = TypeVarTuple("Ts")


class Deadlock(RuntimeError):
    """Every task waits and no timer is pending: in real time this would hang for ever."""


class TimeRanOut(RuntimeError):
    """Virtual time has passed the loop's limit: something waits for what never comes, and timers go on."""


LOOK_EVERY = 50
"""Turns of the loop from one look at its pipe to the next: a look is a call of the system."""


class _InstantSelector(selectors.SelectSelector):
    """A selector that does not wait: reports readiness of the loop's own pipe, and lets virtual time pass.

    Only signals need the pipe: what another thread calls is in the loop's queue already.
    """

    loop: "VirtualTimeLoop"
    _turns = 0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        self._turns += 1
        is_time_to_look = timeout is None or self._turns % LOOK_EVERY == 0
        ready = super().select(0) if is_time_to_look else []
        if ready or timeout == 0:
            return ready
        self.loop.jump(timeout)
        return []


class _Timer(asyncio.TimerHandle):
    """A timer in a firm order: of two due together the one set first fires first; asyncio leaves that to chance."""

    __slots__ = ("_place",)

    def __init__(self, number: int, when: float, *rest: Any) -> None:
        super().__init__(when, *rest)
        self._place = (when, number)

    def __lt__(self, other: "_Timer") -> bool:  # type: ignore[override]
        return self._place < other._place


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """An event loop that starts at second `begin`. `loop.time()` moves only when nothing else is left to do.

    Nothing outside the loop may wake it: no sockets, threads or processes, which take real time.
    limit: the second at which TimeRanOut is raised; with a timer that repeats there is never a Deadlock.
    """

    def __init__(self, limit: float = math.inf, begin: float = 0.0) -> None:
        self._limit = limit
        self._timers = itertools.count()
        self._virtual_now = begin
        selector = _InstantSelector()
        selector.loop = self
        super().__init__(selector)
        self._clock_resolution = math.ulp(0.0)

    def time(self) -> float:
        return self._virtual_now

    def call_at(
        self, when: float, callback: Callable[[Unpack[Ts]], object], *args: *Ts, context: Context | None = None
    ) -> asyncio.TimerHandle:
        self._check_closed()  # type: ignore[attr-defined]
        timer = _Timer(next(self._timers), when, callback, args, self, context)
        heapq.heappush(self._scheduled, timer)  # type: ignore[attr-defined]
        timer._scheduled = True  # type: ignore[attr-defined]
        return timer

    def jump(self, timeout: float | None) -> None:
        """Let time pass to the next timer. Raises Deadlock if there is none."""
        if timeout is None:
            waiting = sorted(_whereabouts(task) for task in asyncio.all_tasks(self) if not task.done())
            raise Deadlock(f"all tasks wait and no timer is pending: {', '.join(waiting)}")
        if self._virtual_now > self._limit:
            self._limit = math.inf  # the loop still has to end its tasks
            raise TimeRanOut(f"{self._virtual_now:.0f} s have passed")
        scheduled = self._scheduled  # type: ignore[attr-defined]
        # The exact instant of the next timer: now + timeout would be off by a rounding.
        self._virtual_now = scheduled[0]._when if scheduled else self._virtual_now + timeout
        # Timers are due before now + resolution: at now, and never earlier, or a callback that sets its timer again
        # at once would do so for ever, in one instant.
        self._clock_resolution = math.ulp(self._virtual_now)


def _whereabouts(task: "asyncio.Task[Any]") -> str:
    """Name and place of a task, as in `service realizer (service.py:57)`."""
    stack = task.get_stack(limit=1)
    place = f" ({Path(stack[0].f_code.co_filename).name}:{stack[0].f_lineno})" if stack else ""
    return f"{task.get_name()}{place}"


def run_virtual(main: Coroutine[Any, Any, T], begin: float = 0.0) -> T:
    """Run a coroutine as `asyncio.run` does, on a virtual clock. Raises Deadlock where real time would hang.

    begin: second at which the clock begins.
    """
    with asyncio.Runner(loop_factory=partial(VirtualTimeLoop, begin=begin)) as runner:
        return runner.run(main)

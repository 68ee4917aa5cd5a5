"""An event loop whose clock jumps to the next timer: hours in seconds, exact times, and deadlocks found for free."""

import asyncio
import selectors
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class Deadlock(RuntimeError):
    """Every task waits and no timer is pending: in real time this would hang for ever."""


class _InstantSelector(selectors.SelectSelector):
    """Never waits: reports readiness of the loop's own pipe at once and turns waiting into the passing of time."""

    loop: "VirtualTimeLoop"

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0)
        if ready or timeout == 0:
            return ready
        self.loop.jump(timeout)
        return []


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """Starts at second 0. `loop.time()` moves only when nothing else is left to do."""

    def __init__(self) -> None:
        self._virtual_now = 0.0
        selector = _InstantSelector()
        selector.loop = self
        super().__init__(selector)
        self._clock_resolution = 1e-9

    def time(self) -> float:
        return self._virtual_now

    def jump(self, timeout: float | None) -> None:
        if timeout is None:
            waiting = [task.get_name() for task in asyncio.all_tasks(self) if not task.done()]
            raise Deadlock(f"all tasks wait and no timer is pending: {', '.join(sorted(waiting))}")
        scheduled = self._scheduled  # type: ignore[attr-defined]
        # The exact instant of the next timer: now + timeout would be off by a rounding.
        self._virtual_now = scheduled[0]._when if scheduled else self._virtual_now + timeout


def run_virtual(main: Coroutine[Any, Any, T]) -> T:
    """`asyncio.run` on a virtual clock. Raises Deadlock where real time would hang."""
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(main)

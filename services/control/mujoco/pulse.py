"""Steps of a physics on loop time, as long as anything moves: a thin shell that knows neither robots nor plans."""

import asyncio
from collections.abc import Awaitable, Callable

from engage_hri.schemas.units import Seconds
from engage_hri.services.runtime.loop import unhurried
from engage_hri.services.runtime.steps import Steps

TICK: Seconds = 0.01
"""Seconds from one command to the servos to the next."""


class Pulse:
    """Calls `step` with the loop time, every `TICK` while it is awake, and then `after`; sleeps when `after` says so.

    step: computes up to an instant; False if there is more to compute. rise: goes on after a sleep. after: looks at
    what has come of a step; True: nothing moves any more.
    """

    def __init__(
        self, *, step: Callable[[Seconds], bool], rise: Callable[[Seconds], None], after: Callable[[Seconds], bool]
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._compute, self._rise, self.after = step, rise, after
        self._is_awake = False
        self._next: asyncio.TimerHandle | None = None
        self.on_step: Callable[[Seconds], None] = lambda at: None
        """Called after each step, for those who look at the physics."""

    def now(self) -> Seconds:
        """Loop time."""
        return self._loop.time()

    def wake(self) -> None:
        """Take steps from now on. A second call changes nothing."""
        if not self._is_awake:
            self._is_awake = True
            self._rise(self.now())
            self._next = self._loop.call_at(self.now() + TICK, self._tick)

    def stop(self) -> None:
        """Take no more steps until it is woken, whatever moves: nobody looks any more."""
        self._is_awake = False
        if self._next is not None:
            self._next.cancel()

    def step(self) -> bool:
        """Compute up to now, between two ticks. False: there is more to compute."""
        return not self._is_awake or self._compute(self.now())

    def in_turns(self, steps: Steps[None]) -> Awaitable[None]:
        """Begin work that goes on between steps of the physics, and whatever else is due."""
        return unhurried(steps)

    def _tick(self) -> None:
        now = self.now()
        is_done = self.step()
        self._is_awake = not self.after(now) or not is_done
        self.on_step(now)
        if self._is_awake:
            self._next = self._loop.call_at(now + TICK if is_done else now, self._tick)

"""A behavior as its body performs it: what the body tells is checked, and what it does not end is broken off."""

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from typing import Self

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Body, DriverBroken, Progress
from engage_hri.services.control.serving.live_behavior import LiveBehavior
from engage_hri.services.control.serving.progress_check import Told
from engage_hri.services.control.serving.words_for_voice import progress_of, spoken
from engage_hri.services.runtime.alarm import Timer

REVOKED_WITHIN: Seconds = 4.0
"""Seconds after which a behavior that was told to end is broken off; before the realizer gives it up."""
BROKEN_OFF_WITHIN: Seconds = 0.5
"""Seconds after that in which a driver may clear away; then its behavior is given up."""


class Performing:
    """A behavior under way.

    is_broken_off: True once its task was cancelled, since its body did not end it.
    """

    def __init__(self, live: LiveBehavior, body: Body, give_up: Callable[[LiveBehavior], None]) -> None:
        """give_up: called for a behavior that its driver goes on with whatever is done."""
        self.is_broken_off = False
        self._live, self._body, self._give_up = live, body, give_up
        self._loop = asyncio.get_running_loop()
        self._behavior = spoken(live.request.behavior)
        self._told = Told(self._behavior, live.authority, self._loop.time())
        self._task: asyncio.Task[object] | None = None
        self._overdue = Timer(self._break_off)
        self._is_over = False
        live.authority.watch(self._note)

    async def progress(self) -> AsyncGenerator[Progress, None]:
        """Tell what the body tells. Raises what it raises, and DriverBroken: what it tells cannot be."""
        self._task = asyncio.current_task()
        async with aclosing(self._body.perform(self._behavior, self._live.authority)) as stream:
            async for progress in stream:
                if self._is_over:
                    return
                if flaw := self._told.flaw(progress, self._loop.time()):
                    raise DriverBroken(self._fault(f"tells {flaw}"))
                yield progress_of(self._live.request.behavior, progress)
        if not self._is_over and (flaw := self._told.missing()):
            raise DriverBroken(self._fault(f"tells {flaw}"))

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        self._end()

    def _end(self) -> None:
        """Take note that it is over: nothing that its body tells counts any more."""
        self._is_over = True
        self._overdue.set(None)

    def _note(self) -> None:
        if self._live.authority.revoked is not None and self._overdue.at is None and not self._is_over:
            self._overdue.set(self._loop.time() + REVOKED_WITHIN)

    def _break_off(self) -> None:
        if not self.is_broken_off and self._task is not None:
            self.is_broken_off = True
            self._live.fault = self._fault(f"goes on {REVOKED_WITHIN:.0f} s after it was told to end it")
            self._overdue.set(self._loop.time() + BROKEN_OFF_WITHIN)
            self._task.cancel()
        else:
            self._end()
            self._give_up(self._live)

    def _fault(self, what: str) -> Fault:
        name = self._body.capabilities.body
        return Fault(reason=f"the body {name} {what}", where=self._live.label, service="control")

"""Keeps the connection to the daemon of a Reachy Mini: loses it once, says why, and finds it again by itself.

A command goes out only as an answer to a measurement. So nothing piles up in front of a daemon that has stopped, and
what it had not read is not carried out when it goes on.
"""

import asyncio
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from typing import Protocol

from msgspec.structs import replace

from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.reachy_mini import messages
from engage_hri.services.control.reachy_mini.messages import Measured

AGAIN: Seconds = 0.5
"""Seconds between two attempts to find the daemon."""
STARVED: Seconds = 0.1
"""A timer that comes so late tells of a process that had no time."""


class Lost(EngageError):
    """The daemon cannot be had, or does not answer any more."""


class Daemon(Protocol):
    """An open connection."""

    async def measurement(self) -> str | bytes:
        """Wait for the next measurement. Raises Lost."""

    async def command(self, text: str) -> None:
        """Send a target. Raises Lost."""


Connect = Callable[[], AbstractAsyncContextManager[Daemon]]


class Link:
    """The connection, kept. trouble: why the robot cannot be moved now; None: it can.

    on_measured: gets each measurement, and returns the command that answers it. on_trouble: gets trouble as it
    begins. on_back: gets the first measurement after the last trouble.
    """

    def __init__(
        self,
        connect: Connect,
        silence: Seconds,
        *,
        on_measured: Callable[[Measured], str | None],
        on_trouble: Callable[[Fault], None],
        on_back: Callable[[Measured], None],
    ) -> None:
        self.trouble: Fault | None = Fault(reason="the daemon is not connected yet", service="control")
        self._connect, self._silence = connect, silence
        self._on_measured, self._on_trouble, self._on_back = on_measured, on_trouble, on_back
        self._is_first = True
        self.has_news = asyncio.Event()
        """Set by the first measurement, and by the first trouble."""

    async def keep(self) -> None:
        """Keep the connection until cancelled."""
        while True:
            try:
                async with self._connect() as daemon:
                    while True:
                        await self._converse(daemon)
            except Lost as lost:
                self._lose(lost.fault)
            await asyncio.sleep(AGAIN)

    async def _converse(self, daemon: Daemon) -> None:
        """Take a measurement, and answer it. Raises Lost."""
        text = await self._heard(daemon)
        try:
            measured = messages.measured(text)
        except ValueError as error:
            raise Lost(Fault(reason=f"the daemon sends what is no measurement: {error}", advice=VERSION)) from error
        if (trouble := _trouble_of(measured)) is not None:
            self._lose(trouble)
            return
        if self.trouble is not None:
            self.trouble = None
            self._is_first = False
            self._on_back(measured)
            self.has_news.set()
        if (command := self._on_measured(measured)) is not None:
            try:
                async with asyncio.timeout(self._silence):
                    await daemon.command(command)
            except TimeoutError:
                raise Lost(silent(self._silence)) from None

    async def _heard(self, daemon: Daemon) -> str | bytes:
        """Wait for the next measurement. Raises Lost after the silence.

        A process that had no time itself knows nothing of a silence: what was sent meanwhile has not been read yet.
        """
        loop = asyncio.get_running_loop()
        for is_last in (False, True):
            until = loop.time() + self._silence
            try:
                async with asyncio.timeout_at(until):
                    return await daemon.measurement()
            except TimeoutError:
                if is_last or loop.time() - until < STARVED:
                    break
        raise Lost(silent(self._silence))

    def _lose(self, fault: Fault) -> None:
        """Tell of trouble, once until it is over."""
        is_news = self.trouble is None or self._is_first
        if is_news:
            self._is_first = False
            self.trouble = replace(fault, where=fault.where or "reachy_mini", service="control")
            self._on_trouble(self.trouble)
            self.has_news.set()


VERSION = "this driver knows the daemon's versions 1.12; see docs/reachy-mini.md"


def silent(seconds: Seconds) -> Fault:
    """The fault of a daemon that sends nothing."""
    reason = f"the daemon has sent no measurement for {seconds:g} s"
    return Fault(reason=reason, advice="it is frozen, or the network is cut; the driver tries again")


def _trouble_of(measured: Measured) -> Fault | None:
    """Trouble that a measurement tells of; None: the robot can be moved."""
    if measured.mode != messages.ENABLED:
        advice = (
            "switch them on, in the vendor's app or by POST /api/motors/set_mode/enabled; the robot then goes home"
        )
        return Fault(reason=f"the motors are {measured.mode.replace('_', ' ')}", advice=advice)
    if not measured.is_possible:
        advice = "its forward kinematics has lost itself, as after a jump of the head: restart it"
        return Fault(reason="the daemon measures a pose that no head can have", advice=advice)
    return None

"""The connection to the daemon of a Reachy Mini: it is lost once, says why, and is found again by itself.

A command goes out only as an answer to a measurement. So nothing piles up in front of a daemon that has stopped, and
what it had not read is not carried out when it goes on.
"""

import asyncio
from abc import abstractmethod
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from math import inf
from typing import Protocol

from msgspec.structs import replace

from engage_hri.schemas.faults import EngageError, Fault, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Body, BodyFailed
from engage_hri.services.control.reachy_mini import messages
from engage_hri.services.control.reachy_mini.messages import Measured
from engage_hri.services.control.reachy_mini.settings import ReachyMiniSettings

AGAIN: Seconds = 0.5
"""Seconds between two attempts to find the daemon."""
STARVED: Seconds = 0.1
"""A timer that comes so late tells of a process that had no time."""
COUNTED = 16
"""Measurements whose mean tells how often they come."""
GAP_THAT_COUNTS: Seconds = 0.5
"""A longer one counts as this: it may be the only one."""
GAP: Seconds = 0.15
"""Mean seconds from one measurement to the next with which one can move."""
VERSION = "this driver knows the daemon's versions 1.12; see docs/reachy-mini.md"


class Lost(EngageError):
    """The daemon cannot be had, or does not answer any more."""


class Daemon(Protocol):
    """An open connection."""

    async def measurement(self) -> str | bytes:
        """Wait for the next measurement. Raises Lost."""

    async def command(self, text: str) -> None:
        """Send a target. Raises Lost."""


Connect = Callable[[ReachyMiniSettings], AbstractAsyncContextManager[Daemon]]


class LinkedBody(Body):
    """A body on a link to the daemon. trouble: why the robot cannot be moved now; None: it can.

    is_linked: somebody uses it; before that, and after it, nothing is told. last_frame: time of the last measurement.
    """

    def __init__(self, settings: ReachyMiniSettings, connect: Connect) -> None:
        self.settings, self._connect = settings, connect
        self.trouble: Fault | None = None
        self.is_linked = False
        self.last_frame: Seconds = -inf
        self._mean: Seconds = 0.0
        self._is_slow = False
        self._has_news = asyncio.Event()
        """Set by the first measurement, and by the first trouble."""

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        self._has_news.clear()
        keeping = asyncio.create_task(self._keep(), name="link to reachy mini")
        keeping.add_done_callback(lambda task: self._has_news.set())
        try:
            await self._has_news.wait()
            if keeping.done():
                keeping.result()
            if self.trouble is not None:
                raise RunFailed(self.trouble)
            self.is_linked = True
            try:
                await self.home()
            except BodyFailed as failed:
                raise RunFailed(failed.fault) from failed
            yield
        finally:
            self.is_linked, self.trouble = False, None
            keeping.cancel()
            await asyncio.gather(keeping, return_exceptions=True)

    @abstractmethod
    def answer(self, measured: Measured) -> str | None:
        """Take a measurement, and answer it with where the joints are to be now; None: where they were sent."""

    @abstractmethod
    def be_back(self, measured: Measured) -> None:
        """Begin anew from where the joints are, and go home from there."""

    @abstractmethod
    def ring(self) -> None:
        """Wake all that wait for measurements."""

    async def _keep(self) -> None:
        """Keep the connection until cancelled."""
        while True:
            try:
                async with self._connect(self.settings) as daemon:
                    while True:
                        await self._converse(daemon)
            except Lost as lost:
                self._lose(lost.fault)
            await asyncio.sleep(AGAIN)

    async def _converse(self, daemon: Daemon) -> None:
        """Take a measurement, and answer it. Raises Lost."""
        text = await _heard(daemon, self.settings.silence)
        try:
            measured = messages.measured(text)
        except ValueError as error:
            raise Lost(Fault(reason=f"the daemon sends what is no measurement: {error}", advice=VERSION)) from error
        if (trouble := _trouble_of(measured)) is not None:
            self._lose(trouble)
            return
        now = asyncio.get_running_loop().time()
        if self.trouble is not None or not self._has_news.is_set():
            self.trouble, self.last_frame, self._mean, self._is_slow = None, now, 0.0, False
            if self.is_linked:
                self.on_recovery("reachy_mini: it can be moved again, and goes home")
            self.be_back(measured)
            self._has_news.set()
        self._count(now - self.last_frame)
        command, self.last_frame = self.answer(measured), now
        self.ring()
        if command is not None:
            try:
                async with asyncio.timeout(self.settings.silence):
                    await daemon.command(command)
            except TimeoutError:
                raise Lost(_silent(self.settings.silence)) from None

    def _count(self, gap: Seconds) -> None:
        """Tell of measurements that have become too few, or enough. One long gap alone is no slow stream."""
        self._mean += (min(gap, GAP_THAT_COUNTS) - self._mean) / COUNTED
        was_slow, self._is_slow = self._is_slow, self._mean > GAP / (1.5 if self._is_slow else 1.0)
        if self._is_slow and not was_slow:
            often = f"the daemon sends {1.0 / self._mean:.1f} measurements a second"
            reason = f"{often}: the robot moves by fits and starts, and late"
            advice = f"it takes {1.0 / GAP:.0f}; is the network slow, or the daemon's machine busy?"
            self.on_fault(Fault(reason=reason, where="reachy_mini", advice=advice, service="control"))
        elif was_slow and not self._is_slow:
            self.on_recovery("reachy_mini: the daemon sends enough measurements again")

    def _lose(self, fault: Fault) -> None:
        """Tell of trouble, once until it is over."""
        if self.trouble is None:
            self.trouble = replace(fault, where=fault.where or "reachy_mini", service="control")
            if self.is_linked:
                self.on_fault(self.trouble)
            self.ring()
            self._has_news.set()


async def _heard(daemon: Daemon, silence: Seconds) -> str | bytes:
    """Wait for the next measurement. Raises Lost after the silence.

    A process that had no time itself knows nothing of a silence: what was sent meanwhile has not been read yet.
    """
    loop = asyncio.get_running_loop()
    for is_last in (False, True):
        until = loop.time() + silence
        try:
            async with asyncio.timeout_at(until):
                return await daemon.measurement()
        except TimeoutError:
            if is_last or loop.time() - until < STARVED:
                break
    raise Lost(_silent(silence))


def _silent(seconds: Seconds) -> Fault:
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

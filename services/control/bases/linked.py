"""A body behind a connection: it answers each measurement, and finds a connection that is lost again.

Many robots have a computer of their own that tells where the joints are, again and again, and takes targets.

What goes wrong without it:

- Targets that are sent by a timer pile up in front of a computer that has stopped, and it carries them all out when
  it goes on. So a command goes out only as an answer to a measurement.
- A robot that is switched off, or out of the network, is no reason to end. Its trouble is told once, behaviors fail
  with it, and when it is back the body goes home from where its joints are.
- A process that had no time itself knows nothing of a silence: what was sent meanwhile has not been read yet.
- Measurements that come seldom make the robot jerk. That is told once, too, until enough of them come.
"""

import asyncio
from abc import abstractmethod
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from math import inf
from typing import ClassVar, Generic, Protocol, TypeVar

from msgspec.structs import replace

from engage_hri.schemas.faults import EngageError, Fault, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Body, BodyFailed

AGAIN: Seconds = 0.5
"""Seconds between two attempts to connect."""
STARVED: Seconds = 0.1
"""A timer that comes so late tells of a process that had no time."""
COUNTED = 16
"""Measurements whose mean tells how often they come."""
GAP_THAT_COUNTS: Seconds = 0.5
"""A longer one counts as this: it may be the only one."""
GAP: Seconds = 0.15
"""Mean seconds from one measurement to the next with which one can move."""


class Lost(EngageError):
    """The robot cannot be had, or does not answer any more."""


class Link(Protocol):
    """An open connection."""

    async def measurement(self) -> str | bytes:
        """Wait for the next measurement. Raises Lost."""

    async def command(self, text: str) -> None:
        """Send a target. Raises Lost."""


Connect = Callable[[], AbstractAsyncContextManager[Link]]
M = TypeVar("M")


class LinkedBody(Body, Generic[M]):
    """A body on a link. M: a measurement. trouble: why the robot cannot be moved now; None: it can.

    is_linked: somebody uses it; before that, and after it, nothing is told. last_frame: time of the last measurement.
    """

    name: ClassVar[str]
    """The name of the body in what is told of it."""
    peer: ClassVar[str]
    """What sends the measurements, in what is told of it: "the daemon"."""

    def __init__(self, connect: Connect, silence: Seconds) -> None:
        """connect: opens a connection. silence: a link is lost when nothing has come for so long."""
        self._connect, self._silence = connect, silence
        self.trouble: Fault | None = None
        self.is_linked = False
        self.last_frame: Seconds = -inf
        self._mean: Seconds = 0.0
        self._is_slow = False
        self._has_news = asyncio.Event()
        """Set by the first measurement, and by the first trouble."""

    # -- what a body says ---------------------------------------------------------------------------------------

    @abstractmethod
    def read(self, text: str | bytes) -> M:
        """Read a measurement. Raises Lost: it is none."""

    @abstractmethod
    def trouble_of(self, measured: M) -> Fault | None:
        """Tell why a robot that measures this cannot be moved; None: it can."""

    @abstractmethod
    def answer(self, measured: M) -> str | None:
        """Take a measurement, and answer it with where the joints are to be now; None: where they were sent."""

    @abstractmethod
    def be_back(self, measured: M) -> None:
        """Begin anew from where the joints are, and go home from there."""

    @abstractmethod
    def ring(self) -> None:
        """Wake all that wait for measurements."""

    # -- the link -----------------------------------------------------------------------------------------------

    @asynccontextmanager
    async def connected(self) -> AsyncIterator[None]:
        self._has_news.clear()
        keeping = asyncio.create_task(self._keep(), name=f"link to {self.name}")
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

    async def _keep(self) -> None:
        """Keep the connection until cancelled."""
        while True:
            try:
                async with self._connect() as link:
                    while True:
                        await self._converse(link)
            except Lost as lost:
                self._lose(lost.fault)
            await asyncio.sleep(AGAIN)

    async def _converse(self, link: Link) -> None:
        """Take a measurement, and answer it. Raises Lost."""
        measured = self.read(await self._heard(link))
        if (trouble := self.trouble_of(measured)) is not None:
            self._lose(trouble)
            return
        now = asyncio.get_running_loop().time()
        if self.trouble is not None or not self._has_news.is_set():
            self.trouble, self.last_frame, self._mean, self._is_slow = None, now, 0.0, False
            if self.is_linked:
                self.on_recovery(f"{self.name}: it can be moved again, and goes home")
            self.be_back(measured)
            self._has_news.set()
        self._count(now - self.last_frame)
        command, self.last_frame = self.answer(measured), now
        self.ring()
        if command is not None:
            try:
                async with asyncio.timeout(self._silence):
                    await link.command(command)
            except TimeoutError:
                raise Lost(self._silent()) from None

    async def _heard(self, link: Link) -> str | bytes:
        """Wait for the next measurement. Raises Lost after the silence, unless this process had no time itself."""
        loop = asyncio.get_running_loop()
        for is_last in (False, True):
            until = loop.time() + self._silence
            try:
                async with asyncio.timeout_at(until):
                    return await link.measurement()
            except TimeoutError:
                if is_last or loop.time() - until < STARVED:
                    break
        raise Lost(self._silent())

    def _silent(self) -> Fault:
        reason = f"{self.peer} has sent no measurement for {self._silence:g} s"
        return Fault(reason=reason, advice="it is frozen, or the network is cut; the driver tries again")

    def _count(self, gap: Seconds) -> None:
        """Tell of measurements that have become too few, or enough. One long gap alone is no slow stream."""
        self._mean += (min(gap, GAP_THAT_COUNTS) - self._mean) / COUNTED
        was_slow, self._is_slow = self._is_slow, self._mean > GAP / (1.5 if self._is_slow else 1.0)
        if self._is_slow and not was_slow:
            often = f"{self.peer} sends {1.0 / self._mean:.1f} measurements a second"
            reason = f"{often}: the robot moves by fits and starts, and late"
            advice = f"it takes {1.0 / GAP:.0f}; is the network slow, or the machine of {self.peer} busy?"
            self.on_fault(Fault(reason=reason, where=self.name, advice=advice, service="control"))
        elif was_slow and not self._is_slow:
            self.on_recovery(f"{self.name}: {self.peer} sends enough measurements again")

    def _lose(self, fault: Fault) -> None:
        """Tell of trouble, once until it is over."""
        if self.trouble is None:
            self.trouble = replace(fault, where=fault.where or self.name, service="control")
            if self.is_linked:
                self.on_fault(self.trouble)
            self.ring()
            self._has_news.set()

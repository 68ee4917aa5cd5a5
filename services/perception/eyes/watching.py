"""A source of landmarks at work for the service: in a process of its own, or in this one where time is virtual.

    python -m engage_hri.services.perception.eyes.watching

is that process, for eyes; each sense that sees has such a module of its own. It is told which source to open, and
then of each picture that the service has taken: a film waits for that, a camera goes on with the newest. What a
driver of a camera blocks, blocks there.
"""

import asyncio
import os
import sys
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import AsyncGenerator
from select import select
from typing import Any, NamedTuple

import msgspec
from msgspec.structs import replace

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.perception import FaceLandmarks
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.perception.child import (
    PackedMessages,
    PipedProcess,
    answering,
    next_message,
    packed_message,
)
from engage_hri.services.perception.eyes.looking import SourceSettings
from engage_hri.services.perception.offered import make_offered
from engage_hri.services.runtime.installation import LANDMARKS

OPENING: Seconds = 30.0
"""Time in which a source has to be open: models are loaded, devices wake up."""
SILENT: Seconds = 1.5
"""Time without a picture after which a device is taken for dead."""
AHEAD = 4
"""Pictures that a source may look at before the service has taken them."""


class SourceLost(EngageError):
    """No more comes from a device. The fault says why."""


class SourceKind(NamedTuple):
    """Sources of one sense. group: of their entry points. settings, told: types of their settings, and of what they
    tell of a picture, a message with its instant (`at`). process: module that is run for one. setting: its name is
    said where the source is wrong."""

    group: str
    settings: type
    told: type
    process: str
    setting: str


FACES = SourceKind(
    LANDMARKS, SourceSettings, FaceLandmarks, "engage_hri.services.perception.eyes.watching", "eyes.source"
)
"""Sources of landmarks."""


class SourceOrder(msgspec.Struct, frozen=True, tag=True):
    """The first order: the source to open. name: that of its offer. settings: those of its kind."""

    name: str
    settings: Any


class PictureTaken(msgspec.Struct, frozen=True, tag=True):
    """Order: one more picture may be looked at."""


class SourceOpened(msgspec.Struct, frozen=True, tag=True):
    """Answer to the order."""

    is_live: bool


class SourceEnded(msgspec.Struct, frozen=True, tag=True):
    """Last answer. fault: why; None: the film is over. is_refused: it cannot be opened here at all."""

    fault: Fault | None = None
    is_refused: bool = False


def opened(order: SourceOrder, kind: SourceKind) -> Any:
    """Find a source, import it and open it. Raises InputRefused, and what a device raises."""
    settings: Any = msgspec.convert(order.settings, kind.settings, from_attributes=True)
    return make_offered(kind.group, "source", order.name, settings, kind.setting)


class Watching(ABC):
    """A source that can be watched, again when it was lost."""

    @abstractmethod
    def watch(self) -> AsyncGenerator[Any, None]:
        """Watch it from now on: None once it is open, then what it tells, by the clock of the loop.

        Raises InputRefused: it cannot be opened here; SourceLost: a device gives no picture, and may again.
        """


class InsideWatching(Watching):
    """A source that stops the loop while it looks: in virtual time that is no time."""

    def __init__(self, order: SourceOrder, kind: SourceKind = FACES) -> None:
        self._order, self._kind = order, kind

    async def watch(self) -> AsyncGenerator[Any, None]:
        source = opened(self._order, self._kind)
        yield None
        begin = asyncio.get_running_loop().time()
        for told in source.look():
            yield await _in_time(told, begin)


class OutsideWatching(Watching):
    """A source in its own process."""

    def __init__(self, order: SourceOrder, kind: SourceKind = FACES) -> None:
        self._order, self._kind = order, kind
        self._answers: _Answers | None = None

    def kill(self) -> None:
        """Let the process end as if the system had ended it, for a check of what follows."""
        if self._answers is not None:
            self._answers.kill()

    async def watch(self) -> AsyncGenerator[Any, None]:
        answers = self._answers = _Answers(self._order, self._kind)
        try:
            answer = await answers.next(OPENING)
            if isinstance(answer, SourceEnded):
                fault = answer.fault or Fault(reason="nothing is in it", where=self._kind.setting)
                raise InputRefused(fault) if answer.is_refused else SourceLost(fault)
            is_live = isinstance(answer, SourceOpened) and answer.is_live
            yield None
            begin = asyncio.get_running_loop().time()
            while isinstance(answer := await answers.next(SILENT if is_live else OPENING), self._kind.told):
                yield answer if is_live else await _in_time(answer, begin)
                answers.take_more()
            if isinstance(answer, SourceEnded) and answer.fault is not None:
                raise SourceLost(answer.fault)
        finally:
            answers.close()


class _Answers:
    """Answers of the process of a source, in order."""

    def __init__(self, order: SourceOrder, kind: SourceKind) -> None:
        self._name, self._setting = order.name, kind.setting
        self._waiting, self._news = deque[Any](), asyncio.Event()
        self._messages = PackedMessages(SourceOpened | kind.told | SourceEnded)
        command = (sys.executable, "-m", kind.process)
        self._child = PipedProcess(command, self._take, self._end)
        self._child.write(packed_message(order))
        for _ in range(AHEAD):
            self.take_more()

    async def next(self, patience: Seconds) -> Any:
        """Wait for the next answer. Raises SourceLost."""
        while not self._waiting:
            self._news.clear()
            try:
                async with asyncio.timeout(patience):
                    await self._news.wait()
            except TimeoutError:
                raise SourceLost(self._fault(f"gives no picture for {patience:g} s")) from None
        return self._waiting.popleft()

    def take_more(self) -> None:
        """Let it look at one more picture."""
        self._child.write(packed_message(PictureTaken()))

    def kill(self) -> None:
        """End the process as the system would."""
        self._child.kill()

    def close(self) -> None:
        """End the process."""
        self._child.close()

    def _take(self, more: bytes) -> None:
        self._waiting.extend(self._messages.take(more))
        self._news.set()

    def _end(self, how: str) -> None:
        self._waiting.append(SourceEnded(self._fault(how)))
        self._news.set()

    def _fault(self, how: str) -> Fault:
        advice = "is it plugged in, and allowed? eyes try again"
        return Fault(reason=f"the source {self._name} {how}", where=self._setting, advice=advice)


async def _in_time(told: Any, begin: Seconds) -> Any:
    """Wait for the instant of what is played, on the clock of the loop."""
    at = begin + told.at.seconds
    await asyncio.sleep(at - asyncio.get_running_loop().time())
    return replace(told, at=Stamp("", at))


# -- its process ---------------------------------------------------------------------------------------------------


def main(kind: SourceKind) -> None:
    """Look at pictures until they end, or standard input does."""
    answer, orders = answering(), os.fdopen(0, "rb", buffering=0)  # what a buffer holds `select` does not see
    order = next_message(orders, SourceOrder)
    try:
        source = opened(order, kind)
        answer(SourceOpened(source.is_live))
        may = 0
        for told in source.look():
            while select([orders], [], [], 0)[0] or (may == 0 and not source.is_live):
                if next_message(orders, PictureTaken) is None:
                    return
                may += 1
            if may:  # else the service is late, and this picture nobody's
                may -= 1
                answer(told)
    except EngageError as error:
        answer(SourceEnded(error.fault, isinstance(error, InputRefused)))
    except Exception as error:  # whatever a driver raises
        answer(SourceEnded(Fault(reason=f"the source {order.name} fails: {type(error).__name__}: {error}")))
    else:
        answer(SourceEnded())


if __name__ == "__main__":
    main(FACES)

"""A recognizer or detector of turns at work for the service: in a process of its own, or in this one in virtual time.

    python -m engage_hri.services.perception.hearing.listening

is that process: orders in on standard input, answers out on standard output. It ends with its standard input.
Recognizers take seconds, need much memory, and some crash: hearing goes on.
"""

import asyncio
import sys
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from typing import Any, ClassVar

import msgspec

from engage_hri.schemas.faults import EngageError, Fault, InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.perception.child import (
    PackedMessages,
    PipedProcess,
    answering,
    next_message,
    packed_message,
)
from engage_hri.services.perception.hearing.recognizing import (
    Answer,
    Desk,
    NotUnderstood,
    RecognizerSettings,
    SpeechOrder,
    SpeechRecognizer,
)
from engage_hri.services.perception.hearing.turn_detectors import DetectorAtDesk, TurnDetectorSettings
from engage_hri.services.perception.offered import make_offered
from engage_hri.services.runtime.installation import RECOGNIZERS, TURN_DETECTORS

MAKING: Seconds = 120.0
"""Time in which a recognizer has to be there: it may have a large model to load."""
LIMIT: Seconds = 20.0
"""Time from the end of a speech within which its words have to be known."""
MOST_UNREAD = 4 * 2**20
"""Bytes of sound that may wait for a recognizer: two minutes. One that is so slow never catches up."""

OnAnswer = Callable[[Answer], None]


class HelperOrder(msgspec.Struct, frozen=True):
    """The first order: what to make. name: that of its offer. settings: what it is made of.

    GROUP: entry points among which it is. KIND: what it is, in words. WHERE: the setting that names it.
    """

    GROUP: ClassVar[str]
    KIND: ClassVar[str]
    WHERE: ClassVar[str]
    name: str
    settings: Any

    @property
    def what(self) -> str:
        return f"the {self.KIND} {self.name}"

    def made(self) -> SpeechRecognizer:
        """Find it, import it and make it. Raises InputRefused."""
        made: SpeechRecognizer = make_offered(self.GROUP, self.KIND, self.name, self.settings, self.WHERE)
        return made

    def desk(self) -> Desk:
        """Make it, and give it a desk. Raises InputRefused."""
        return Desk(self.made(), f"the {self.KIND}")


class Order(HelperOrder, frozen=True, tag=True):
    """Order of a recognizer."""

    GROUP, KIND, WHERE = RECOGNIZERS, "recognizer", "hearing.recognizer"
    settings: RecognizerSettings


class DetectorOrder(HelperOrder, frozen=True, tag=True):
    """Order of a detector of turns."""

    GROUP, KIND, WHERE = TURN_DETECTORS, "turn detector", "hearing.turn_detector"
    settings: TurnDetectorSettings

    def made(self) -> SpeechRecognizer:
        made: Any = HelperOrder.made(self)
        return DetectorAtDesk(made)


class Made(msgspec.Struct, frozen=True, tag=True):
    """The answer to it. fault: why there is none."""

    fault: Fault | None = None


class Understanding(ABC):
    """A recognizer at work. Each speech gets one last answer: final words, or a failure."""

    @abstractmethod
    async def made(self) -> None:
        """Wait until the recognizer is there. Raises InputRefused: it cannot be made."""

    @abstractmethod
    def hear(self, speech: int, samples: bytes) -> None:
        """Let it have more sound of a speech. samples: empty: it is over."""

    @abstractmethod
    def close(self) -> None:
        """End it."""


class InThisProcess(Understanding):
    """A recognizer that stops the loop while it thinks: in virtual time that is no time."""

    def __init__(self, order: Order | DetectorOrder, on_answer: OnAnswer) -> None:
        self._order, self._on_answer = order, on_answer
        self._desk: Desk | None = None

    async def made(self) -> None:
        self._desk = self._order.desk()

    def hear(self, speech: int, samples: bytes) -> None:
        assert self._desk is not None
        for answer in self._desk.take(SpeechOrder(speech, samples)):
            self._on_answer(answer)

    def close(self) -> None:
        self._desk = None


class InItsOwn(Understanding):
    """A recognizer in its own process. When that is lost, the speeches that it has not answered have failed, and the
    next speech starts another one. What is said while it loads its model is kept for it, each speech for `LIMIT`."""

    def __init__(self, order: Order | DetectorOrder, on_answer: OnAnswer) -> None:
        self._order, self._on_answer = order, on_answer
        self._loop = asyncio.get_running_loop()
        self._child: PipedProcess | None = None
        self._loading: asyncio.TimerHandle | None = None
        """Time that is left to one that is not there yet; None: it is, or there is none."""
        self._kept: list[SpeechOrder] = []
        """Orders that wait until it is there."""
        self._answers = PackedMessages(Made | Answer)
        self._made: asyncio.Future[None] = self._loop.create_future()
        self._open: dict[int, asyncio.TimerHandle | None] = {}
        """Speeches without a last answer, and from their ends on the time that is left."""
        self._failed: deque[int] = deque(maxlen=64)
        """Speeches that have failed while they went on: what more is heard of them is for nobody."""

    async def made(self) -> None:
        self._start()
        await asyncio.shield(self._made)

    def hear(self, speech: int, samples: bytes) -> None:
        if speech in self._failed:
            return
        if self._child is None:
            self._start()
        if self._child is None:
            return
        self._open.setdefault(speech, None)
        self._give(SpeechOrder(speech, samples))
        if not samples:
            self._open[speech] = self._loop.call_later(LIMIT, self._overdue, speech)
        elif self._child.unsent > MOST_UNREAD:
            self._lose("is too slow for speech")

    def close(self) -> None:
        if self._child is not None:
            self._child.close()
            self._child = None
        for timer in (self._loading, *self._open.values()):
            if timer is not None:
                timer.cancel()
        self._loading = None
        self._kept.clear()
        self._open.clear()

    def _give(self, order: SpeechOrder) -> None:
        """Send an order, or keep it until the recognizer is there."""
        if self._loading is not None:
            self._kept.append(order)
        elif self._child is not None:
            self._child.write(packed_message(order))

    def _overdue(self, speech: int) -> None:
        """Give up a speech for which it has had time enough, and the recognizer as well, if that has had it."""
        if self._loading is None:
            self._lose(f"does not answer for {LIMIT:g} s")
            return
        del self._open[speech]
        self._kept = [order for order in self._kept if order.speech != speech]
        self._fail(speech, self._fault("begins anew, and is not there yet"))

    def _fail(self, speech: int, fault: Fault) -> None:
        self._failed.append(speech)
        self._on_answer(NotUnderstood(speech, fault))

    def _fault(self, how: str) -> Fault:
        return Fault(reason=f"{self._order.what} {how}", where=self._order.WHERE)

    def _start(self) -> None:
        self._answers = PackedMessages(Made | Answer)
        command = [sys.executable, "-m", "engage_hri.services.perception.hearing.listening"]
        self._child = PipedProcess(command, self._take, self._lose)
        self._child.write(packed_message(self._order))
        self._loading = self._loop.call_later(MAKING, self._lose, f"is not there after {MAKING:g} s")

    def _loaded(self) -> None:
        """Let it have what was said meanwhile: its time begins now."""
        assert self._loading is not None
        self._loading.cancel()
        self._loading, kept, self._kept = None, self._kept, []
        for order in kept:
            self._give(order)
        for speech, timer in self._open.items():
            if timer is not None:
                timer.cancel()
                self._open[speech] = self._loop.call_later(LIMIT, self._overdue, speech)
        if not self._made.done():
            self._made.set_result(None)

    def _take(self, more: bytes) -> None:
        for answer in self._answers.take(more):
            self._answered(answer)

    def _answered(self, answer: Made | Answer) -> None:
        if isinstance(answer, Made):
            if answer.fault is not None:
                self._lose("cannot be made", answer.fault)
            else:
                self._loaded()
            return
        if isinstance(answer, NotUnderstood) or answer.final:
            timer = self._open.pop(answer.speech, None)
            if timer is not None:
                timer.cancel()
            elif isinstance(answer, NotUnderstood) and self._child is not None:  # given up while it went on
                self._failed.append(answer.speech)
                self._child.write(packed_message(SpeechOrder(answer.speech, b"")))
        self._on_answer(answer)

    def _lose(self, how: str, fault: Fault | None = None) -> None:
        fault = fault or self._fault(how)
        lost = tuple(self._open)
        self.close()
        if not self._made.done():
            self._made.set_exception(InputRefused(fault))
        for speech in lost:
            self._fail(speech, fault)


# -- its process ---------------------------------------------------------------------------------------------------


def main() -> None:
    """Serve until standard input ends."""
    answer = answering()
    order = next_message(sys.stdin.buffer, Order | DetectorOrder)
    try:
        desk = order.desk()
    except Exception as error:
        reason = f"{order.what} cannot be made: {type(error).__name__}: {error}"
        answer(Made(error.fault if isinstance(error, EngageError) else Fault(reason=reason)))
        return
    answer(Made())
    while (sound := next_message(sys.stdin.buffer, SpeechOrder)) is not None:
        for each in desk.take(sound):
            answer(each)


if __name__ == "__main__":
    main()

"""The synthesizer in its own process, as the body sees it: phrases are asked for, and kept when they are there.

Where time is real the loop does not stand still for them: before a new text is estimated, a tenth of a second may go
by, in which other work goes on. What is not there by then comes later; whoever needs it waits for it.
"""

import asyncio
import os
import select
import subprocess
import sys
import time
import weakref
from collections import OrderedDict
from collections.abc import Sequence
from contextlib import suppress
from typing import NamedTuple

import msgspec

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.voice.clauses import Clause
from engage_hri.services.control.voice.synthesis import Phrase, SynthesisFailed, Synthesizer
from engage_hri.services.control.voice.worker import HEAD, Answer, Failed, Made, Order, Spoken, packed
from engage_hri.services.control.waiting import Bell

LARGEST = 64 * 2**20
"""Bytes of sound that are kept: some 25 minutes."""
LONGEST: Seconds = 30.0
"""Seconds after which a synthesizer that does not answer is ended."""
_STEP = 65536


class _Asked(NamedTuple):
    """The phrase that the process works on. phrase: None: the synthesizer is being made.

    at: since when, on the clock.
    """

    phrase: Phrase | None
    at: Seconds


class Studio:
    """A synthesizer in a process of its own. It is started when it is first asked, and ends with this object.

    rate: samples per second; 0: not known yet.
    """

    def __init__(self, synthesizer: type[Synthesizer], settings: msgspec.Struct | None) -> None:
        module = sys.modules.get(synthesizer.__module__)
        self._order = Order(
            synthesizer.__module__,
            synthesizer.__qualname__,
            os.path.abspath(getattr(module, "__file__", None) or ""),
            b"" if settings is None else msgspec.json.encode(settings),
        )
        self.rate = 0
        self._known: OrderedDict[Phrase, Clause | Fault] = OrderedDict()
        self._size = 0
        self._line: OrderedDict[Phrase, None] = OrderedDict()
        self._asked: _Asked | None = None
        self._broken: Fault | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._end: weakref.finalize[..., Studio] | None = None
        self._buffer = bytearray()
        self._bells: list[Bell] = []
        self._listens: asyncio.AbstractEventLoop | None = None

    def known(self, phrase: Phrase) -> Clause | None:
        """The sound of a phrase, if it is there. Raises SynthesisFailed: it cannot be said."""
        found = self._known.get(phrase)
        if isinstance(found, Fault):
            raise SynthesisFailed(found)
        if found is not None:
            self._known.move_to_end(phrase)
        return found

    async def asked(self, phrases: Sequence[Phrase], patience: Seconds) -> None:
        """Wait until phrases are there, or for as long as `patience`. What the process says is heard (`listen`)."""
        bell = Bell()
        self._bells.append(bell)
        deadline = bell.now() + patience
        try:
            while not self.ask(phrases, 0.0) and bell.now() < deadline:
                await bell.wait(deadline)
        finally:
            self._bells.remove(bell)

    def ask(self, phrases: Sequence[Phrase], wait: Seconds) -> bool:
        """Ask for phrases to be synthesized, in this order, and wait until they are there or the time is over.

        phrases: those that are known cost nothing. wait: seconds by the clock, in which the loop stands still.

        Returns whether all are there.
        """
        self._line.update(dict.fromkeys(phrase for phrase in phrases if phrase not in self._known))
        deadline = time.monotonic() + wait
        while True:
            self._go_on()
            if all(phrase in self._known for phrase in phrases):
                return True
            left = deadline - time.monotonic()
            if left <= 0.0 or self._process is None or self._process.stdout is None:
                return False
            select.select([self._process.stdout], [], [], min(left, 1.0))

    def make(self, wait: Seconds) -> bool:
        """Start the process, and wait until the synthesizer is there or the time is over. Raises SynthesisFailed."""
        deadline = time.monotonic() + wait
        while not self.rate:
            self._go_on()
            if self._broken is not None:
                raise SynthesisFailed(self._broken)
            left = deadline - time.monotonic()
            if self.rate or left <= 0.0 or self._process is None or self._process.stdout is None:
                break
            select.select([self._process.stdout], [], [], min(left, 1.0))
        return bool(self.rate)

    async def made(self) -> None:
        """Wait until the synthesizer is there. Raises SynthesisFailed."""
        bell = Bell()
        self._bells.append(bell)
        try:
            while not self.make(0.0):
                await bell.wait(bell.now() + 1.0)
        finally:
            self._bells.remove(bell)

    def listen(self, loop: asyncio.AbstractEventLoop) -> None:
        """Take answers as they come, while the loop runs; only where its time is real."""
        self._listens = loop
        if self._process is not None and self._process.stdout is not None:
            loop.add_reader(self._process.stdout.fileno(), self._go_on)

    def watch(self, bell: Bell) -> None:
        """Ring a bell at each answer, until `unwatch`."""
        self._bells.append(bell)

    def unwatch(self, bell: Bell) -> None:
        """Ring it no more."""
        self._bells.remove(bell)

    def close(self) -> None:
        """End the process. Asking starts it again."""
        process, self._process = self._process, None
        if process is not None and process.stdout is not None and self._listens is not None:
            with suppress(RuntimeError):  # the loop is closed
                self._listens.remove_reader(process.stdout.fileno())
        self.rate, self._asked, self._buffer = 0, None, bytearray()
        if self._end is not None:
            self._end()

    # -- the process --------------------------------------------------------------------------------------------

    def _go_on(self) -> None:
        """Take what has come, and ask for the next phrase."""
        self._take()
        if self._asked is not None and time.monotonic() - self._asked.at > LONGEST:
            self._lose(f"the synthesizer does not answer for {LONGEST:.0f} s")
        while self._line and next(iter(self._line)) in self._known:
            self._line.popitem(last=False)
        if self._process is None and self._broken is None:
            self._start()
        if self.rate and self._asked is None and self._line:
            self._send(next(iter(self._line)))

    def _start(self) -> None:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        self._process = process = subprocess.Popen(
            [sys.executable, "-m", "engage_hri.services.control.voice.worker"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, bufsize=0,
        )  # fmt: skip
        self._end = weakref.finalize(self, _ended, process)
        assert process.stdout is not None
        os.set_blocking(process.stdout.fileno(), False)
        if self._listens is not None:
            self._listens.add_reader(process.stdout.fileno(), self._go_on)
        self._asked = _Asked(None, time.monotonic())
        self._write(packed(self._order))

    def _send(self, phrase: Phrase) -> None:
        self._asked = _Asked(phrase, time.monotonic())
        self._write(packed(phrase))

    def _write(self, message: bytes) -> None:
        assert self._process is not None
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(message)
        except OSError:
            self._lose("the synthesizer has ended")

    def _take(self) -> None:
        if self._process is None or self._process.stdout is None:
            return
        while True:
            try:
                more = os.read(self._process.stdout.fileno(), _STEP)
            except BlockingIOError:
                break
            if not more:
                code = self._process.poll()
                self._lose(f"the synthesizer has ended{'' if code is None else f' with code {code}'}")
                return
            self._buffer += more
        while len(self._buffer) >= HEAD and len(self._buffer) >= HEAD + (size := _size(self._buffer)):
            content = bytes(self._buffer[HEAD : HEAD + size])
            del self._buffer[: HEAD + size]
            self._answered(msgspec.msgpack.decode(content, type=Answer))

    def _answered(self, answer: Answer) -> None:
        asked, self._asked = self._asked, None
        phrase = asked.phrase if asked is not None else None
        match answer:
            case Made(rate):
                self.rate = rate
            case Failed(fault) if phrase is None:
                self._fail(fault)
            case Failed(fault) if phrase is not None:
                self._keep(phrase, fault)
            case Spoken(clause) if phrase is not None:
                self._keep(phrase, clause)
        for bell in self._bells:
            bell.ring()

    def _keep(self, phrase: Phrase, result: Clause | Fault) -> None:
        self._known[phrase] = result
        self._line.pop(phrase, None)
        self._size += _bytes(result)
        while self._size > LARGEST and len(self._known) > 1:
            self._size -= _bytes(self._known.popitem(last=False)[1])

    def _lose(self, reason: str) -> None:
        """The process is gone or is not to be trusted.

        What it was asked is not asked again; another one is started.
        """
        asked = self._asked
        self.close()
        fault = Fault(reason=reason, service="control")
        if asked is not None and asked.phrase is not None:
            self._keep(asked.phrase, Fault(reason=f"{reason}, at this text", service="control"))
        elif asked is not None:
            self._fail(fault)
        for bell in self._bells:
            bell.ring()

    def _fail(self, fault: Fault) -> None:
        self._broken = fault
        for phrase in self._line:
            self._known[phrase] = fault
        self._line.clear()


def _size(buffer: bytearray) -> int:
    return int.from_bytes(buffer[:HEAD], "little")


def _bytes(result: Clause | Fault) -> int:
    return len(result.samples) + 500 if isinstance(result, Clause) else 500


def _ended(process: "subprocess.Popen[bytes]") -> None:
    """End a process: it holds nothing that is worth waiting for."""
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()
    process.kill()
    process.wait()

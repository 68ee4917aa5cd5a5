"""The synthesizer in its own process, as the body sees it: phrases are asked for, and kept when they are there.

Where time is real the loop does not stand still for them: before a new text is estimated, a tenth of a second may go
by, in which other work goes on. What is not there by then comes later; whoever needs it waits for it.

Engines freeze, and die of odd texts. One that is waited for without end stands for all texts after it, one that is
started again at once dies again at once, and a text that is refused for ever may have died of something else. So the
process goes from state to state, and `_go_on` is the only place that moves it, whenever something may have come: a
question, an answer, the end of the time that it has.

    no process ──> being made ──Made──> idle ──a phrase──> saying ──its sound, or a refusal──> idle
        ^              │                                     │
        ├──── lost: it has ended, or has not answered in time ┘  (`_lose`; `on_fault` is told)
        └── 60 s ── broken: the synthesizer cannot be made, or was lost twice at that; all is refused

A text at which it died is tried once more at once; what fails a second time is refused for a minute (`_Refused`). One
at which it froze is refused for a second at once: whoever waits for it has waited long enough.
"""

import asyncio
import os
import select
import subprocess
import sys
import time
import weakref
from collections import OrderedDict
from collections.abc import Callable, Sequence
from contextlib import suppress
from math import inf
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.control.contract.body import Bell
from engage_hri.services.control.voice.clauses import Clause
from engage_hri.services.control.voice.synthesis import Phrase, SynthesisFailed, Synthesizer
from engage_hri.services.control.voice.worker import HEAD, Answer, Failed, Made, Order, Spoken, packed

LARGEST = 64 * 2**20
"""Bytes of sound that are kept: some 25 minutes."""
LIMIT: Seconds = 5.0
"""Seconds that one phrase may take; see `VoiceSettings.phrase_limit`."""
MAKING: Seconds = 30.0
"""Seconds that a synthesizer may take until it is made: it may have a model to load."""
AGAIN: Seconds = 60.0
"""Seconds for which a text is refused that could not be said, before it is tried again."""
NEWS: Seconds = 1.0
"""Seconds for which a text is refused at which a synthesizer froze once: whoever waits for it is to hear of it."""
MOST_DEATHS = 1000
"""Texts of which it is remembered that a process died at them."""
_STEP = 65536


class _Asked(NamedTuple):
    """The phrase that the process works on. phrase: None: the synthesizer is being made.

    at: since when, on the clock.
    """

    phrase: Phrase | None
    at: Seconds


class _Refused(NamedTuple):
    """The refusal of a phrase. until: on the clock; from then on it is tried again when asked."""

    fault: Fault
    until: Seconds


class Studio:
    """A synthesizer in a process of its own. It is started when it is first asked, and ends with this object.

    rate: samples per second; 0: not known yet. on_fault: called when the process is lost.
    """

    def __init__(
        self, synthesizer: type[Synthesizer], settings: msgspec.Struct | None, limit: Seconds = LIMIT
    ) -> None:
        """Start nothing yet. settings: of the synthesizer; None: it takes none. limit: seconds for one phrase."""
        module = sys.modules.get(synthesizer.__module__)
        self._order = Order(
            synthesizer.__module__,
            synthesizer.__qualname__,
            os.path.abspath(getattr(module, "__file__", None) or ""),
            b"" if settings is None else msgspec.json.encode(settings),
        )
        self.rate = 0
        self.on_fault: Callable[[Fault], None] = lambda fault: None
        self._limit = limit
        self._known: OrderedDict[Phrase, Clause | _Refused] = OrderedDict()
        self._size = 0
        self._line: OrderedDict[Phrase, None] = OrderedDict()
        self._asked: _Asked | None = None
        self._died_at: OrderedDict[Phrase | None, None] = OrderedDict()
        """What a process was asked when it died, and has not done since. None: to make the synthesizer."""
        self._broken: _Refused | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._process: subprocess.Popen[bytes] | None = None
        self._end: weakref.finalize[..., Studio] | None = None
        self._buffer, self._unsent = bytearray(), bytearray()
        self._bells: list[Bell] = []
        self._listens: asyncio.AbstractEventLoop | None = None

    def known(self, phrase: Phrase) -> Clause | None:
        """The sound of a phrase, if it is there. Raises SynthesisFailed: it cannot be said."""
        found = self._known.get(phrase)
        if isinstance(found, _Refused):
            raise SynthesisFailed(found.fault)
        if found is not None:
            self._known.move_to_end(phrase)
        return found

    async def asked(self, phrases: Sequence[Phrase], patience: Seconds) -> None:
        """Wait until phrases are there, or for as long as `patience`. What the process says is heard (`listen`)."""
        await self._rung(lambda: self.ask(phrases, 0.0), patience)

    def ask(self, phrases: Sequence[Phrase], wait: Seconds, *, first: bool = False) -> bool:
        """Ask for phrases to be synthesized, in this order, and wait until they are there or the time is over.

        phrases: those that are known cost nothing. wait: seconds by the clock, in which the loop stands still; inf:
        until all are there or refused. first: before all others that are asked for.

        Returns whether all are there.
        """
        for phrase in phrases:
            found = self._known.get(phrase)
            if isinstance(found, _Refused) and time.monotonic() >= found.until:
                self._size -= _bytes(self._known.pop(phrase))
        wanted = [phrase for phrase in phrases if phrase not in self._known]
        self._line.update(dict.fromkeys(wanted))
        for phrase in reversed(wanted) if first else ():
            self._line.move_to_end(phrase, last=False)
        deadline = time.monotonic() + wait
        while True:
            self._go_on()
            if all(phrase in self._known for phrase in phrases):
                return True
            if not self._waited(deadline):
                return False

    def make(self, wait: Seconds) -> bool:
        """Start the process, and wait until the synthesizer is there or the time is over. Raises SynthesisFailed."""
        deadline = time.monotonic() + wait
        while not self.rate:
            self._go_on()
            if self._broken is not None:
                raise SynthesisFailed(self._broken.fault)
            if self.rate or not self._waited(deadline):
                break
        return bool(self.rate)

    async def made(self) -> None:
        """Wait until the synthesizer is there. Raises SynthesisFailed."""
        await self._rung(lambda: self.make(0.0), inf)

    async def _rung(self, is_done: Callable[[], bool], patience: Seconds) -> None:
        """Look at each answer whether something is done, for as long as `patience`."""
        bell = Bell()
        unwatch, deadline = self.watch(bell), bell.now() + patience
        try:
            while not is_done() and bell.now() < deadline:
                await bell.wait(deadline)
        finally:
            unwatch()

    def listen(self, loop: asyncio.AbstractEventLoop) -> None:
        """Take answers as they come, while the loop runs; only where its time is real."""
        self._listens = loop
        if self._process is not None and self._process.stdout is not None:
            loop.add_reader(self._process.stdout.fileno(), self._go_on)
            self._expect(self._asked)

    def watch(self, bell: Bell) -> Callable[[], None]:
        """Ring a bell at each answer, until the returned function is called."""
        self._bells.append(bell)
        return lambda: self._bells.remove(bell)

    def close(self) -> None:
        """End the process. Asking starts it again."""
        process, self._process = self._process, None
        if process is not None and process.stdout is not None and self._listens is not None:
            with suppress(RuntimeError):  # the loop is closed
                self._listens.remove_reader(process.stdout.fileno())
                if process.stdin is not None:
                    self._listens.remove_writer(process.stdin.fileno())
        self.rate, self._buffer, self._unsent = 0, bytearray(), bytearray()
        self._expect(None)
        if self._end is not None:
            self._end()

    # -- the process --------------------------------------------------------------------------------------------

    def _go_on(self) -> None:
        """Take what has come, end what takes too long, and ask for the next phrase."""
        self._take()
        if self._asked is not None and self._left(self._asked) <= 0.0:
            seconds = time.monotonic() - self._asked.at
            self._lose(f"the synthesizer does not answer for {seconds:.1f} s", is_frozen=True)
        if self._broken is not None and time.monotonic() >= self._broken.until:
            self._broken = None
        if self._broken is not None:
            for phrase in list(self._line):
                self._keep(phrase, self._broken)
        while self._line and next(iter(self._line)) in self._known:
            self._line.popitem(last=False)
        if self._process is None and self._broken is None:
            self._start()
        if self.rate and self._asked is None and self._line:
            self._tell(next(iter(self._line)))

    def _left(self, asked: _Asked) -> Seconds:
        """Seconds that the process still has for what it was asked."""
        return asked.at + (self._limit if asked.phrase is not None else max(MAKING, self._limit)) - time.monotonic()

    def _expect(self, asked: _Asked | None) -> None:
        """Take note of what the process works on, and look again when it is late."""
        self._asked = asked
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if asked is not None and self._listens is not None:
            self._timer = self._listens.call_later(max(0.0, self._left(asked)), self._go_on)

    def _waited(self, deadline: Seconds) -> bool:
        """Let the loop stand still until there is something to take, or some time has passed.

        Returns whether it is worth looking again: an answer may come, and the clock is before `deadline`.
        """
        left = deadline - time.monotonic()
        if left <= 0.0:
            return False
        if self._process is None or self._process.stdout is None:
            return self._broken is None  # it was lost in this moment, and may be started again
        patience = 1.0 if self._asked is None else max(0.0, self._left(self._asked))
        full = [self._process.stdin] if self._unsent and self._process.stdin is not None else []
        select.select([self._process.stdout], full, [], min(left, patience, 1.0))
        self._push()
        return True

    def _start(self) -> None:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
        self._process = process = subprocess.Popen(
            [sys.executable, "-m", "engage_hri.services.control.voice.worker"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, bufsize=0,
        )  # fmt: skip
        self._end = weakref.finalize(self, _ended, process)
        assert process.stdout is not None
        assert process.stdin is not None
        os.set_blocking(process.stdout.fileno(), False)
        os.set_blocking(process.stdin.fileno(), False)  # a long text does not fit into the pipe of one that is frozen
        if self._listens is not None:
            self._listens.add_reader(process.stdout.fileno(), self._go_on)
        self._tell(None)

    def _tell(self, phrase: Phrase | None) -> None:
        """Tell the process what it is to say. phrase: None: the synthesizer to make."""
        self._expect(_Asked(phrase, time.monotonic()))
        self._unsent += packed(self._order if phrase is None else phrase)
        self._push()

    def _push(self) -> None:
        """Let the process have as much of what it is asked as its pipe holds."""
        if self._process is None or self._process.stdin is None:
            return
        pipe = self._process.stdin.fileno()
        with suppress(BlockingIOError, BrokenPipeError):  # that it is gone is seen where it answers
            del self._unsent[: os.write(pipe, self._unsent)]
        if self._listens is not None:
            self._listens.remove_writer(pipe)
            if self._unsent:
                self._listens.add_writer(pipe, self._push)

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
        assert self._asked is not None
        phrase = self._asked.phrase
        self._expect(None)
        self._died_at.pop(phrase, None)
        match answer, phrase:
            case Made(rate), _:
                self.rate = rate
            case Failed(fault), None:
                self._broken = self._refused(fault)
            case Failed(fault), Phrase():
                self._keep(phrase, self._refused(fault))
            case Spoken(clause), Phrase():
                self._keep(phrase, clause)
        self._ring()

    def _keep(self, phrase: Phrase, result: Clause | _Refused) -> None:
        self._known[phrase] = result
        self._line.pop(phrase, None)
        self._size += _bytes(result)
        while self._size > LARGEST and len(self._known) > 1:
            self._size -= _bytes(self._known.popitem(last=False)[1])

    def _lose(self, reason: str, *, is_frozen: bool = False) -> None:
        """The process is gone or is not to be trusted; another one is started.

        What it was asked is asked again, unless it is the second time, or whoever needs it has waited long enough.
        """
        asked = self._asked
        self.close()
        what = "" if asked is None else _named(asked.phrase)
        fault = Fault(reason=f"{reason}{what}", where="synthesizer", advice="it is started again", service="control")
        if asked is not None:
            is_second = asked.phrase in self._died_at
            self._died_at[asked.phrase] = None
            if len(self._died_at) > MOST_DEATHS:
                self._died_at.popitem(last=False)
            if is_second:
                fault = replace(fault, reason=f"{fault.reason}, for the second time; refused for {AGAIN:.0f} s")
            if asked.phrase is None and (is_second or is_frozen):
                self._broken = self._refused(replace(fault, advice="its own words are on standard error"))
            elif asked.phrase is not None and (is_second or is_frozen):
                self._keep(asked.phrase, self._refused(fault, AGAIN if is_second else NEWS))
        self.on_fault(fault)
        self._ring()

    def _refused(self, fault: Fault, seconds: Seconds = AGAIN) -> _Refused:
        return _Refused(fault, time.monotonic() + seconds)

    def _ring(self) -> None:
        for bell in self._bells:
            bell.ring()


def _size(buffer: bytearray) -> int:
    return int.from_bytes(buffer[:HEAD], "little")


def _named(phrase: Phrase | None) -> str:
    """Say at what the process was lost."""
    if phrase is None:
        return ", while it was made"
    text = phrase.text if len(phrase.text) <= 60 else phrase.text[:59] + "…"
    return f", at {text!r}"


def _bytes(result: Clause | _Refused) -> int:
    return len(result.samples) + 500 if isinstance(result, Clause) else 500


def _ended(process: "subprocess.Popen[bytes]") -> None:
    """End a process: it holds nothing that is worth waiting for, and is to say nothing of a pipe that is closed."""
    process.kill()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            with suppress(OSError):
                pipe.close()
    process.wait()

"""The ledger of what a service took: an intake at its bus, each step noted, and what follows from it carried out.

A recording has what a service sent. Why it did so nobody can say from that alone: it depends on what came, in which
order, at which instant, and on what the clocks of other machines said then. So each step is told on the bus, in
portions, for a recorder to keep (decision 0144); `again.py` takes the same steps once more.
"""

from collections.abc import Callable, Sequence
from math import isfinite
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.participants import ReadClock, Step, Taken
from engage_hri.schemas.recognition import session_of
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.runtime.intake import (
    Input,
    ServiceIntake,
    StepClock,
    fingerprint,
    input_of,
    step_of,
)
from engage_hri.services.runtime.loop import Alarm

PORTION = 64
"""Number of steps after which they are told, whatever comes of them."""
LATEST: Seconds = 0.25
"""Time after which a step is told."""
FIRST: Seconds = 2.0
"""Time from the beginning for which steps are kept although nobody listens: a recorder may just have heard of us."""
MOST = 2048
"""Number of steps that are kept so."""


class BusClock(StepClock):
    """Clocks as the bus knows them, read once in a step."""

    def __init__(self, bus: Bus) -> None:
        super().__init__(bus.clock)
        self._bus = bus

    def begin(self) -> None:
        self._known.clear()

    @property
    def were_read(self) -> tuple[ReadClock, ...]:
        return tuple(self._known.values())

    def local(self, stamp: Stamp, now: Seconds) -> Seconds:
        self._look(stamp.clock)
        return super().local(stamp, now)

    def error(self, clock: str) -> Seconds:
        self._look(clock)
        return super().error(clock)

    def _look(self, clock: str) -> None:
        if clock in self._known or (clock == self.name and not self._bus.error(clock)):
            return
        # All instants of a clock that is not known read as now.
        zero, one = self._bus.local(Stamp(clock, 0.0)), self._bus.local(Stamp(clock, 1.0))
        error = self._bus.error(clock)
        self._known[clock] = ReadClock(clock, zero if one - zero > 0.5 else None, error if isfinite(error) else None)


class Ledger:
    """Steps of one life of a service that are not told yet, each with what it led to."""

    def __init__(self, bus: Bus, service: str) -> None:
        self._bus = bus
        self._service = service
        self._began = bus.now()
        self._steps: list[tuple[Step, tuple[ReadClock, ...], Sequence[Struct]]] = []
        self._first = 1
        self.deadline: Seconds | None = None
        """Time at which the steps are to be told."""

    def note(self, step: Step, clocks: tuple[ReadClock, ...], outputs: Sequence[Struct]) -> None:
        if not self._steps:
            self.deadline = step.now + LATEST
        self._steps.append((step, clocks, outputs))

    @property
    def is_full(self) -> bool:
        return len(self._steps) >= PORTION

    def tell(self, now: Seconds) -> None:
        """Tell the steps so far, if anybody listens. What can't be told is a fault, and no more."""
        with self._bus.containing("the ledger"):
            self.deadline = None
            key = keys.taken(self._service)
            is_heard = self._bus.is_heard(key)
            if not is_heard and self._steps and now - self._began <= FIRST and len(self._steps) < MOST:
                self.deadline = now + LATEST
                return
            told, first = self._steps, self._first
            self._steps = []
            self._first += len(told)
            if told and is_heard:
                steps = tuple(
                    replace(step, clocks=clocks, led_to=fingerprint(outputs)) for step, clocks, outputs in told
                )
                session, at = session_of(self._bus.run), self._bus.stamp(now)
                self._bus.publish(key, Taken(service=self._service, session=session, at=at, first=first, steps=steps))


class NotedIntake:
    """The intake of a service, with a ledger. carry_out: called with each output, in order."""

    def __init__(
        self, bus: Bus, service: str, intake: ServiceIntake, clock: BusClock, carry_out: Callable[[Struct], None]
    ) -> None:
        """clock: the one that the intake reads."""
        self._bus = bus
        self._intake = intake
        self._clock = clock
        self._carry_out = carry_out
        self._ledger = Ledger(bus, service)

    @property
    def deadline(self) -> Seconds | None:
        times = (self._intake.deadline, self._ledger.deadline)
        return min((at for at in times if at is not None), default=None)

    def take(self, input: Input[Any], number: int = 0) -> None:
        """Take an input. number: of its message in its life; 0: the ledger has it whole."""
        now = self._bus.now()
        self._clock.begin()
        outputs = self._intake.take(input, now)
        self._ledger.note(step_of(input, number, now), self._clock.were_read, outputs)
        self._tell(outputs, now)

    def take_own(self, content: Struct) -> None:
        """Take what came by no bus."""
        self.take(Input("", content, "", self._bus.now()))

    def advance(self) -> None:
        """Carry out what is due by now."""
        now, due = self._bus.now(), self._intake.deadline
        if due is not None and due <= now:
            self._clock.begin()
            outputs = self._intake.advance(now)
            self._ledger.note(Step(now=now), self._clock.were_read, outputs)
            self._tell(outputs, now)
        else:
            self._tell((), now)

    def _tell(self, outputs: Sequence[Struct], now: Seconds) -> None:
        """Carry out what a step led to. The steps are told before: a recording has all that its events came from."""
        due = self._ledger.deadline
        if outputs or self._ledger.is_full or (due is not None and due <= now):
            self._ledger.tell(now)
        for output in outputs:
            self._carry_out(output)


class NotedInputs:
    """Inputs of a service that works in tasks, with a ledger: what it took, and not what each led to.

    Between two inputs its tasks run as the loop has them, so nobody can say what followed from which.
    """

    def __init__(self, bus: Bus, service: str) -> None:
        self._bus = bus
        self._clock = BusClock(bus)
        self._ledger = Ledger(bus, service)
        self._alarm = Alarm(self._tell)

    def take(self, received: Received, *, is_same_turn: bool = False) -> None:
        """Note a message. is_same_turn: as of `Step`."""
        message, now = received.message, self._bus.now()
        self._clock.begin()
        for stamp in (getattr(message, "at", None), getattr(message, "arrived", None)):
            if isinstance(stamp, Stamp):
                self._clock.local(stamp, now)
        self._note(replace(step_of(input_of(received, message), received.number, now), is_same_turn=is_same_turn))

    def take_own(self, content: Struct) -> None:
        """Note what came by no bus."""
        now = self._bus.now()
        self._clock.begin()
        self._note(step_of(Input("", content, "", now), 0, now))

    def close(self) -> None:
        """Tell what is not told yet."""
        self._alarm.stop()
        self._tell()

    def _note(self, step: Step) -> None:
        self._ledger.note(step, self._clock.were_read, ())
        if self._ledger.is_full:
            self._tell()
        else:
            self._alarm.set(self._ledger.deadline)

    def _tell(self) -> None:
        self._ledger.tell(self._bus.now())
        self._alarm.set(self._ledger.deadline)

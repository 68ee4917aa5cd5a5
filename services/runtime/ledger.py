"""Ledger of what a service took: steps as they are made, given out in portions. Pure."""

from collections.abc import Sequence
from hashlib import blake2b
from math import inf
from typing import Any

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.participants import ReadClock, Step, Taken
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.runtime.intake import Input

REPEATED = ("evt", "state")
"""Classes of keys whose messages a recorder has from their senders."""

PORTION = 64
"""Number of steps after which they are told, whatever comes of them."""
LATEST: Seconds = 0.25
"""Time after which a step is told."""
FIRST: Seconds = 2.0
"""Time from the beginning for which steps are kept although nobody listens: a recorder may just have heard of us."""
MOST = 2048
"""Number of steps that are kept so."""


def step_of(input: Input[Any], number: int, now: Seconds) -> Step:
    """Make the step that took this input. number: of its message in its life; 0: it has none."""
    at = None if input.at == now else input.at
    if number and keys.key_class(input.key) in REPEATED:
        return Step(now=now, life=input.life, number=number, at=at, past=input.past)
    return Step(
        now=now, life=input.life, key=input.key, source=input.source, content=input.message, at=at, past=input.past
    )


def fingerprint(outputs: Sequence[Struct]) -> str:
    """Sixteen hexadecimal digits that stand for these outputs; empty for none. An exception counts as its text."""
    if not outputs:
        return ""
    named = [(type(output).__name__, output) for output in outputs]
    return blake2b(msgspec.msgpack.encode(named, enc_hook=repr), digest_size=8).hexdigest()


class StepClock:
    """Clocks as one step read them: of a life that is over. name: the own one."""

    def __init__(self, name: str) -> None:
        self.name = name
        self._known: dict[str, ReadClock] = {}

    def read(self, clocks: tuple[ReadClock, ...]) -> None:
        """Take what the next step read. A clock that it did not is as it was."""
        self._known |= {each.clock: each for each in clocks}

    def local(self, stamp: Stamp, now: Seconds) -> Seconds:
        if stamp.clock == self.name:
            return stamp.seconds
        known = self._known.get(stamp.clock)
        return now if known is None or known.offset is None else stamp.seconds + known.offset

    def error(self, clock: str) -> Seconds:
        known = self._known.get(clock)
        if known is None and clock == self.name:
            return 0.0
        return inf if known is None or known.error is None else known.error


class Ledger:
    """Steps of one life of a service that are not told yet, each with what it led to."""

    def __init__(self, service: str, session: str, clock: str, began: Seconds) -> None:
        self._service = service
        self._session = session
        self._clock = clock
        self._began = began
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

    def portion(self, now: Seconds, *, is_heard: bool) -> Taken | None:
        """Give out the steps so far; None: there are none, or nobody listens."""
        self.deadline = None
        if not self._steps:
            return None
        if not is_heard and now - self._began <= FIRST and len(self._steps) < MOST:
            self.deadline = now + LATEST
            return None
        told, first = self._steps, self._first
        self._steps = []
        self._first += len(told)
        if not is_heard:
            return None
        steps = tuple(
            msgspec.structs.replace(step, clocks=clocks, led_to=fingerprint(outputs))
            for step, clocks, outputs in told
        )
        return Taken(
            service=self._service, session=self._session, at=Stamp(self._clock, now), first=first, steps=steps
        )  # fmt: skip

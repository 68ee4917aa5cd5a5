"""A service once more, from the ledger of what it took: the same outputs, or those that other settings give. Pure.

    clock = StepClock(first.at.clock)
    life = Again(ServiceIntake("robot", config, clock, first.session), clock, Content)
    for taken in ledger: life.take(taken, find)         # each `Taken` of this life, in order
    life.outputs, life.differences, life.lack

With the settings that it had, and from its first step on, a service does again exactly what it did: each step has the
fingerprint of what it led to, and again it leads to the same.
"""

from collections.abc import Callable, Sequence
from typing import Any

import msgspec
from msgspec import Struct

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.participants import Step, Taken
from engage_hri.services.bus.samples import Received
from engage_hri.services.runtime.intake import Input, ServiceIntake, StepClock, fingerprint

Find = Callable[[str, int], Received | None]
"""Finds the message of a life by its number; None: it is not there."""


class Lack(Struct, frozen=True, kw_only=True):
    """Parts that are missing, so that the same cannot come of it.

    before: steps before the first that was told: the service ran before the recording began. gaps: steps that were
    not told in between. messages: those that steps took, and that are not in the recording. settings: those of the
    service are not in it, or cannot be read.
    """

    settings: bool = False
    before: int = 0
    gaps: int = 0
    messages: int = 0

    @property
    def is_nothing(self) -> bool:
        return self == Lack()


class StepDifference(Struct, frozen=True):
    """A step that led to something else again. number: of the step in its life. outputs: those of again."""

    number: int
    step: Step
    outputs: tuple[Struct, ...]


def content_of(step: Step, kind: Any) -> Any:
    """Read what a step took. kind: the type that it is of, a union. Raises InputRefused: it is of no such type."""
    try:
        return msgspec.convert(step.content, kind)
    except msgspec.ValidationError as error:
        reason = f"a ledger has what this Engage does not know: {error}"
        fault = Fault(reason=reason, where=f"step at {step.now:.3f} s", advice="use the Engage that recorded it")
        raise InputRefused(fault) from error


class Again:
    """One life of a service, done once more.

    steps: number of those done. outputs: all that followed. differences: steps that led to something else, in order.
    lack: what is missing so far.
    """

    def __init__(self, intake: ServiceIntake, clock: StepClock, content: Any, lack: Lack = Lack()) -> None:  # noqa: B008
        """content: type of what the intake takes, a union. lack: what is missing before the first step."""
        self.lack = lack
        self.steps = 0
        self.outputs: list[Struct] = []
        self.differences: list[StepDifference] = []
        self._intake = intake
        self._clock = clock
        self._content = content
        self._next = 1

    def take(self, taken: Taken, find: Find) -> Sequence[Struct]:
        """Take the steps. Returns all that follows from them."""
        if (missing := taken.first - self._next) > 0:
            before = missing if self._next == 1 else 0
            self.lack = msgspec.structs.replace(
                self.lack, before=self.lack.before + before, gaps=self.lack.gaps + missing - before
            )
        self._next = taken.first + len(taken.steps)
        all_outputs: list[Struct] = []
        for number, step in enumerate(taken.steps, taken.first):
            outputs = self._take(step, find)
            if fingerprint(outputs) != step.led_to:
                self.differences.append(StepDifference(number, step, tuple(outputs)))
            all_outputs += outputs
        self.steps += len(taken.steps)
        self.outputs += all_outputs
        return all_outputs

    def _take(self, step: Step, find: Find) -> Sequence[Struct]:
        self._clock.read(step.clocks)
        at = step.now if step.at is None else step.at
        if step.content is not None:
            content = content_of(step, self._content)
            return self._intake.take(Input(step.key, content, step.source, at, step.past, step.life), step.now)
        if not step.number:
            return self._intake.advance(step.now)
        found = find(step.life, step.number)
        if found is None:
            self.lack = msgspec.structs.replace(self.lack, messages=self.lack.messages + 1)
            return self._intake.advance(step.now)
        return self._intake.take(
            Input(found.key, found.message, found.source, at, step.past, step.life), step.now
        )  # fmt: skip

"""Recognition once more, from the ledger of what it took: the same events, or those that other settings give. Pure.

    life = Again("robot", first.session, first.at.clock, config)
    outputs = life.take(taken, find)            # each `Taken` of this life, in order

With the settings that it had, and from its first step on, recognition does again exactly what it did.
"""

from collections.abc import Callable

import msgspec
from msgspec import Struct

from engage_hri.schemas.ledger import Step, Taken
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.samples import Received
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.intake import Input, Intake, Output, PublishMessage, reads
from engage_hri.services.recognition.ledger import StepClock

Find = Callable[[str, int], Received | None]
"""Finds the message of a life by its number; None: it is not there."""


class Lack(Struct, frozen=True, kw_only=True):
    """Parts that are missing, so that the same cannot come of it.

    before: steps before the first that was told: recognition ran before the recording began. gaps: steps that were
    not told in between. messages: those that steps took, and that are not in the recording. settings: those of
    recognition are not in it, or cannot be read.
    """

    settings: bool = False
    before: int = 0
    gaps: int = 0
    messages: int = 0

    @property
    def is_nothing(self) -> bool:
        return self == Lack()


NOTHING = Lack()


class Again:
    """One life of recognition, done once more. lack: what is missing so far."""

    def __init__(self, robot: str, session: str, clock: str, config: RecognitionConfig, lack: Lack = NOTHING) -> None:
        """lack: what is missing before the first step."""
        self.lack = lack
        self._clock = StepClock(clock)
        self._intake = Intake(robot, config, self._clock, session)
        self._next = 1

    def take(self, taken: Taken, find: Find) -> list[Output]:
        """Take the steps. Returns all that follows from them."""
        if taken.first != self._next:
            steps = taken.first - self._next
            lack = self.lack
            self.lack = (
                msgspec.structs.replace(lack, before=steps)
                if self._next == 1
                else msgspec.structs.replace(lack, gaps=lack.gaps + steps)
            )
        self._next = taken.first + len(taken.steps)
        return [output for step in taken.steps for output in self._take(step, find)]

    def end(self, now: Seconds) -> list[Output]:
        """Take the steps that are due until the end of the recording."""
        return self._intake.advance(now)

    def _take(self, step: Step, find: Find) -> list[Output]:
        self._clock.read(step.clocks)
        at = step.now if step.at is None else step.at
        if step.content is not None:
            input = Input(step.key, step.content, step.source, at, step.past, step.life)
            return self._intake.take(input, step.now)
        if not step.number:
            return self._intake.advance(step.now)
        found = find(step.life, step.number)
        if found is None or not reads(found.message):
            self.lack = msgspec.structs.replace(self.lack, messages=self.lack.messages + 1)
            return self._intake.advance(step.now)
        return self._intake.take(
            Input(found.key, found.message, found.source, at, step.past, step.life), step.now
        )  # fmt: skip


def events_in(outputs: list[Output]) -> list[ConnectionEvent]:
    """The changes of connection events among the outputs, in order."""
    return [
        output.message
        for output in outputs
        if isinstance(output, PublishMessage) and isinstance(output.message, ConnectionEvent)
    ]

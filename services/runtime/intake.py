"""Intakes: what a service decides, apart from the bus, once and once more. Values in, values out. Pure.

A service is two parts. Its *intake* decides everything: it takes one input after the other, each with its instant,
and gives back what is to be done. Its *shell* (`service.py`) decides nothing: it hands in what comes, and carries out
what comes back. Then the same inputs at the same instants give the same outputs, so that a test needs no bus, and a
recording can be played to a service once more (`again.py`). Without that line between the two, an answer depends on
which task the loop happened to run first, and nobody can say afterwards why a robot did what it did.

What an intake took is a `Step` of the ledger (`ledger.py`): the input, what the clocks said, and a fingerprint of
what it led to.
"""

from collections.abc import Callable, Sequence
from hashlib import blake2b
from math import inf
from typing import Any, Generic, Protocol, TypeVar

import msgspec
from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import InputRefused, raised_as
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import ReadClock, Step, Taken
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.samples import Received

Content = TypeVar("Content")


class Input(Struct, Generic[Content], frozen=True):
    """An input: a message, as `Received`, or what came by no bus, without a key.

    The id of a request is its name at this server. at: local time of arrival.
    """

    key: str
    message: Content
    source: str
    at: Seconds
    past: bool = False
    life: str = ""


def input_of(received: Received, message: Content) -> Input[Content]:
    """Make the input of a message as it arrived. message: its content, as the service takes it."""
    return Input(received.key, message, received.source, received.at, received.past, received.life)


class PublishMessage(Struct, frozen=True):
    """Publish this message under this key."""

    key: str
    message: Message


class WithdrawStates(Struct, frozen=True):
    """Withdraw the states under these keys."""

    states: tuple[str, ...]


class AnswerRequest(Struct, frozen=True):
    """Answer a request."""

    answer: Message


class TellMistake(Struct, frozen=True):
    """Tell a bug of ours that has shown. request: name of the request that cannot be served for it; or empty."""

    error: BaseException
    what: str
    request: str = ""


class MachineClocks(Protocol):
    """Clocks of machines, as one step sees them. name: of the own one."""

    @property
    def name(self) -> str: ...

    def local(self, stamp: Stamp, now: Seconds) -> Seconds:
        """Convert a stamp to the own clock; one of a clock that is not known reads as now."""
        ...

    def error(self, clock: str) -> Seconds:
        """Greatest error of that; inf if nothing is known of the clock."""
        ...


class ServiceIntake(Protocol):
    """The part of a service that decides. What follows from an input is a sequence of values, in order."""

    @property
    def deadline(self) -> Seconds | None:
        """Instant at which `advance` is to be called; None: nothing is due."""
        ...

    def take(self, input: Input[Any], now: Seconds, /) -> Sequence[Struct]: ...

    def advance(self, now: Seconds, /) -> Sequence[Struct]:
        """Carry out what is due by now."""
        ...


REPEATED = ("evt", "state")
"""Classes of keys whose messages a recorder has from their senders."""


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


# -- once more -------------------------------------------------------------------------------------------------------
# A service does once more what it did, from the ledger of what it took:
#
#     clock = StepClock(first.at.clock)
#     life = Again(ServiceIntake("robot", config, clock, first.session), clock, Content)
#     for taken in ledger: life.take(taken, find)         # each `Taken` of this life, in order
#     life.outputs, life.differences, life.lack
#
# With the settings that it had, and from its first step on, a service does again exactly what it did: each step has
# the fingerprint of what it led to, and again it leads to the same.

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
    where, problem = f"step at {step.now:.3f} s", "a ledger has what this Engage does not know"
    with raised_as(InputRefused, msgspec.ValidationError, where, problem, "use the Engage that recorded it"):
        return msgspec.convert(step.content, kind)


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

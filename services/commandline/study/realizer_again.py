"""The realizer once more, over a recording: its own tasks, on a clock that jumps, at a bus that is played.

The realizer decides in tasks that await sync points (docs/realizer.md), so it has no intake that could be asked
again. It runs as it is: at each instant of its ledger it gets what it got, and what it publishes is held against what
the recording has of it. Its timers fire to the instant then, and some milliseconds late when it lived; so times count
as the same if they are within `NEAR`, and the greatest difference is told. Of two inputs in one instant, which only a
virtual clock has, all that follows from the first comes before the second; when it lived, the second may have come
between, and a command that is void at once may have been sent or not.
"""

import asyncio
from collections import defaultdict
from collections.abc import Iterator, Sequence
from functools import partial

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.body import EstimateBehaviors
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.messages import Message, in_form
from engage_hri.schemas.participants import BusHealth, Step
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Answer, Bus, Subscription, Tap
from engage_hri.services.bus.samples import Received
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.realizer.together.planning import BodyAnswered, RealizerInput, behaviors_asked
from engage_hri.services.runtime.again import Find, content_of
from engage_hri.services.runtime.intake import StepClock
from engage_hri.services.runtime.virtual_time import run_virtual

TURNS = 40
"""Turns of the loop from one input to the next of the same instant: what follows from the first comes before."""
AFTER: Seconds = 0.01
"""Time for which it runs on after its last input."""


class SentMessage(Struct, frozen=True):
    """A message that the realizer published. at: on its clock, or that of the recording."""

    key: str
    message: Message
    at: Seconds


class PlayedBus(Bus):
    """The bus of a participant to whom a ledger is played. said: what it has published, in order."""

    def __init__(self, robot: str, name: str, run: str, clock: StepClock, lives: Iterator[int]) -> None:
        super().__init__(robot, name, "", clock.name, run, lives)
        self.said: list[SentMessage] = []
        self._known = clock
        self._asked = defaultdict[str, list[asyncio.Future[BodyAnswered]]](list)
        """Questions without an answer, and answers without a question, by what they are about, in order."""

    def give(self, received: Received) -> None:
        """Hand it a message."""
        for reader in self._readers:
            if isinstance(reader, Subscription) and reader.wants(received.key):
                reader.offer(received)

    def give_answer(self, answered: BodyAnswered) -> None:
        """Answer a question of it, or the one that it asks next."""
        open_ones = [each for each in self._asked[answered.asked] if not each.done()]
        (open_ones[0] if open_ones else self._asking(answered.asked)).set_result(answered)

    def _asking(self, asked: str) -> "asyncio.Future[BodyAnswered]":
        self._asked[asked].append(future := asyncio.get_running_loop().create_future())
        return future

    async def _query(self, key: str, message: Message, deadline: Seconds) -> Message | None:
        assert isinstance(message, EstimateBehaviors)
        name = behaviors_asked(message)
        answered = [each for each in self._asked[name] if each.done()]
        answer = answered[0] if answered else self._asking(name)
        try:
            await asyncio.wait([answer], timeout=deadline - self.now())
        finally:
            self._asked[name].remove(answer)
        if not answer.done():
            return None
        if (refused := answer.result().refused) is not None:
            raise InputRefused(refused)
        return answer.result().answer

    def _send(self, key: str, message: Message) -> None:
        in_form(key, message, "msgpack")  # as on a wire: what has no form raises
        self.said.append(SentMessage(key, message, self.now()))

    def local(self, stamp: Stamp) -> Seconds:
        return self._known.local(stamp, self.now())

    def error(self, clock: str) -> Seconds:
        return self._known.error(clock)

    @property
    def health(self) -> BusHealth:
        return BusHealth(peers=tuple(keys.SERVICES))

    def withdraw(self, *states: str) -> None:
        pass

    def is_heard(self, key: str) -> bool:
        return False

    def _attach(self, reader: Subscription | Tap) -> None:
        pass

    def _detach(self, reader: Subscription | Tap) -> None:
        pass

    def answer(self, key: str, answer: Answer, *, empty: Message | None = None) -> None:
        pass

    def declare_alive(self) -> None:
        pass

    async def leave(self) -> None:
        for reader in list(self._readers):
            reader.close()


async def _play(bus: PlayedBus, steps: Sequence[Step], clock: StepClock, find: Find, config: RealizerConfig) -> int:
    """Run the realizer over the steps. Returns the number of messages that are missing in the recording."""
    missing, loop = 0, asyncio.get_running_loop()
    task = asyncio.create_task(realize(bus, lambda: None, config))
    for _ in range(TURNS):
        await asyncio.sleep(0)
    for step, following in zip(steps, (*steps[1:], None), strict=True):
        clock.read(step.clocks)
        if step.now > bus.now():
            due = loop.create_future()
            loop.call_at(step.now, partial(due.set_result, None))
            await due
        if step.content is None:
            found = find(step.life, step.number)
        elif isinstance(content := content_of(step, RealizerInput), BodyAnswered):
            bus.give_answer(content)
            found = None
        else:
            found = Received(step.key, content, step.source, step.now, step.past, step.life)
        if found is not None:
            bus.give(replace(found, at=step.now if step.at is None else step.at, past=step.past))
        missing += found is None and step.content is None
        for _ in range(0 if following is not None and following.is_same_turn else TURNS):
            await asyncio.sleep(0)
    await asyncio.sleep(AFTER)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    await bus.leave()
    return missing


def played(
    robot: str, run: str, steps: Sequence[Step], clock: StepClock, find: Find, config: RealizerConfig
) -> tuple[list[SentMessage], int]:
    """Messages that the realizer publishes once more, and the number of those missing that it took.

    run: its life. steps: all of that life, from the first on.
    """

    async def play() -> tuple[list[SentMessage], int]:
        bus = PlayedBus(robot, "realizer", run, clock, iter(range(1, 1 << 30)))
        missing = await _play(bus, steps, clock, find, config)
        return bus.said, missing

    return run_virtual(play(), begin=steps[0].now)

"""The generation service: feeds generation from the bus, and carries out what it decides. It decides nothing."""

import asyncio
from collections import deque
from collections.abc import Callable
from functools import partial
from typing import Any

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import PerformBlock
from engage_hri.schemas.body import DescribeBody
from engage_hri.schemas.faults import EngageError, RunFailed
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import session_of
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import COVERED_FOR
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.exchange import (
    NAME,
    AnswerCame,
    AskBody,
    CancelRequest,
    GenerationBegan,
    NoAnswer,
    OwnSight,
    Question,
    SendRequest,
)
from engage_hri.services.generation.intake import GenerationIntake, reads
from engage_hri.services.generation.policies import installed
from engage_hri.services.requests.ends import News, RequestDesk, Requester
from engage_hri.services.runtime.intake import AnswerRequest, Input, PublishMessage, TellMistake, input_of
from engage_hri.services.runtime.ledger import BusClock, NotedIntake
from engage_hri.services.runtime.loop import Alarm
from engage_hri.services.runtime.service import Ready, tell_settings

BODY_PATIENCE: Seconds = 5.0
"""Time that a reference waits for a body to say what motions cost: a body that has just been started needs it.
Ours."""
PATTERNS = (
    *RequestDesk.patterns(NAME), keys.ANY_REQUEST_STATE, keys.FEEDBACK, keys.ANY_CONNECTION_EVENT, keys.WORLD,
    keys.SYNC_POINT, keys.ANY_ACTION, keys.ANY_PERCEIVED_ONGOING, keys.UTTERANCE, keys.ROBOT_STATE,
    keys.ANY_STATISTICS, keys.ANY_INTERJECTION, keys.FLOOR, keys.SAME_PEOPLE,
)  # fmt: skip


async def generate(bus: Bus, ready: Ready, config: GenerationConfig, *, covered_for: Seconds = COVERED_FOR) -> None:
    """Serve until cancelled. A bad fragment is refused with a fault; it never ends the service.

    covered_for: see `CoveredObjects`.
    """
    with bus.subscribe(*PATTERNS) as inbox:
        async with asyncio.TaskGroup() as tasks:
            generation = _Generation(bus, config, tasks)
            try:
                generation.take_own(GenerationBegan(covered_for))
                tell_settings(bus, NAME, config, covered_for=covered_for)
                ready()
                async for received in inbox:
                    with bus.containing(received):
                        generation.take(received)
            finally:
                generation.close()


class _Generation:
    """The parts of the service: both ends of requests, and generation with its ledger."""

    def __init__(self, bus: Bus, config: GenerationConfig, tasks: asyncio.TaskGroup) -> None:
        self._bus = bus
        self._tasks = tasks
        self._desk = RequestDesk(bus, NAME, self._cancel)
        self._requests = Requester(bus)
        clock = BusClock(bus)
        self._intake = GenerationIntake(bus.robot, config, clock, session_of(bus.run), installed(config))
        self._steps = NotedIntake(bus, NAME, self._intake, clock, self._carry_out)
        self._alarm = Alarm(partial(self._do, self._steps.advance))
        self._due: deque[Callable[[], None]] = deque()
        """Steps to do; what the first of them led to is being carried out."""
        self._is_over = False
        self._own_sight = OwnSight()
        """What the intake knows of it."""

    def close(self) -> None:
        self._is_over = True
        self._alarm.stop()
        self._requests.close()
        self._desk.close()

    # -- what comes -----------------------------------------------------------------------------------------------

    def take(self, received: Received) -> None:
        self._requests.feed(received)
        request, message = self._desk.take(received), received.message
        if request is not None:
            self._take(Input(received.key, request, received.source, received.at))
        if reads(message):
            self._take(input_of(received, message), received.number)

    def take_own(self, content: GenerationBegan | AnswerCame) -> None:
        self._do(partial(self._steps.take_own, content))

    def _cancel(self, cancel: Cancel) -> None:
        self._take(Input(keys.cancel(NAME), cancel, "", self._bus.now()))

    async def _ask(self, id: str, question: Question) -> None:
        key = keys.DESCRIBE if isinstance(question, DescribeBody) else keys.ESTIMATE
        with self._bus.containing(f"question {id}", lambda fault: self._has_come(id, RunFailed(fault))):
            try:
                self._has_come(id, await self._bus.query(key, question, BODY_PATIENCE))
            except EngageError as error:
                self._has_come(id, error)

    def _has_come(self, id: str, answer: Message | News) -> None:
        """Take news of a question or a request."""
        news = NoAnswer.of(answer) if isinstance(answer, EngageError) else answer
        self.take_own(AnswerCame(id, news))  # type: ignore[arg-type]

    def _take(self, input: Input[Any], number: int = 0) -> None:
        self._do(partial(self._steps.take, input, number))

    def _do(self, step: Callable[[], None]) -> None:
        """Take a step. One that comes of what another led to waits until all of that is carried out."""
        self._due.append(step)
        if len(self._due) > 1 or self._is_over:
            return
        while self._due:
            with self._bus.containing("a step of generation"):
                self._look()
                self._due[0]()
            self._due.popleft()
        self._alarm.set(self._steps.deadline)

    def _look(self) -> None:
        """Tell the intake what this process knows of itself, if that is news."""
        sight, due = self._bus.sight, self._intake.deadline
        if due is not None:
            sight.look(self._bus.now(), due)
        own = OwnSight(sight.woke_at, sight.asleep_at, sight.slept, sight.unlinked_at())
        if own != self._own_sight:
            self._own_sight = own
            self._steps.take_own(own)

    # -- what follows ---------------------------------------------------------------------------------------------

    def _carry_out(self, output: Struct) -> None:
        with self._bus.containing(type(output).__name__):
            match output:
                case PublishMessage(key=key, message=message):
                    self._bus.publish(key, message)
                case AnswerRequest(answer=answer):
                    self._desk.answer(answer)
                case SendRequest(key=key, request=PerformBlock(id=id) as block):
                    # A block that a bug of ours keeps from being sent has ended, or its fragment would wait for ever.
                    with self._bus.containing(block, lambda fault: self._has_come(id, RunFailed(fault))):
                        self._requests.send(key, block, tell=partial(self._has_come, id))
                case SendRequest(key=key, request=request):
                    self._requests.send(key, request)
                case CancelRequest(id=id, why=why):
                    self._requests.cancel(id, why)
                case AskBody(id=id, question=question):
                    self._tasks.create_task(self._ask(id, question), name=id)
                case TellMistake(error=error, what=what, request=name):
                    fault = self._bus.failed(error, what)
                    if name and self._desk.is_live(name):
                        self._desk.refuse(name, fault)

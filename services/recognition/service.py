"""The recognition service: feeds recognition from the bus and publishes what comes out. It decides nothing."""

import asyncio
from collections.abc import Callable
from typing import TypeVar

from msgspec import DecodeError, Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.recognition import RequestEvent, SignalTurn, session_of
from engage_hri.schemas.requests import Cancel
from engage_hri.services.bus.deadlines import LATE
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.former_life import FormerLife
from engage_hri.services.recognition.intake import Intake, reads
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.intake import (
    AnswerRequest,
    Input,
    PublishMessage,
    TellMistake,
    WithdrawStates,
    input_of,
)
from engage_hri.services.runtime.ledger import BusClock, NotedIntake
from engage_hri.services.runtime.service import Ready, tell_settings

T = TypeVar("T")


async def recognize(bus: Bus, ready: Ready, config: RecognitionConfig) -> None:
    """Serve until cancelled. One inbox, so that actions, requests and feedback keep their order."""
    recognition = _Recognition(bus, config)
    patterns = (
        keys.ROBOT_ACTION, keys.PERCEIVED_ACTION, keys.UTTERANCE, keys.ROBOT_ONGOING, keys.ANY_PERCEIVED_ONGOING,
        keys.FEEDBACK, keys.HEAD_OWNER, keys.WORLD, keys.SYNC_POINT,
        keys.ANY_HEAD_POSE, keys.ANY_LOOKED, keys.ANY_VOICE_ACTIVITY, keys.ROBOT_STATE,
        *RequestDesk.patterns("recognition"),
    )  # fmt: skip
    with bus.subscribe(*patterns) as inbox:
        tell_settings(bus, "recognition", config)
        ready()
        recognition.begin()
        try:
            while not inbox.is_over:
                since, due = bus.now(), recognition.steps.deadline
                received = await inbox.next(None if len(inbox) else due)
                if received is None and due is not None and bus.sight.look(bus.now(), max(since, due)):
                    await asyncio.sleep(LATE)  # What people did meanwhile comes first: it has its own time.
                    continue
                with bus.containing(received or "what is due by now"):
                    if received is None:
                        recognition.steps.advance()
                    else:
                        recognition.take(received)
        finally:
            recognition.desk.close()


class _Recognition:
    """The parts of the service: request desk, and recognition with its ledger."""

    def __init__(self, bus: Bus, config: RecognitionConfig) -> None:
        self.desk = RequestDesk(bus, "recognition", self._cancel)
        self._bus = bus
        clock = BusClock(bus)
        self._former = FormerLife(config.memory, config.window)
        self._intake = Intake(bus.robot, config, clock, session_of(bus.run))
        self.steps = NotedIntake(bus, "recognition", self._intake, clock, self._carry_out)

    def begin(self) -> None:
        """Go on with what a former life has kept.

        Publish the statistics of all, so that those who ask before the first event get an answer.
        """
        for state in self._with_file(self._former.recall) or ():
            self.steps.take_own(state)
        for output in self._intake.begin(self._bus.now()):
            self._carry_out(output)

    def take(self, received: Received) -> None:
        request = self.desk.take(received)
        message = request or received.message
        is_unaccepted = request is None and isinstance(message, RequestEvent | SignalTurn | Cancel)
        if reads(message) and not is_unaccepted:
            self.steps.take(input_of(received, message), 0 if request is not None else received.number)

    def _with_file(self, use: Callable[[], T]) -> T | None:
        """Use the file of the former life. If that fails, nothing is kept any longer, and it is told once."""
        try:
            return use()
        except (OSError, DecodeError) as error:
            self._former = FormerLife("")
            fault = Fault(reason=f"the file of the former life: {error}", service="recognition")
            self._bus.publish(keys.fault("recognition"), fault)
            return None

    def _cancel(self, cancel: Cancel) -> None:
        self.steps.take(Input(keys.cancel("recognition"), cancel, "", self._bus.now()))

    def _carry_out(self, output: Struct) -> None:
        match output:
            case PublishMessage(key=key, message=message):
                self._bus.publish(key, message)
                self._with_file(lambda: self._former.keep(key, message))
            case WithdrawStates(states=states):
                self._bus.withdraw(*states)
                self._with_file(lambda: self._former.forget(states))
            case AnswerRequest(answer=answer):
                self.desk.answer(answer)
            case TellMistake(error=error, what=what, request=request):
                fault = self._bus.failed(error, what)
                if request and self.desk.is_live(request):
                    self.desk.refuse(request, fault)

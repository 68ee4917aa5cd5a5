"""The recognition service: feeds recognition from the bus and publishes what comes out. It decides nothing."""

import asyncio
from collections.abc import Iterable
from math import isfinite

from engage_hri.schemas import keys
from engage_hri.schemas.ledger import ReadClock, Step
from engage_hri.schemas.recognition import RequestEvent, SignalTurn, session_of
from engage_hri.schemas.requests import Accepted, Cancel, Refused
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.bus.sight import LATE
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.intake import (
    AnswerRequest,
    Input,
    Intake,
    Mistake,
    Output,
    PublishMessage,
    WithdrawStates,
    reads,
)
from engage_hri.services.recognition.ledger import Ledger, StepClock, step_of
from engage_hri.services.requests.ends import RequestDesk
from engage_hri.services.runtime.service import Ready
from engage_hri.services.runtime.settings import tell_settings


async def recognize(bus: Bus, ready: Ready, config: RecognitionConfig) -> None:
    """Serve until cancelled. One inbox, so that actions, requests and feedback keep their order."""
    recognition = _Recognition(bus, config)
    patterns = (
        keys.ROBOT_ACTION, keys.PERCEIVED_ACTION, keys.UTTERANCE, keys.ROBOT_ONGOING, keys.ANY_PERCEIVED_ONGOING,
        keys.FEEDBACK, keys.HEAD_OWNER, keys.WORLD,
        keys.ANY_HEAD_POSE, keys.ANY_VOICE_ACTIVITY, keys.ROBOT_STATE,
        *RequestDesk.patterns("recognition"),
    )  # fmt: skip
    with bus.subscribe(*patterns) as inbox:
        tell_settings(bus, "recognition", config)
        ready()
        recognition.begin()
        try:
            while not inbox.is_over:
                since, due = bus.now(), recognition.deadline
                received = await inbox.next(None if len(inbox) else due)
                if received is None and due is not None and bus.sight.look(bus.now(), max(since, due)):
                    await asyncio.sleep(LATE)  # What people did meanwhile comes first: it has its own time.
                    continue
                with bus.containing(received or "what is due by now"):
                    if received is None:
                        recognition.advance()
                    else:
                        recognition.take(received)
        finally:
            recognition.desk.close()


class _BusClock(StepClock):
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


class _Recognition:
    """The parts of the service: request desk, recognition, ledger."""

    def __init__(self, bus: Bus, config: RecognitionConfig) -> None:
        self.desk = RequestDesk(bus, "recognition", self._cancel)
        self._bus = bus
        self._clock = _BusClock(bus)
        session = session_of(bus.run)
        self._intake = Intake(bus.robot, config, self._clock, session)
        self._ledger = Ledger(session, bus.clock, bus.now())

    @property
    def deadline(self) -> Seconds | None:
        times = (self._intake.deadline, self._ledger.deadline)
        return min((at for at in times if at is not None), default=None)

    def begin(self) -> None:
        """Publish the statistics of all, so that those who ask before the first event get an answer."""
        self._carry_out(self._intake.begin(self._bus.now()))

    def advance(self) -> None:
        now, due = self._bus.now(), self._intake.deadline
        if due is not None and due <= now:
            self._clock.begin()
            outputs = self._intake.advance(now)
            self._ledger.note(Step(now=now, clocks=self._clock.were_read))
            self._tell(outputs, now)
        else:
            self._tell([], now)

    def take(self, received: Received) -> None:
        request = self.desk.take(received)
        message = request or received.message
        is_unaccepted = request is None and isinstance(message, RequestEvent | SignalTurn | Cancel)
        if reads(message) and not is_unaccepted:
            content = Input(
                received.key, message, received.source, received.at, received.past, received.life
            )  # fmt: skip
            self._take(content, 0 if request is not None else received.number)

    def _cancel(self, cancel: Cancel) -> None:
        self._take(Input(keys.cancel("recognition"), cancel, "", self._bus.now()), 0)

    def _take(self, input: Input, number: int) -> None:
        now = self._bus.now()
        self._clock.begin()
        outputs = self._intake.take(input, now)
        self._ledger.note(step_of(input, number, now, self._clock.were_read))
        self._tell(outputs, now)

    def _tell(self, outputs: Iterable[Output], now: Seconds) -> None:
        """Carry out what a step led to. The steps are told before: a recording has all that its events came from."""
        outputs = tuple(outputs)
        due = self._ledger.deadline
        if outputs or self._ledger.is_full or (due is not None and due <= now):
            told = self._ledger.portion(now, is_heard=self._bus.is_heard(keys.TAKEN))
            if told is not None:
                self._bus.publish(keys.TAKEN, told)
        self._carry_out(outputs)

    def _carry_out(self, outputs: Iterable[Output]) -> None:
        for output in outputs:
            match output:
                case PublishMessage(key=key, message=message):
                    self._bus.publish(key, message)
                case WithdrawStates(states=states):
                    self._bus.withdraw(*states)
                case AnswerRequest(answer=Accepted(id=id, within=within)):
                    self.desk.accept(id, within)
                case AnswerRequest(answer=Refused(id=id, fault=fault)):
                    self.desk.refuse(id, fault)
                case AnswerRequest(answer=outcome):
                    self.desk.end(outcome)
                case Mistake(error=error, what=what, request=request):
                    fault = self._bus.failed(error, what)
                    if request and self.desk.is_live(request):
                        self.desk.refuse(request, fault)

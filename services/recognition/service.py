"""The recognition service: feeds recognition from the bus and publishes what comes out. It decides nothing.

States on the bus end with the process that told them, so that nobody could give them back to it. So the last ones are
kept in a file for the next life (`FormerLife`, decision 0183).
"""

import asyncio
import os
from collections.abc import Callable, Iterator
from itertools import takewhile
from pathlib import Path
from typing import TypeVar, get_args

import msgspec
from msgspec import DecodeError, Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent, Interjection, RequestEvent, SignalTurn, session_of
from engage_hri.schemas.requests import Cancel
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import LATE
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.intake import Former, Intake, reads
from engage_hri.services.recognition.statistics.tally import is_same_start
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


ORDER = get_args(Former)
"""Order in which they are recalled."""
WINDOW: Seconds = RecognitionConfig().window


class FormerLife:
    """The last states of recognition, and its recent events. path: of the file; empty: nothing is kept.

    window: length of the recent window.
    """

    def __init__(self, path: str, window: Seconds = WINDOW) -> None:
        self._path = Path(path) if path else None
        self._window = window
        self._events: dict[str, ConnectionEvent] = {}
        """Events of the recent window, by id: each as started, or as decided."""
        self._began: dict[str, Seconds] = {}
        """When the events of the window began, and what people have said into the robot's words, by their keys."""
        self._kept: dict[str, bytes] = {}
        """States of this life, by key: as they are in the file, or will be once all has been recalled."""
        self._is_recalled = True

    def recall(self) -> Iterator[Former]:
        """Read what a former life has kept: recent events, counts, who is the same, words, and then open pairs.

        The file stays as it is until the last of it has been taken: until then nothing else has all of it, should
        this life end now. Raises OSError or `msgspec.DecodeError` at once.
        """
        if self._path is None or not self._path.exists():
            return iter(())
        states = [msgspec.json.decode(line, type=Former) for line in self._path.read_bytes().splitlines()]
        return self._hand_over(sorted(states, key=lambda state: ORDER.index(type(state))))

    def _hand_over(self, states: list[Former]) -> Iterator[Former]:
        self._is_recalled = False
        for state in states:
            if isinstance(state, ConnectionEvent):
                self._keep_event(state)
            elif isinstance(state, Interjection):
                self._keep_interjection(state)
            yield state
        self._is_recalled = True

    def keep(self, key: str, message: Message) -> None:
        """Keep a state in place of the one before, or an event; other messages are not kept."""
        if self._path is None:
            return
        if isinstance(message, ConnectionEvent):
            self._keep_event(message)  # the state that has changed with it is told next, and written
        elif isinstance(message, Interjection):
            self._keep_interjection(message)
            self._write(self._path)
        elif isinstance(message, Former):
            self._kept[key] = msgspec.json.encode(message)
            self._write(self._path)

    def _keep_event(self, event: ConnectionEvent) -> None:
        """Keep an event as it is counted: as decided, by its latest names."""
        known = self._events.get(event.id)
        if event.state == "completed":
            return
        if event.retold and known is not None:
            event = replace(known, initiator=event.initiator, responder=event.responder)
        elif event.retold:
            self._drop([id for id, each in self._events.items() if is_same_start(each, event)])
        self._events[event.id] = event
        self._keep_recent(event.id, event, event.started.seconds)

    def _keep_interjection(self, told: Interjection) -> None:
        """Keep what was last told of a speech into the robot's words."""
        since = told.since.seconds
        self._keep_recent(f"{keys.interjection(told.actor)}/{since}", told, since)

    def _keep_recent(self, id: str, event: ConnectionEvent | Interjection, began: Seconds) -> None:
        """Keep what began then, and no longer what began before the window."""
        self._began[id], self._kept[id] = began, msgspec.json.encode(event)
        until = event.at.seconds - self._window
        self._drop([*takewhile(lambda id: self._began[id] <= until, self._began)])

    def _drop(self, ids: list[str]) -> None:
        for id in ids:
            del self._began[id], self._kept[id]
            self._events.pop(id, None)

    def forget(self, states: tuple[str, ...]) -> None:
        """Keep no state of these keys any longer."""
        if self._path is not None and [self._kept.pop(key) for key in states if key in self._kept]:
            self._write(self._path)

    def _write(self, path: Path) -> None:
        """Write all states, once all have been recalled. Who is killed meanwhile leaves the file as it was."""
        if not self._is_recalled:
            return
        whole = path.with_name(path.name + ".new")
        whole.write_bytes(b"\n".join(self._kept.values()))
        os.replace(whole, path)

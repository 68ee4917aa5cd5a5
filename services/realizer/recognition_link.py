"""Connection events and turn signals: the behaviors that recognition realizes, and the clock if it is not there."""

import asyncio
from collections.abc import Callable, Mapping

from msgspec import Struct

from schemas import keys
from schemas.behaviors import Event, TurnSignal
from schemas.blocks import Block
from schemas.faults import EngageError
from schemas.recognition import EventOutcome, RequestEvent, SignalTurn
from schemas.units import Seconds
from services.bus import Bus
from services.realizer.config import RealizerConfig
from services.realizer.patience import event_deadline
from services.realizer.points import Point
from services.realizer.schedule import EPSILON
from services.requests import Pending, Requester, RequestRefused


class Decision(Struct, frozen=True):
    """When an event was decided; by recognition, or by us for want of it."""

    at: Seconds
    by_recognition: bool


class RecognitionLink:
    """Asks recognition for the events of one block."""

    def __init__(
        self, bus: Bus, requests: Requester, config: RealizerConfig, is_there: Callable[[str], bool]
    ) -> None:
        self._bus = bus
        self._requests = requests
        self._config = config
        self._is_there = is_there

    def signal(self, id: str, block: str, signal: TurnSignal) -> None:
        """Tell it what became of a turn. Nobody waits for the answer."""
        message = SignalTurn(id=id, requester=self._bus.name, signal=signal, at=self._bus.stamp(), block=block)
        if self._is_there("recognition"):
            self._requests.send(keys.TURN, message)
        else:
            self._bus.publish(keys.TURN, message)

    def ask(self, id: str, block: str, event: Event, began: Seconds) -> Pending | None:
        """Request the event; None if nobody is there to decide it."""
        if not self._is_there("recognition"):
            return None
        request = RequestEvent(id=id, requester=self._bus.name, block=block, event=event, at=self._bus.stamp(began))
        return self._requests.send(keys.EVENT, request)

    async def decision(
        self, event: Event, block: Block, pending: Pending | None, reached: Mapping[Point, Seconds]
    ) -> Decision:
        """Wait for it, however it comes about. reached: the facts so far, as they grow. Raises RequestRefused."""
        while True:
            deadline = event_deadline(event, block, reached, self._config, is_heard=pending is not None)
            remaining = deadline - self._bus.now()
            if pending is None:
                if remaining <= EPSILON:
                    return Decision(self._bus.now(), False)
                await asyncio.sleep(remaining)
                continue  # An anchor may have been realised meanwhile, and the limit runs from there.
            await asyncio.wait([pending.outcome], timeout=max(0.0, remaining))
            if pending.outcome.done():
                try:
                    decided = await pending.outcome
                except RequestRefused:
                    raise
                except EngageError:
                    pending = None  # It died.
                    continue
                assert isinstance(decided, EventOutcome)
                return Decision(self._bus.local(decided.at), True)
            if remaining <= EPSILON:
                pending = None

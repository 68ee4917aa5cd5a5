"""Requests of one block to recognition: connection events and turn signals.

Recognition may not be there, or die. Then the clock decides its events, so who is on the bus is followed here.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

from engage_hri.schemas import keys
from engage_hri.schemas.behavior_types import canonical_sync
from engage_hri.schemas.behaviors import Event, Speech, TurnSignal
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import EventOutcome, RequestEvent, SignalTurn
from engage_hri.schemas.references import SyncRef, type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Silences
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.net.facts import Facts
from engage_hri.services.realizer.points import EPSILON, Point
from engage_hri.services.requests.ends import Pending, Requester, RequestRefused, ServerRestarted


class Presence:
    """Services that are, or were, on the bus; not managers: ever new ones come. changed: at the next change."""

    def __init__(self) -> None:
        self._is_there: dict[str, bool] = {}
        self._loop = asyncio.get_running_loop()
        self.changed: asyncio.Future[None] = self._loop.create_future()

    def feed(self, message: PeerAlive | PeerGone) -> None:
        if message.participant in keys.SERVICES:
            self._is_there[message.participant] = isinstance(message, PeerAlive)
            self.changed.set_result(None)
            self.changed = self._loop.create_future()

    def has_left(self, participant: str) -> bool:
        """True if the participant was there and is not now."""
        return not self._is_there.get(participant, True)

    def __contains__(self, participant: str) -> bool:
        return self._is_there.get(participant, False)


UNTOLD: Seconds = 2.5
"""Limit of an event where neither the block nor recognition names one, because recognition is not there. Nobody can
say then what the person does: the robot leaves the time in which most people follow a point or begin to answer."""
GRACE: Seconds = 0.5
"""Time after its limit at which an event ends as failed if recognition is not there to decide it."""


def event_deadline(event: Event, block: Block, reached: Mapping[Point, Seconds]) -> Seconds:
    """Time at which an event has failed, if recognition is not there to decide it.

    The limit counts from the start or from the last of the anchors that are reached by now.
    """
    anchors = (reached.get(_point(text, block)) for text in event.anchors)
    since = max(time for time in (reached[Point(event.id, "start")], *anchors) if time is not None)
    return since + (event.limit or UNTOLD) + GRACE


def _point(text: str, block: Block) -> Point:
    ref = SyncRef.parse(text)
    behavior = next((each for each in block.behaviors if each.id == ref.behavior), None)
    if isinstance(behavior, Speech):
        ref = SyncRef.parse(text, [mark.id for mark in behavior.marks])
    sync = canonical_sync(ref.sync, type_name(behavior) if behavior else "", block.dialect)
    return Point(ref.behavior, sync)


UNPROMISED: Seconds = 30.0
"""Time from the robot's last deed that a recognizer has which promises none, before its event is given up."""


class Decision(NamedTuple):
    """Time of an event's decision; by recognition, or by the realizer if recognition does not decide."""

    at: Seconds
    by_recognition: bool


class RecognitionLink(NamedTuple):
    """Asks recognition for the events of one block. deeds: times when the robot last did something of each block."""

    bus: Bus
    requests: Requester
    peers: Presence
    deeds: Callable[[], Iterable[Seconds]]

    def signal(self, id: str, block: str, signal: TurnSignal) -> None:
        """Tell recognition what became of a turn. The answer does not matter."""
        message = SignalTurn(id=id, signal=signal, at=self.bus.stamp(), block=block)
        if "recognition" in self.peers:
            self.requests.send(keys.TURN, message)
        else:
            self.bus.publish(keys.command(keys.TURN, self.bus.role, self.bus.name), message)

    def ask(self, id: str, block: str, event: Event, began: Seconds) -> Pending | None:
        """Request the event; None if recognition is not there to decide it."""
        if "recognition" not in self.peers:
            return None
        request = RequestEvent(id=id, block=block, event=event, at=self.bus.stamp(began))
        return self.requests.send(keys.EVENT, request)

    async def decision(self, event: Event, block: Block, pending: Pending | None, facts: Facts) -> Decision:
        """Wait for the decision of an event. Raises RequestRefused.

        Recognition decides as long as it is there, in the time that it has promised: counted from the last deed of
        the robot, since the turn may go on in other blocks. Else the clock does. The time for which the event is held
        is not counted. facts: those of the block, as they grow.
        """
        began = deed = facts.reached[Point(event.id, "start")]
        time = Silences[str](self.bus.sight)
        while True:
            if pending is not None and pending.outcome.done():
                try:
                    decided = await pending.outcome
                except RequestRefused:
                    raise
                except ServerRestarted:
                    return Decision(self.bus.now(), False)  # Its new life knows nothing of the event.
                except EngageError:
                    pending = None  # Recognition has died.
                    continue
                at = self.bus.local(decided.at) if isinstance(decided, EventOutcome) else self.bus.now()
                return Decision(at, True)
            now = self.bus.now()
            deed = max(deed, *self.deeds())
            if pending is None or "recognition" not in self.peers:
                due = event_deadline(event, block, facts.reached)
            else:
                due = deed + (UNPROMISED if pending.within is None else pending.within)
            time.keep("decision", due + facts.held_between(began, now, event.id), now)
            if time.due(now + EPSILON) is not None:
                if pending is not None:
                    late = self.bus.sight.fault("no decision in time", "", "late", "recognition", "", deed)
                    self.requests.cancel(pending.request.id, late)
                return Decision(self.bus.now(), False)
            assert time.earliest is not None
            # The deadline is computed again after this: meanwhile points were reached, or the promise was heard.
            news: list[asyncio.Future[Any]] = [self.peers.changed]
            if pending is not None:
                news += [each for each in (pending.outcome, pending.accepted) if not each.done()]
            await asyncio.wait(news, timeout=time.earliest - now, return_when=asyncio.FIRST_COMPLETED)

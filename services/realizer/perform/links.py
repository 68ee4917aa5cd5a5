"""Requests of one block to others: behaviors to the body, connection events and turn signals to recognition.

Recognition may not be there, or die. Then the clock decides its events, so who is on the bus is followed here.
"""

import asyncio
from collections.abc import Callable, Iterable
from typing import Any

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import BlockBehavior, Event, TurnSignal
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import GoHome, PerformBehavior, PlannedInstant
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import EventOutcome, RequestEvent, SignalTurn
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.decide.decisions import Begin, Extend
from engage_hri.services.realizer.decide.lateness import event_deadline
from engage_hri.services.realizer.net.facts import Facts
from engage_hri.services.realizer.points import EPSILON, Point
from engage_hri.services.requests.deadlines import Silences
from engage_hri.services.requests.ends import Pending, Requester, RequestRefused, ServerRestarted


class Presence:
    """Services that are, or were, on the bus; not managers: ever new ones come. changed: at the next change."""

    def __init__(self) -> None:
        self._there: set[str] = set()
        self._left: set[str] = set()
        self._loop = asyncio.get_running_loop()
        self.changed: asyncio.Future[None] = self._loop.create_future()

    def feed(self, message: PeerAlive | PeerGone) -> None:
        if message.participant not in keys.SERVICES:
            return
        now, before = (self._there, self._left) if isinstance(message, PeerAlive) else (self._left, self._there)
        now.add(message.participant)
        before.discard(message.participant)
        self.changed.set_result(None)
        self.changed = self._loop.create_future()

    def has_left(self, participant: str) -> bool:
        """True if the participant was there and is not now."""
        return participant in self._left

    def __contains__(self, participant: str) -> bool:
        return participant in self._there


LONGEST_WAY: Seconds = 10.0
"""Most seconds on the way home; a body that does not say that it is there is not asked for longer."""


class ControlLink:
    """Sends the body what one block asks of it.

    request: the id of the block's request; that of a behavior is `<request>/<behavior>`, with `%2F` for a slash in
    the behavior's, so that no two are alike. Ids of behaviors hold no colon.
    """

    def __init__(self, bus: Bus, requests: Requester, request: str, block: str, config: RealizerConfig) -> None:
        self._bus = bus
        self._requests = requests
        self._request = request
        self._block = block
        self._held_after = config.held_after

    def id(self, behavior: str) -> str:
        """Id of the request for a behavior, to whatever service performs it."""
        quoted = behavior.replace("%", "%25").replace("/", "%2F")
        return f"{self._request}/{quoted}"

    def perform(self, behavior: BlockBehavior, asked: Begin | Extend) -> Pending:
        """Ask the body to begin a behavior, or to go on as far as is asked."""
        perform = PerformBehavior(
            id=self.id(behavior.id),
            block=self._block,
            behavior=behavior,
            through=asked.through.partition(":")[0],  # without the number of a repeated stroke
            pace=tuple(PlannedInstant(sync=sync, at=self._bus.stamp(at)) for sync, at in asked.pace),
            held=isinstance(asked, Extend) and asked.held,
            held_after=self._held_after,
        )
        return self._requests.send(keys.BEHAVIOR, perform)

    def cancel(self, behavior: str, why: Fault | str) -> None:
        """Cancel the request for a behavior, to whatever service performs it. why: what has happened."""
        self._requests.cancel(self.id(behavior), why)

    def go_home(self, parts: Iterable[str], behavior: str = "") -> None:
        """Send these parts home. behavior: the one that used them; empty: the whole block."""
        going = GoHome(id=f"{self.id(behavior)}:home", parts=tuple(sorted(parts)))
        self._requests.send(keys.BEHAVIOR, going, within=LONGEST_WAY)


UNPROMISED: Seconds = 30.0
"""Time from the robot's last deed that a recognizer has which promises none, before its event is given up."""


class Decision(Struct, frozen=True):
    """Time of an event's decision; by recognition, or by the realizer if recognition does not decide."""

    at: Seconds
    by_recognition: bool


class RecognitionLink:
    """Asks recognition for the events of one block."""

    def __init__(
        self, bus: Bus, requests: Requester, peers: Presence, deeds: Callable[[], Iterable[Seconds]]
    ) -> None:
        """deeds: times when the robot last did something of each block."""
        self._bus = bus
        self._requests = requests
        self._peers = peers
        self._deeds = deeds

    def signal(self, id: str, block: str, signal: TurnSignal) -> None:
        """Tell recognition what became of a turn. The answer does not matter."""
        message = SignalTurn(id=id, signal=signal, at=self._bus.stamp(), block=block)
        if "recognition" in self._peers:
            self._requests.send(keys.TURN, message)
        else:
            self._bus.publish(keys.command(keys.TURN, self._bus.role, self._bus.name), message)

    def ask(self, id: str, block: str, event: Event, began: Seconds) -> Pending | None:
        """Request the event; None if recognition is not there to decide it."""
        if "recognition" not in self._peers:
            return None
        request = RequestEvent(id=id, block=block, event=event, at=self._bus.stamp(began))
        return self._requests.send(keys.EVENT, request)

    async def decision(self, event: Event, block: Block, pending: Pending | None, facts: Facts) -> Decision:
        """Wait for the decision of an event. Raises RequestRefused.

        Recognition decides as long as it is there, in the time that it has promised: counted from the last deed of
        the robot, since the turn may go on in other blocks. Else the clock does. The time for which the event is held
        is not counted. facts: those of the block, as they grow.
        """
        began = deed = facts.reached[Point(event.id, "start")]
        time = Silences[str](self._bus.sight)
        while True:
            if pending is not None and pending.outcome.done():
                try:
                    decided = await pending.outcome
                except RequestRefused:
                    raise
                except ServerRestarted:
                    return Decision(self._bus.now(), False)  # Its new life knows nothing of the event.
                except EngageError:
                    pending = None  # Recognition has died.
                    continue
                at = self._bus.local(decided.at) if isinstance(decided, EventOutcome) else self._bus.now()
                return Decision(at, True)
            now = self._bus.now()
            deed = max(deed, *self._deeds())
            if pending is None or "recognition" not in self._peers:
                due = event_deadline(event, block, facts.reached)
            else:
                due = deed + (UNPROMISED if pending.within is None else pending.within)
            time.keep("decision", due + facts.held_between(began, now, event.id), now)
            if time.due(now + EPSILON) is not None:
                if pending is not None:
                    late = self._bus.sight.fault("no decision in time", "", "late", "recognition", "", deed)
                    self._requests.cancel(pending.request.id, late)
                return Decision(self._bus.now(), False)
            assert time.earliest is not None
            # The deadline is computed again after this: meanwhile points were reached, or the promise was heard.
            news: list[asyncio.Future[Any]] = [self._peers.changed]
            if pending is not None:
                news += [each for each in (pending.outcome, pending.accepted) if not each.done()]
            await asyncio.wait(news, timeout=time.earliest - now, return_when=asyncio.FIRST_COMPLETED)

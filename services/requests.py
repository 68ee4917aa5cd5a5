"""Long requests over a bus that neither raises nor acknowledges: both ends of `schemas.requests`.

Zenoh drops silently, a server may start late, restart or die, a link may be cut. So the requester sends its
request again until it has ended, the server answers duplicates with its last state, and the death of either
side ends the request at the other: exactly one terminal state, whatever happens in between.
"""

import asyncio
from collections import OrderedDict
from types import TracebackType
from typing import Protocol, Self

import msgspec

from schemas import keys
from schemas.faults import EngageError, Fault, RunFailed
from schemas.messages import Message
from schemas.presence import PeerAlive, PeerGone
from schemas.requests import Accepted, Cancel, Outcome, Refused, Request
from schemas.units import Seconds
from services.bus import Bus, Received

FIRST_RESEND: Seconds = 0.3
LONGEST_RESEND: Seconds = 2.0
GRACE: Seconds = 2.0
"""How long the other side may be gone before its requests fail: a router's restart looks like a death."""
ENDED_KEPT = 1024
"""How many ended requests a server remembers, to answer duplicates."""


class RequestRefused(EngageError):
    """The server refused; nothing of the request was done."""


class Pending:
    """A request on its way. Both futures raise RequestRefused, or RunFailed if the server died."""

    def __init__(self, key: str, request: Request) -> None:
        loop = asyncio.get_running_loop()
        self.key = key
        self.request = request
        self.accepted: asyncio.Future[None] = loop.create_future()
        self.outcome: asyncio.Future[Outcome] = loop.create_future()
        self.resend_after = FIRST_RESEND
        self.resend: asyncio.TimerHandle | None = None
        self.doom: asyncio.TimerHandle | None = None
        # A caller may care for only one of the two.
        for future in (self.accepted, self.outcome):
            future.add_done_callback(_mark_seen)


def _mark_seen(future: "asyncio.Future[None] | asyncio.Future[Outcome]") -> None:
    if not future.cancelled():
        future.exception()


class Requester:
    """The asking side, for any number of requests at once.

    `async with Requester(bus) as requests` listens by itself. A service that wants request states in order with
    its other messages subscribes to `Requester.PATTERNS` itself and passes every message to `feed` instead.
    """

    PATTERNS = (keys.ANY_REQUEST_STATE, keys.ANY_ALIVE)

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._loop = asyncio.get_running_loop()
        self._pending: dict[str, Pending] = {}
        self._listening: asyncio.Task[None] | None = None

    def send(self, key: str, request: Request) -> Pending:
        """Publish the request and keep at it. A known id is an update: the newest content is what is sent again."""
        pending = self._pending.get(request.id)
        if pending is None:
            pending = self._pending[request.id] = Pending(key, request)
            self._arm(pending)
        pending.request = request
        self._bus.publish(key, _as_message(request))
        return pending

    def cancel(self, id: str, reason: str = "") -> None:
        """Ask the server to end request `id` as interrupted; its outcome still comes."""
        if pending := self._pending.get(id):
            cancel = Cancel(id=id, requester=self._bus.name, reason=reason)
            pending.key, pending.request = keys.cancel(keys.server_of(pending.key)), cancel
            self._bus.publish(pending.key, cancel)

    def feed(self, received: Received) -> bool:
        """Take a message of `PATTERNS`; False if it was none of ours."""
        match received.message:
            case Accepted(id=id) if id in self._pending:
                if not self._pending[id].accepted.done():
                    self._pending[id].accepted.set_result(None)
            case Refused(id=id, fault=fault) if id in self._pending:
                self._fail(id, RequestRefused(fault))
            case Outcome(id=id) if id in self._pending:
                pending = self._forget(id)
                if not pending.accepted.done():
                    pending.accepted.set_result(None)
                pending.outcome.set_result(received.message)
            case PeerGone(participant=server):
                self._server_gone(server)
            case PeerAlive(participant=server):
                self._server_back(server)
            case _:
                return False
        return True

    def _arm(self, pending: Pending) -> None:
        pending.resend = self._loop.call_later(pending.resend_after, self._send_again, pending)

    def _send_again(self, pending: Pending) -> None:
        self._bus.publish(pending.key, _as_message(pending.request))
        pending.resend_after = min(2 * pending.resend_after, LONGEST_RESEND)
        self._arm(pending)

    def _server_gone(self, server: str) -> None:
        for pending in self._pending.values():
            if keys.server_of(pending.key) == server and pending.doom is None:
                pending.doom = self._loop.call_later(GRACE, self._server_lost, pending, server)

    def _server_back(self, server: str) -> None:
        for pending in self._pending.values():
            if keys.server_of(pending.key) == server:
                if pending.doom is not None:
                    pending.doom.cancel()
                    pending.doom = None
                self._bus.publish(pending.key, _as_message(pending.request))

    def _server_lost(self, pending: Pending, server: str) -> None:
        fault = Fault(reason=f"{server} is gone", where=pending.request.id, advice=f"start {server} again")
        self._fail(pending.request.id, RunFailed(fault))

    def _fail(self, id: str, error: EngageError) -> None:
        pending = self._forget(id)
        for future in (pending.accepted, pending.outcome):
            if not future.done():
                future.set_exception(error)

    def _forget(self, id: str) -> Pending:
        pending = self._pending.pop(id)
        for timer in (pending.resend, pending.doom):
            if timer is not None:
                timer.cancel()
        return pending

    def close(self) -> None:
        """Stop sending again; what has not ended is cancelled at its server."""
        for id in list(self._pending):
            self.cancel(id, "requester closed")
            pending = self._forget(id)
            pending.accepted.cancel()
            pending.outcome.cancel()

    async def _listen(self) -> None:
        with self._bus.subscribe(*self.PATTERNS) as inbox:
            async for received in inbox:
                self.feed(received)

    async def __aenter__(self) -> Self:
        self._listening = asyncio.create_task(self._listen(), name=f"requests of {self._bus.name}")
        await asyncio.sleep(0)
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
        if self._listening is not None:
            self._listening.cancel()
            await asyncio.gather(self._listening, return_exceptions=True)


class _Record(msgspec.Struct):
    request: Request
    state: Message | None = None
    ended: bool = False
    doom: asyncio.TimerHandle | None = None


class Clerk(Protocol):
    """What a server does when a requester has died: the cancellation it would have sent."""

    def __call__(self, cancel: Cancel) -> None: ...


class RequestDesk:
    """The serving side: takes commands from the service's own subscription, answers, and never serves one twice.

        match desk.take(received):
            case PerformBlock() as request: ...         # new, or updated (`desk.is_live` was true before)
            case Cancel(id=id): ...                     # only for live requests
            case None: ...                              # not ours, a duplicate, or already ended

    on_cancel: called when a requester has been gone for longer than the grace.
    The service's subscription must hold `RequestDesk.patterns(server)`.
    """

    def __init__(self, bus: Bus, server: str, on_cancel: Clerk) -> None:
        self._bus = bus
        self._server = server
        self._on_cancel = on_cancel
        self._loop = asyncio.get_running_loop()
        self._records: OrderedDict[str, _Record] = OrderedDict()

    @staticmethod
    def patterns(server: str) -> tuple[str, str]:
        return (keys.commands(server), keys.ANY_ALIVE)

    def is_live(self, id: str) -> bool:
        return id in self._records and not self._records[id].ended

    def take(self, received: Received) -> Request | None:
        """The request, if it is new, changed or a cancellation of a live one."""
        match received.message:
            case Cancel(id=id) as cancel:
                return cancel if self._repeat_unless_live(id) else None
            case Request(id=id) as request if keys.matches(keys.commands(self._server), received.key):
                record = self._records.get(id)
                if record is None:
                    self._records[id] = _Record(request)
                    return request
                if record.ended or record.request == request:
                    self._repeat(record)
                    return None
                record.request = request
                return request
            case PeerGone(participant=requester):
                self._requester_gone(requester)
            case PeerAlive(participant=requester):
                self._requester_back(requester)
        return None

    def accept(self, id: str) -> None:
        self._answer(id, Accepted(id=id), ended=False)

    def refuse(self, id: str, fault: Fault) -> None:
        self._answer(id, Refused(id=id, fault=fault), ended=True)

    def end(self, outcome: Message) -> None:
        """Answer with a terminal state. Raises ValueError if the request has one already."""
        assert isinstance(outcome, Outcome)
        self._answer(outcome.id, outcome, ended=True)

    def _answer(self, id: str, state: Message, *, ended: bool) -> None:
        record = self._records[id]
        if record.ended:
            raise ValueError(f"request {id} has ended already, with {record.state}")
        record.state, record.ended = state, ended
        self._bus.publish(keys.request_state(self._server), state)
        if ended:
            if record.doom is not None:
                record.doom.cancel()
            self._records.move_to_end(id)
            self._forget_oldest_ended()

    def _forget_oldest_ended(self) -> None:
        ended = [id for id, record in self._records.items() if record.ended]
        for id in ended[:-ENDED_KEPT]:
            del self._records[id]

    def _repeat_unless_live(self, id: str) -> bool:
        if self.is_live(id):
            return True
        if record := self._records.get(id):
            self._repeat(record)
        return False

    def _repeat(self, record: _Record) -> None:
        if record.state is not None:
            self._bus.publish(keys.request_state(self._server), record.state)

    def _requester_gone(self, requester: str) -> None:
        for record in self._records.values():
            if record.request.requester == requester and not record.ended and record.doom is None:
                record.doom = self._loop.call_later(GRACE, self._requester_lost, record)

    def _requester_back(self, requester: str) -> None:
        for record in self._records.values():
            if record.request.requester == requester and record.doom is not None:
                record.doom.cancel()
                record.doom = None

    def _requester_lost(self, record: _Record) -> None:
        request = record.request
        self._on_cancel(Cancel(id=request.id, requester=request.requester, reason="requester is gone"))

    def close(self) -> None:
        for record in self._records.values():
            if record.doom is not None:
                record.doom.cancel()


def _as_message(request: Request) -> Message:
    return request  # type: ignore[return-value]

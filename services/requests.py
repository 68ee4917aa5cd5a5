"""Long requests over a bus that neither raises nor acknowledges: both ends of `schemas.requests`.

Zenoh drops silently, a server may start late, restart or die, a link may be cut. So the requester sends its
request again until it has ended, the server answers duplicates with its last state, and the death of either
side ends the request at the other: exactly one terminal state, whatever happens in between.

A restarted server remembers nothing. What its former life had accepted fails at the requester and is not sent
again: a robot must not say and do things twice. What had not been accepted is sent again. The gap that remains
is an acceptance lost in the same moment as its server; its request is performed again from the start.
A server leaves commands that it gets from history to their requester, who knows what became of them.
"""

import asyncio
from collections import OrderedDict
from types import TracebackType
from typing import Protocol, Self

import msgspec

from schemas import keys
from schemas.faults import EngageError, Fault, RunFailed
from schemas.messages import COMMANDS, Message
from schemas.presence import PeerAlive, PeerGone
from schemas.requests import Accepted, Cancel, Outcome, Refused, Request, Unreadable
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
        self.run = ""
        """The life of the server that accepted."""
        self.resend_after = FIRST_RESEND
        self.resend: asyncio.TimerHandle | None = None
        self.doom: asyncio.TimerHandle | None = None
        # A caller may care for only one of the two.
        for future in (self.accepted, self.outcome):
            future.add_done_callback(_mark_seen)

    @property
    def server(self) -> str:
        return keys.server_of(self.key)


def _mark_seen(future: "asyncio.Future[None] | asyncio.Future[Outcome]") -> None:
    if not future.cancelled():
        future.exception()


class Requester:
    """The asking side, for any number of requests at once.

    `async with Requester(bus) as requests` listens by itself. A service that wants request states in order with
    its other messages subscribes to `Requester.PATTERNS` itself and passes every message to `feed` instead.
    A request to a server that has not come yet waits for it.
    """

    PATTERNS = (keys.ANY_REQUEST_STATE, keys.ANY_ALIVE)

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._loop = asyncio.get_running_loop()
        self._pending: dict[str, Pending] = {}
        self._runs: dict[str, str] = {}
        self._listening: asyncio.Task[None] | None = None

    def send(self, key: str, request: Request) -> Pending:
        """Publish the request and keep at it. A known id is an update: the newest content is what is sent again.

        An update of a request that is being cancelled is void.
        """
        pending = self._pending.get(request.id)
        if pending is None:
            pending = self._pending[request.id] = Pending(key, request)
        elif isinstance(pending.request, Cancel):
            return pending
        else:
            revision = pending.request.revision + 1
            pending.key, pending.request = key, msgspec.structs.replace(request, revision=revision)
        self._publish_anew(pending)
        return pending

    def cancel(self, id: str, reason: str = "") -> None:
        """Ask the server to end request `id` as interrupted; its outcome still comes.

        A server that has never got the request refuses it.
        """
        pending = self._pending.get(id)
        if pending is not None and not isinstance(pending.request, Cancel):
            pending.key = keys.cancel(pending.server)
            pending.request = Cancel(id=id, requester=self._bus.name, reason=reason)
            self._publish_anew(pending)

    def feed(self, received: Received) -> bool:
        """Take a message of `PATTERNS`; False if it was none of ours."""
        match received.message:
            case Accepted(id=id) if id in self._pending:
                pending = self._pending[id]
                pending.run = self._runs.get(pending.server, "")
                if not pending.accepted.done():
                    pending.accepted.set_result(None)
            case Refused(id=id, fault=fault) if id in self._pending:
                # A server that has forgotten what it accepted has failed at it.
                known = self._pending[id].accepted.done()
                self._fail(id, RunFailed(fault) if known else RequestRefused(fault))
            case Outcome(id=id) if id in self._pending:
                pending = self._forget(id)
                if not pending.accepted.done():
                    pending.accepted.set_result(None)
                pending.outcome.set_result(received.message)
            case PeerGone(participant=server):
                self._server_gone(server)
            case PeerAlive(participant=server, run=run):
                self._server_back(server, run)
            case _:
                return False
        return True

    def _publish_anew(self, pending: Pending) -> None:
        if pending.resend is not None:
            pending.resend.cancel()
        pending.resend_after = FIRST_RESEND
        self._bus.publish(pending.key, _as_message(pending.request))
        self._arm(pending)

    def _arm(self, pending: Pending) -> None:
        pending.resend = self._loop.call_later(pending.resend_after, self._send_again, pending)

    def _send_again(self, pending: Pending) -> None:
        self._bus.publish(pending.key, _as_message(pending.request))
        pending.resend_after = min(2 * pending.resend_after, LONGEST_RESEND)
        self._arm(pending)

    def _server_gone(self, server: str) -> None:
        for pending in self._pending.values():
            if pending.server == server and pending.doom is None:
                pending.doom = self._loop.call_later(GRACE, self._server_lost, pending, f"{server} is gone")

    def _server_back(self, server: str, run: str) -> None:
        self._runs[server] = run
        for pending in [pending for pending in self._pending.values() if pending.server == server]:
            if pending.doom is not None:
                pending.doom.cancel()
                pending.doom = None
            if pending.run and run and pending.run != run:
                self._server_lost(pending, f"{server} was restarted")
            else:
                pending.run = run if pending.accepted.done() else ""
                self._publish_anew(pending)

    def _server_lost(self, pending: Pending, reason: str) -> None:
        fault = Fault(reason=reason, where=pending.request.id, advice="send it again under a new id")
        self._fail(pending.request.id, RunFailed(fault))
        # In case a new life has got it after all.
        cancel = Cancel(id=pending.request.id, requester=self._bus.name, reason=reason)
        self._bus.publish(keys.cancel(pending.server), cancel)

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
    """run: the requester's life. ended: `state` is terminal."""

    request: Request
    run: str = ""
    state: Message | None = None
    ended: bool = False
    cancelled: bool = False
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

    on_cancel: called when a requester has been gone for longer than the grace, or has come back as another life.
    The service's subscription must hold `RequestDesk.patterns(server)`.
    """

    def __init__(self, bus: Bus, server: str, on_cancel: Clerk) -> None:
        self._bus = bus
        self._server = server
        self._on_cancel = on_cancel
        self._loop = asyncio.get_running_loop()
        self._live: dict[str, _Record] = {}
        self._ended: OrderedDict[str, _Record] = OrderedDict()
        self._runs: dict[str, str] = {}

    @staticmethod
    def patterns(server: str) -> tuple[str, str]:
        return (keys.commands(server), keys.ANY_ALIVE)

    def is_live(self, id: str) -> bool:
        return id in self._live

    def take(self, received: Received) -> Request | None:
        """The request, if it is new, changed or a cancellation of a live one; each of these once."""
        match received.message:
            case Request() as request if keys.matches(keys.commands(self._server), received.key):
                if received.past and request.requester in self._runs:
                    return None
                if (fault := _misplaced(request, received.key)) is not None:
                    self._refuse_unseen(request.id, fault)
                    return None
                return self._take_cancel(request) if isinstance(request, Cancel) else self._take(request)
            case Unreadable(id=id, fault=fault) if id:
                self._refuse_unseen(id, fault)
            case PeerGone(participant=requester):
                self._requester_gone(requester)
            case PeerAlive(participant=requester, run=run):
                self._requester_back(requester, run)
        return None

    def _refuse_unseen(self, id: str, fault: Fault) -> None:
        """What was no request of ours. A live one of that id is somebody else's, and goes on."""
        if id not in self._live:
            self._bus.publish(keys.request_state(self._server), Refused(id=id, fault=fault))

    def _take(self, request: Request) -> Request | None:
        record = self._live.get(request.id) or self._ended.get(request.id)
        if record is None or (record.ended and not self._is_same_requester(record, request)):
            self._ended.pop(request.id, None)
            self._live[request.id] = _Record(request, self._runs.get(request.requester, ""))
            return request
        older = request.revision < record.request.revision
        if record.ended or record.cancelled or older or request == record.request:
            self._repeat(record)
            return None
        record.request = request
        return request

    def _take_cancel(self, cancel: Cancel) -> Cancel | None:
        record = self._live.get(cancel.id)
        if record is not None and not record.cancelled:
            record.cancelled = True
            return cancel
        record = record or self._ended.get(cancel.id)
        if record is not None:
            self._repeat(record)
        else:
            # The command was lost; from here on it is too late for it, and its requester waits for an end.
            self._live[cancel.id] = _Record(cancel, self._runs.get(cancel.requester, ""))
            reason = f"{self._server} has never heard of it"
            self.refuse(cancel.id, Fault(reason=reason, where=cancel.id, service=self._server))
        return None

    def _is_same_requester(self, record: _Record, request: Request) -> bool:
        """A new life, or somebody else, who uses an id again means a new request."""
        run = self._runs.get(request.requester, "")
        return record.request.requester == request.requester and (not record.run or not run or record.run == run)

    def accept(self, id: str) -> None:
        self._answer(id, Accepted(id=id), ended=False)

    def refuse(self, id: str, fault: Fault) -> None:
        self._answer(id, Refused(id=id, fault=fault), ended=True)

    def end(self, outcome: Message) -> None:
        """Answer with a terminal state. Raises ValueError if the request has one already, or never was."""
        assert isinstance(outcome, Outcome)
        self._answer(outcome.id, outcome, ended=True)

    def _answer(self, id: str, state: Message, *, ended: bool) -> None:
        record = self._live.get(id)
        if record is None:
            before = f"has ended already, with {self._ended[id].state}" if id in self._ended else "was never made"
            raise ValueError(f"request {id} {before}")
        record.state, record.ended = state, ended
        self._bus.publish(keys.request_state(self._server), state)
        if ended:
            if record.doom is not None:
                record.doom.cancel()
            self._ended[id] = self._live.pop(id)
            if len(self._ended) > ENDED_KEPT:
                self._ended.popitem(last=False)

    def _repeat(self, record: _Record) -> None:
        if record.state is not None:
            self._bus.publish(keys.request_state(self._server), record.state)

    def _live_of(self, requester: str) -> list[_Record]:
        return [record for record in self._live.values() if record.request.requester == requester]

    def _requester_gone(self, requester: str) -> None:
        self._runs.pop(requester, None)
        for record in self._live_of(requester):
            if record.doom is None:
                record.doom = self._loop.call_later(GRACE, self._requester_lost, record)

    def _requester_back(self, requester: str, run: str) -> None:
        self._runs[requester] = run
        for record in self._live_of(requester):
            if record.doom is not None:
                record.doom.cancel()
                record.doom = None
            if record.run and run and record.run != run:
                self._requester_lost(record)
            record.run = run

    def _requester_lost(self, record: _Record) -> None:
        if not record.cancelled:
            record.cancelled = True
            request = record.request
            self._on_cancel(Cancel(id=request.id, requester=request.requester, reason="requester is gone"))

    def close(self) -> None:
        for record in self._live.values():
            if record.doom is not None:
                record.doom.cancel()


def _misplaced(request: Request, key: str) -> Fault | None:
    """What is wrong with sending this request there; nothing on a key that we know nothing of."""
    expected = COMMANDS.get(key)
    if expected is None or isinstance(request, (Cancel, *expected)):
        return None
    name = type(request).__name__
    home = next((known for known, kinds in COMMANDS.items() if isinstance(request, kinds)), "")
    return Fault(
        reason=f"{name} came on {key}, which takes {' and '.join(kind.__name__ for kind in expected)}",
        where=request.id,
        service=keys.server_of(key),
        advice=f"send it on {home}" if home else "",
    )


def _as_message(request: Request) -> Message:
    return request  # type: ignore[return-value]

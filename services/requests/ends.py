"""Long requests over a bus that neither raises nor acknowledges: both ends of `schemas/requests.py`.

Zenoh drops silently, a server may start late, restart or die, a link may be cut, a caller may be cancelled at any
moment. What follows from each of these is in two tables (asking_table.py, serving_table.py), which two pure machines
follow (asking.py, serving.py). Here they meet the bus, the clock and the futures that callers await: each request has
exactly one terminal state, whatever happens in between.

A restarted server remembers nothing. What its former life had heard fails at the requester and is not sent again: a
robot must not say and do things twice. A server leaves commands from history to their requester.
"""

import asyncio
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any, Self, TypeVar

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import (
    EngageError,
    Fault,
    InputRefused,
    NeverEnded,
    OutcomeUnknown,
    RequestRefused,
    RunFailed,
    ServerRestarted,
)
from engage_hri.schemas.messages import COMMANDS, Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.requests import (
    Accepted,
    Answer,
    Cancel,
    KeepAlive,
    Outcome,
    Refused,
    Request,
    Unreadable,
    is_life_of,
)
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Silences
from engage_hri.services.bus.interface import Bus, Containing, Received, Subscription
from engage_hri.services.bus.samples import sender_of
from engage_hri.services.requests import asking, serving
from engage_hri.services.requests.asking import Asking, Patience
from engage_hri.services.requests.asking_table import AskingState
from engage_hri.services.requests.serving import Serving
from engage_hri.services.requests.serving_table import unwieldy
from engage_hri.services.runtime.loop import Alarm


def borrowed(life: str, received: Received, server: str) -> Fault | None:
    """A fault if a command names a life that is that of another process than its own; None otherwise."""
    if is_life_of(life, received.life):
        return None
    where = f"{received.key} from {received.source or 'a stranger'}"
    return Fault(reason=f"{life!r} is the life of another process; ignored", where=where, service=server)


def misplaced(request: Request, key: str) -> Fault | None:
    """A fault if this request must not be sent on this key, or has no id; None otherwise."""
    expression = keys.expression_of(key)
    expected = COMMANDS.get(expression, ())
    if request.id and (isinstance(request, expected) or (expression and isinstance(request, Cancel))):
        return None
    server, name = keys.server_of(key), type(request).__name__
    if not request.id:
        return Fault(reason=f"{name} without an id", where=key, service=server, advice="make one up: `id`")
    home = next((known for known, kinds in COMMANDS.items() if isinstance(request, kinds)), keys.cancel(server))
    takes = f"takes {' and '.join(kind.__name__ for kind in expected)}" if expected else "is no command"
    sender = key.split("/")[4:6] if expression else ["<role>", "<requester>"]
    advice = f"send it on {home.replace('*/*', '/'.join(sender))}" if home else ""
    return Fault(reason=f"{name} came on {key}, which {takes}", where=request.id, service=server, advice=advice)


F = TypeVar("F", bound=asyncio.Future[Any])


async def unfinished(awaited: Iterable[F], within: Seconds, bus: Bus) -> set[F]:
    """Wait until all of these are done, or their time is over. Returns those that are not."""
    left, time = {*awaited}, Silences[str](bus.sight)
    time.set("over", bus.now() + within)
    while left and time.due(bus.now()) is None:
        assert time.earliest is not None
        _, left = await asyncio.wait(left, timeout=time.earliest - bus.now())
    return left


News = Accepted | Outcome | EngageError | None
"""News of a request: its acceptance, None if that was lost and its end has come; its end."""


class Pending:
    """A request on its way. Both futures raise RequestRefused, or RunFailed if the server died or does not answer.

    Cancelling a future only stops waiting; `Requester.cancel` ends the request.
    """

    def __init__(self, key: str, request: Request, tell: Callable[[News], None] | None = None) -> None:
        """tell: called with the acceptance and with the end, each at once: in order with what else is heard."""
        loop = asyncio.get_running_loop()
        self._tell = tell or (lambda news: None)
        self.key = key
        self.request = request
        self.accepted: asyncio.Future[Accepted | None] = loop.create_future()
        self.outcome: asyncio.Future[Outcome] = loop.create_future()

    @property
    def server(self) -> str:
        return keys.server_of(self.key)

    @property
    def within(self) -> Seconds | None:
        """Time in which the server has promised to decide (see `Accepted`); None if it has promised none so far."""
        is_known = self.accepted.done() and not self.accepted.cancelled() and self.accepted.exception() is None
        answer = self.accepted.result() if is_known else None
        return answer.within if answer is not None else None

    def accept(self, answer: Accepted | None = None) -> None:
        """Note that the server has accepted the request. answer: None if that was lost, and its end has come."""
        if not self.accepted.done():
            self.accepted.set_result(answer)
            self._tell(answer)

    def end(self, end: Outcome | EngageError) -> None:
        if isinstance(end, Outcome):
            self.accept()
            if not self.outcome.done():
                self.outcome.set_result(end)
            self._tell(end)
            return
        for future in (self.accepted, self.outcome):
            if not future.done():
                future.set_exception(end)
                future.exception()  # marked as seen: a caller may await only one of the two
        self._tell(end)


__all__ = ["NeverEnded", "Patience", "Pending", "RequestDesk", "RequestRefused", "Requester", "ServerRestarted"]
_COMMANDS = (Request, KeepAlive)


class Requester:
    """The asking side, for any number of requests at once.

    `async with Requester(bus) as requests` listens by itself, from its first request on: a subscription that all
    clients share costs the router a step for each two of them. A service that wants request states in order with its
    other messages subscribes to `Requester.PATTERNS` itself and passes every message to `feed` instead.
    A request to a server that has not come yet waits for it. Raises ValueError if the bus' name can't be in a key.
    """

    PATTERNS = (keys.ANY_REQUEST_STATE, keys.ANY_ROBOT_ALIVE)

    def __init__(self, bus: Bus, patience: Patience | None = None) -> None:
        keys.chunk(bus.name)
        self._bus = bus
        self._life = bus.new_life()
        self._asking = Asking(bus.name, self._life, patience or Patience(), bus.sight)
        self._pending: dict[str, Pending] = {}
        self._alarm = Alarm(self._tick)
        self._listens = False
        self._listening: asyncio.Task[None] | None = None
        self._broken: EngageError | None = None

    def send(
        self,
        key: str,
        request: Request,
        within: Seconds | None = None,
        tell: Callable[[News], None] | None = None,
    ) -> Pending:
        """Publish the request and keep at it. A known id is an update: the newest content is what is sent again.

        key: the expression of the command (`keys.BLOCK`). within: seconds until it is cancelled. tell: see
        `Pending`; not for an update. An update of a
        request that is being cancelled is void. An id that a live request of another kind has, or one that was given
        up, is refused at once.
        """
        if self._broken is not None:
            return self._failed(key, request, self._broken, tell)
        if self._listens and self._listening is None:
            self._listen()
        effects = self._asking.send(key, request, self._bus.now(), within)
        match effects:
            case [asking.TellEnd(end=EngageError() as error)]:
                return self._failed(key, request, error, tell)
        if (pending := self._pending.get(request.id)) is None:
            pending = self._pending[request.id] = Pending(key, request, tell)
        pending.request = self._asking.request(request.id) or request
        self._carry_out(effects)
        return pending

    def _failed(self, key: str, request: Request, error: EngageError, tell: Callable[[News], None] | None) -> Pending:
        pending = Pending(key, request, tell)
        pending.end(error)
        return pending

    def cancel(self, id: str, why: Fault | str = "") -> None:
        """Ask the server to end request `id` as interrupted; its outcome still comes, or it fails for want of it.

        A server that has never got the request refuses it. why: told in the outcome, with its cause.
        """
        fault = why if isinstance(why, Fault) else Fault(reason=why)
        self._carry_out(self._asking.cancel(id, fault, self._bus.now()))

    def state(self, id: str) -> AskingState:
        """State of request `id`; ENDED if it is not known."""
        return self._asking.state(id)

    def feed(self, received: Received) -> None:
        """Take a message of `PATTERNS`; one of any other type is nothing to it."""
        message = received.message
        if isinstance(message, Answer):
            effects = self._asking.hear(message, self._bus.now(), keys.server_of(received.key))
            if effects:
                self._carry_out(effects)
        elif isinstance(message, PeerGone):
            self._carry_out(self._asking.server_gone(message.participant, self._bus.now()))
        elif isinstance(message, PeerAlive):
            self._carry_out(self._asking.server_there(message.participant, message.run, self._bus.now()))

    def _tick(self) -> None:
        self._carry_out(self._asking.tick(self._bus.now()))

    def _carry_out(self, effects: list[asking.Effect]) -> None:
        for effect in effects:  # isinstance is twice as quick as patterns, and this is done for each message
            if isinstance(effect, asking.PublishCommand):
                try:
                    self._publish(effect.expression, effect.message)  # type: ignore[arg-type]
                except Exception as error:
                    # At the end of this very list: it may be long.
                    effects += self._could_not_send(effect.message.id, error)
            elif isinstance(effect, asking.TellAccepted):
                if (pending := self._pending.get(effect.id)) is not None:
                    pending.accept(effect.answer)
            elif isinstance(effect, asking.TellEnd):
                if (ended := self._pending.pop(effect.id, None)) is not None:
                    ended.end(effect.end)
            elif isinstance(effect, asking.Renew):
                at, name = self._bus.stamp(), self._bus.name
                still = KeepAlive(live=effect.live, at=at, requester=name, life=self._life)
                self._publish(keys.keep_alive(effect.server), still)
            else:
                self._bus.publish(keys.fault(self._bus.name), effect.fault)
        self._alarm.set(self._asking.deadline)

    def _could_not_send(self, id: str, error: Exception) -> list[asking.Effect]:
        """End a request that has no encoded form (half a character in its text, for instance); the others go on."""
        fault = Fault(
            reason=str(error), where=id, advice="text in Unicode, numbers in their range, fields of their type"
        )
        if (pending := self._pending.pop(id, None)) is not None:
            pending.end(RequestRefused(error.fault if isinstance(error, InputRefused) else fault))
        return self._asking.forget(id, self._bus.now())

    def _publish(self, expression: str, message: Message) -> None:
        self._bus.publish(keys.command(expression, self._bus.role, self._bus.name), message)

    def close(self) -> None:
        """Stop sending again; what has not ended is cancelled at its server."""
        for id in self._asking.ids:
            self.cancel(id, Fault(reason="requester closed", cause="closed", whose=self._bus.name))
        self._fail_all(self._broken or RunFailed("the client is closed"))

    def _fail_all(self, error: EngageError) -> None:
        """End all requests as unknown, and refuse all that come later with `error`."""
        self._broken = error
        self._alarm.stop()
        for pending in self._pending.values():
            pending.end(OutcomeUnknown(error.fault))
        self._pending.clear()

    # -- listening by itself ----------------------------------------------------------------------------------------

    def check(self) -> None:
        """Raise RunFailed if answers are not heard any more."""
        if self._broken is not None:
            raise self._broken

    def _listen(self) -> None:
        """Listen from now on, and learn at once which servers are there: the request that is sent next needs it."""
        inbox, what = self._bus.subscribe(*self.PATTERNS), f"requests of {self._bus.name}"
        while (received := inbox.take()) is not None:
            self._feed_safely(received)
        self._listening = asyncio.create_task(self._hear(inbox), name=what)
        self._listening.add_done_callback(self._stopped_listening)

    async def _hear(self, inbox: Subscription) -> None:
        with inbox:
            async for received in inbox:
                self._feed_safely(received)

    def _feed_safely(self, received: Received) -> None:
        with self._bus.containing(received):
            self.feed(received)

    def _stopped_listening(self, task: "asyncio.Task[None]") -> None:
        """Fail all requests if listening broke: their callers would wait for ever."""
        if self._broken is not None or task.cancelled():
            return
        error = task.exception()
        reason = f"the client hears nothing any more: {error or 'it has left the bus'}"
        self._fail_all(RunFailed(Fault(reason=reason, advice="connect again", service=self._bus.name)))

    async def __aenter__(self) -> Self:
        self._listens = True
        return self

    async def __aexit__(self, *raised: object) -> None:
        self.close()
        if self._listening is not None:
            self._listening.cancel()
            await asyncio.gather(self._listening, return_exceptions=True)


class RequestDesk:
    """The serving side: takes commands from the service's own subscription, answers, and never serves one twice.

        match desk.take(received):
            case PerformBlock() as request: ...         # new, or updated (`desk.is_live` was true before)
            case Cancel(id=id): ...                     # only for live requests
            case None: ...                              # of another server, a duplicate, or already ended

    `request.id` is its name at this server: its own id, or `id~2` where another requester's, or a former life's, has
    that. The answers carry the id that was asked with.

    on_cancel: called when a requester has been gone for longer than the grace, has come back as another life, or has
    not renewed its request. on_extend: called with a request that a `KeepAlive` gives more authority. on_hold: called
    with a request to hold, as nobody renews it, or that goes on. term: the
    lease of requests that name none. The service's subscription must hold `RequestDesk.patterns(server)`.
    """

    def __init__(
        self,
        bus: Bus,
        server: str,
        on_cancel: Callable[[Cancel], None],
        *,
        on_extend: Callable[[Request], None] | None = None,
        on_hold: Callable[[serving.HoldRequest], None] | None = None,
        term: Seconds | None = None,
    ) -> None:
        self._bus = bus
        self._server = server
        self._on_cancel = on_cancel
        self._on_extend = on_extend
        self._on_hold = on_hold
        self._serving = Serving(server, term, bus.sight)
        self._answers = keys.request_state(server)
        self._alarm = Alarm(self._tick)

    @staticmethod
    def patterns(server: str) -> tuple[str, ...]:
        return (keys.commands(server), keys.ANY_ROBOT_ALIVE, keys.ANY_CLIENT_ALIVE)

    def is_live(self, name: str) -> bool:
        return self._serving.is_live(name)

    @property
    def live(self) -> int:
        """Number of requests that have not ended."""
        return self._serving.live

    def asked(self, name: str) -> Request:
        """The request as it came, with its own id. Raises KeyError if it was never made, or is forgotten."""
        request = self._serving.asked(name)
        if request is None:
            raise KeyError(name)
        return request

    def take(self, received: Received) -> Request | None:
        """The request in a message that the service has not seen: new, changed, or the cancellation of a live one."""
        message = received.message
        if isinstance(message, _COMMANDS):
            is_ours = keys.is_command_of(self._server, received.key)
            return self._take(message, received, self._bus.now()) if is_ours else None
        match message:
            case Unreadable(id=id, life=life, kind=kind, fault=fault) if id:
                # What could be read names the request, which may be live, or have ended.
                if borrowed(life, received, self._server) is not None:
                    return None
                requester, life = keys.requester_of(received.key), life or received.life
                known = Cancel(id=id, requester=requester, life=life, of=kind)
                return self._carry_out(self._serving.refuse(known, fault))
            case PeerGone(participant=requester):
                return self._carry_out(self._serving.requester_gone(requester, self._bus.now()))
            case PeerAlive(participant=requester, run=run):
                return self._carry_out(self._serving.requester_there(requester, run, self._bus.now()))
        return None

    def _take(self, message: Request | KeepAlive, received: Received, now: Seconds) -> Request | None:
        # An old command: its requester, if still there, sends it again; one that has left does not want it any more.
        if received.past and (message.life or self._serving.is_there(keys.requester_of(received.key))):
            return None
        sender, requester = received.life, keys.requester_of(received.key) or message.requester
        if message.requester and message.requester != requester:
            what = f"{type(message).__name__} of {message.requester!r}"
            self._bus.log.warning(
                "%s: %s comes from %r; it counts as the sender's own", self._server, what, requester
            )
        if (fault := borrowed(message.life, received, self._server)) is not None:
            self._bus.tell_refused(fault, sender_of(received))
            return None
        if requester != message.requester or not message.life:
            message = replace(message, requester=requester, life=message.life or sender)
        fault = unwieldy(message, self._server)
        if isinstance(message, KeepAlive):
            if fault is not None:
                self._bus.tell_refused(fault, sender_of(received))
                return None
            sent = min(now, self._bus.local(message.at))
            return self._carry_out(self._serving.keep_alive(message, sent, now, sender))
        if (fault := fault or misplaced(message, received.key)) is not None:
            return self._carry_out(self._serving.refuse(message, fault))
        return self._carry_out(self._serving.take(message, now, sender))

    def accept(self, name: str, within: Seconds | None = None) -> None:
        """Tell the requester that the request is being performed. within: see `Accepted`."""
        self.answer(Accepted(id=name, within=within))

    def refuse(self, name: str, fault: Fault) -> None:
        """End the request: it will not be performed."""
        self.answer(Refused(id=name, fault=fault))

    def end(self, outcome: Message) -> None:
        """End a request with its outcome, which has the request's name as its id."""
        assert isinstance(outcome, Outcome)
        self.answer(outcome)

    def answer(self, answer: Message) -> None:
        """Answer a request in any way; the answer has the request's name as its id.

        `Heard`: it is not accepted, but may have begun, so that no other life is to begin it.
        """
        assert isinstance(answer, Answer)
        fault = getattr(answer, "fault", None)
        if fault is not None and not fault.service:
            answer = replace(answer, fault=replace(fault, service=self._server))
        self._carry_out(self._serving.answer(answer.id, answer, self._bus.now()))

    def _tick(self) -> None:
        self._carry_out(self._serving.tick(self._bus.now()))

    def _carry_out(self, effects: list[serving.Effect], /) -> Request | None:
        """Carry out the effects; returns the request that has just come, if the service is to see it."""
        handed: Request | None = None
        for effect in effects:
            if isinstance(effect, serving.PublishAnswer):
                self._bus.publish(self._answers, effect.answer, again=effect.again)  # type: ignore[arg-type]
            elif isinstance(effect, serving.Hand):
                if effect.is_asked:
                    handed = effect.request
                else:
                    self._call_back(effect.request)
            elif isinstance(effect, serving.HoldRequest):
                if self._on_hold is not None:
                    with self._bus.containing(f"request {effect.name}, which nobody renews"):
                        self._on_hold(effect)
            elif effect.is_ours:
                self._bus.report(effect.fault)
            else:
                self._bus.publish(keys.fault(self._server), effect.fault)
        self._alarm.set(self._serving.deadline)
        return handed

    def _call_back(self, request: Request) -> None:
        with self._bus.containing(request):
            if isinstance(request, Cancel):
                self._on_cancel(request)
            elif self._on_extend is not None:
                self._on_extend(request)

    def serving(self, request: Request) -> Containing:
        """Contain exceptions in the body of `with`: they end this request, and nothing else."""
        return self._bus.containing(request, partial(self._refuse_if_live, request.id))

    def _refuse_if_live(self, name: str, fault: Fault) -> None:
        if self.is_live(name):
            self.refuse(name, fault)

    def close(self) -> None:
        self._alarm.stop()

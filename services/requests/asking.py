"""The asking side of long requests, pure: calls, answers, presence and time in; messages and endings out.

What becomes of one request is `TABLE` in asking_table.py. `Asking` keeps any number of requests and their
deadlines, and follows the table.

    effects = asking.send(keys.BLOCK, request, now)
    effects = asking.hear(answer, now)                 # and server_gone, server_there, cancel
    effects = asking.tick(now)                         # whenever `asking.deadline` has come
"""

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError, Fault, NeverEnded, RequestRefused, RunFailed, ServerRestarted
from engage_hri.schemas.requests import (
    Accepted,
    Answer,
    Cancel,
    Heard,
    Kept,
    Outcome,
    Outdated,
    Refused,
    Request,
    kind_of,
)
from engage_hri.schemas.units import Seconds
from engage_hri.services.requests.asking_table import TABLE, Do, Event, State
from engage_hri.services.requests.deadlines import Deadlines
from engage_hri.services.requests.patience import Patience


class Publish(Struct, frozen=True):
    """Send this. expression: of the key, for all requesters."""

    expression: str
    message: Request


class Renew(Struct, frozen=True):
    """Send `server` a `KeepAlive` of these."""

    server: str
    live: tuple[Kept, ...]


class TellAccepted(Struct, frozen=True):
    id: str


class TellEnd(Struct, frozen=True):
    """How the request has ended for its caller: told exactly once."""

    id: str
    end: Outcome | EngageError


class Complain(Struct, frozen=True):
    """Everybody is to know."""

    fault: Fault


Effect = Publish | Renew | TellAccepted | TellEnd | Complain
_Said = Answer | None
"""By the server, if that is the event."""


class _Asked:
    """One request. run: the life of its server that accepted it."""

    def __init__(self, expression: str, request: Request) -> None:
        self.expression = expression
        self.server = keys.server_of(expression)
        self.kind = kind_of(request)
        self.request = request
        self.cancel: Cancel | None = None
        self.state = State.SENT
        self.run = ""
        self.resend_after: Seconds = 0.0


class _Server:
    """What one server is to be told to keep. period: between two `KeepAlive`; soon: the next one comes after this."""

    def __init__(self, period: Seconds) -> None:
        self.kept: dict[str, _Asked] = {}
        self.period = period
        self.soon = period


SHORTEST_PULSE: Seconds = 0.05
"""Whatever the lease: a shorter one would flood the bus."""
ANEW = "send it again under a new id"

# Asked for with each message, and an enum is slow to give a member.
_ENDED, _FINISHED = State.ENDED, Event.FINISHED
_OVER = (State.GIVEN_UP, State.ENDED)
_RESEND, _GRACE, _PATIENCE, _CANCEL, _SWALLOW = _CLOCKS = (
    Event.RESEND_DUE, Event.GRACE_OVER, Event.PATIENCE_OVER, Event.CANCELLED, Event.SWALLOW_OVER,
)  # fmt: skip
_ANSWERS = {
    Heard: Event.HEARD, Accepted: Event.ACCEPTED, Outdated: Event.OUTDATED, Refused: Event.REFUSED,
}  # fmt: skip
"""What an answer of the server is; each other one is an end."""


class Asking:
    """All requests of one life of one requester."""

    def __init__(self, requester: str, life: str, patience: Patience) -> None:
        self._requester = requester
        self._life = life
        self._patience = patience
        self._asked: dict[str, _Asked] = {}
        self._servers: dict[str, _Server] = {}
        self._runs: dict[str, str] = {}
        """Participants that are there."""
        self._deadlines: Deadlines[tuple[Event | None, str]] = Deadlines()
        """Of a request by event and id; of the next `KeepAlive` by None and server."""
        self._effects: list[Effect] = []

    # -- what is known --------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        """When to `tick`; what was due then may have been settled since."""
        return None if self._deadlines.look == inf else self._deadlines.look

    def state(self, id: str) -> State:
        asked = self._asked.get(id)
        return State.ENDED if asked is None else asked.state

    def request(self, id: str) -> Request | None:
        """Its newest content."""
        asked = self._asked.get(id)
        return None if asked is None else asked.request

    @property
    def ids(self) -> tuple[str, ...]:
        """Of all requests whose caller has not been told an end."""
        return tuple(id for id, asked in self._asked.items() if asked.state is not State.GIVEN_UP)

    # -- events ---------------------------------------------------------------------------------------------------

    def send(self, expression: str, request: Request, now: Seconds, within: Seconds | None = None) -> list[Effect]:
        """A new request, or other content of a live one. One of another kind, or given up, is refused by name.

        within: seconds after which it is cancelled if it has not ended.
        """
        asked = self._asked.get(request.id)
        if asked is None:
            request = replace(request, requester=self._requester, life=self._life, lease=self._lease(request))
            asked = self._asked[request.id] = _Asked(expression, request)
        elif (fault := self._taken(asked, request)) is not None:
            return [TellEnd(request.id, RequestRefused(fault))]
        elif asked.cancel is None:
            of = asked.request
            asked.request = replace(
                request, requester=of.requester, life=of.life, lease=of.lease, revision=of.revision + 1
            )
        if within is not None:
            self._deadlines.set((_CANCEL, request.id), now + within)
        self._step(asked, Event.ASKED, now)
        return self._told()

    def _lease(self, request: Request) -> Seconds:
        return request.term if 0.0 < request.term < inf else self._patience.lease

    def _taken(self, asked: _Asked, request: Request) -> Fault | None:
        theirs, ours = asked.kind, kind_of(request)
        if asked.state is State.GIVEN_UP:
            reason = f"{theirs} {request.id!r} was given up, and may still be answered"
        elif theirs != ours:
            reason = f"{request.id!r} is the id of a live {theirs}"
        else:
            return None
        return Fault(reason=reason, where=request.id, advice=f"give this {ours} another id")

    def cancel(self, id: str, reason: str, now: Seconds) -> list[Effect]:
        self._cancel(id, reason, now)
        return self._told()

    def forget(self, id: str) -> None:
        """It could not even be sent."""
        if (asked := self._asked.pop(id, None)) is not None:
            self._let_go(asked)
            for clock in _CLOCKS:
                self._deadlines.clear((clock, id))

    def _cancel(self, id: str, reason: str, now: Seconds) -> None:
        asked = self._asked.get(id)
        if asked is not None and asked.cancel is None:
            asked.cancel = self._cancellation(asked, reason)
            self._step(asked, Event.CANCELLED, now)

    def hear(self, answer: Answer, now: Seconds, server: str) -> list[Effect]:
        """What a server says. An answer of another server, to somebody else, or to another life changes nothing."""
        asked = self._asked.get(answer.id)
        if asked is None or answer.life != self._life or answer.requester != self._requester:
            return []
        if answer.kind != asked.kind or server != asked.server:
            return []
        if isinstance(answer, Accepted):
            asked.run = self._runs.get(server, asked.run)
        self._step(asked, _ANSWERS.get(type(answer), _FINISHED), now, answer)
        return self._told()

    def server_gone(self, server: str, now: Seconds) -> list[Effect]:
        self._runs.pop(server, None)
        for asked in self._of(server):
            self._step(asked, Event.GONE, now)
        return self._told()

    def server_there(self, server: str, run: str, now: Seconds) -> list[Effect]:
        """Its token has come. run: which life of it; empty: unknown."""
        self._runs[server] = run
        for asked in self._of(server):
            is_another = bool(asked.run and run and asked.run != run)
            self._step(asked, Event.REBORN if is_another else Event.BACK, now)
            asked.run = asked.run or run
        return self._told()

    def tick(self, now: Seconds) -> list[Effect]:
        while (due := self._deadlines.due(now)) is not None:
            event, name = due
            if event is None:
                self._renew(name, now)
            elif event is Event.CANCELLED:
                self._cancel(name, "it has taken too long", now)
            elif (asked := self._asked.get(name)) is not None:
                self._step(asked, event, now)
        return self._told()

    # -- one request ----------------------------------------------------------------------------------------------

    def _of(self, server: str) -> Iterable[_Asked]:
        return [asked for asked in self._asked.values() if asked.server == server]

    def _told(self) -> list[Effect]:
        effects, self._effects = self._effects, []
        return effects

    def _step(self, asked: _Asked, event: Event, now: Seconds, answer: Answer | None = None) -> None:
        before = asked.state
        asked.state, actions = TABLE[before][event]
        for action in actions:
            _ACTS[action](self, asked, now, answer)
        if asked.state is not before and asked.state in _OVER:
            self._let_go(asked)
            id = asked.request.id
            for clock in _CLOCKS:
                if clock is not _SWALLOW or asked.state is _ENDED:
                    self._deadlines.clear((clock, id))
            if asked.state is _ENDED:
                del self._asked[id]

    def _send_anew(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._send_and_repeat(asked, now, self._patience.first_resend)

    def _send_again(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._send_and_repeat(asked, now, min(2 * asked.resend_after, self._patience.longest_resend))

    def _send_and_repeat(self, asked: _Asked, now: Seconds, after: Seconds) -> None:
        asked.resend_after = after
        self._send(asked, now, None)
        self._deadlines.set((_RESEND, asked.request.id), now + after)

    def _send(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        expression = asked.expression if asked.cancel is None else keys.cancel(asked.server)
        self._effects.append(Publish(expression, asked.cancel or asked.request))

    def _cancel_once(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        cancel = asked.cancel or self._cancellation(asked, "given up")
        self._effects.append(Publish(keys.cancel(asked.server), cancel))

    def _keep_soon(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._renew_soon(asked.server, now, self._patience.first_resend)

    def _keep_now(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._renew_soon(asked.server, now, 0.0)

    def _wait_grace(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._deadlines.set((_GRACE, asked.request.id), now + self._patience.grace)
        if asked.cancel is None:
            self._deadlines.clear((_PATIENCE, asked.request.id))

    def _stop_grace(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._deadlines.clear((_GRACE, asked.request.id))

    def _hope(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        if asked.server in self._runs:
            self._deadlines.set((_PATIENCE, asked.request.id), now + self._patience.silence)

    def _be_patient(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._deadlines.set((_PATIENCE, asked.request.id), now + self._patience.cancel)

    def _swallow(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._deadlines.set((_SWALLOW, asked.request.id), now + self._patience.swallow)

    def _tell_accepted(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._effects.append(TellAccepted(asked.request.id))

    def _tell_outcome(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        assert isinstance(answer, Outcome)
        self._effects.append(TellEnd(asked.request.id, answer))

    def _tell_refused(self, asked: _Asked, now: Seconds, answer: _Said, *, error: type[EngageError]) -> None:
        assert isinstance(answer, Refused)
        self._effects.append(TellEnd(asked.request.id, error(answer.fault)))

    def _tell_failed(self, asked: _Asked, now: Seconds, answer: _Said, *, error: type[EngageError], why: str) -> None:
        self._fail(asked, error, why)

    def _tell_silent(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._fail(asked, RunFailed, f"is there, but has not answered for {self._patience.silence:g} s")

    def _tell_unstoppable(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        why = f"has not ended it within {self._patience.cancel:g} s of its cancellation"
        fault = self._fail(asked, NeverEnded, why, f"is {asked.server} stuck? It is not asked any more")
        self._effects.append(Complain(fault))

    def _fail(self, asked: _Asked, error: type[EngageError], why: str, advice: str = ANEW) -> Fault:
        fault = Fault(reason=f"{asked.server} {why}", where=asked.request.id, advice=advice, service=asked.server)
        self._effects.append(TellEnd(asked.request.id, error(fault)))
        return fault

    def _cancellation(self, asked: _Asked, reason: str) -> Cancel:
        request = asked.request
        return Cancel(id=request.id, requester=self._requester, life=self._life, of=kind_of(request), reason=reason)

    # -- keeping alive --------------------------------------------------------------------------------------------

    def _keep(self, asked: _Asked, now: Seconds, answer: _Said) -> None:
        self._deadlines.clear((_RESEND, asked.request.id))
        self._deadlines.clear((_PATIENCE, asked.request.id))
        server = self._servers.get(asked.server)
        if server is None:
            server = self._servers[asked.server] = _Server(self._patience.pulse)
        server.kept[asked.request.id] = asked
        server.period = max(SHORTEST_PULSE, min(server.period, asked.request.lease / 3))
        self._renew_soon(asked.server, now, server.period)

    def _let_go(self, asked: _Asked, now: Seconds = 0.0, answer: _Said = None) -> None:
        server = self._servers.get(asked.server)
        if server is not None and server.kept.pop(asked.request.id, None) is not None and not server.kept:
            del self._servers[asked.server]
            self._deadlines.clear((None, asked.server))

    def _renew_soon(self, name: str, now: Seconds, after: Seconds) -> None:
        if (server := self._servers.get(name)) is not None:
            server.soon = min(server.period, max(after, self._patience.first_resend))
            at = self._deadlines[None, name]
            self._deadlines.set((None, name), min(inf if at is None else at, now + after))

    def _renew(self, name: str, now: Seconds) -> None:
        """Each time after twice as long, up to the period: a change that was lost is found soon."""
        server = self._servers[name]
        requests = [asked.request for asked in server.kept.values()]
        kept = [Kept(kind_of(each), each.id, each.revision, each.authority, each.lease) for each in requests]
        self._effects.append(Renew(name, tuple(kept)))
        self._deadlines.set((None, name), now + server.soon)
        server.soon = min(2 * server.soon, server.period)


_ACTS: Mapping[Do, Callable[[Asking, _Asked, Seconds, _Said], None]] = {
    Do.SEND: Asking._send_anew,
    Do.SEND_AGAIN: Asking._send_again,
    Do.SEND_ONCE: Asking._send,
    Do.CANCEL_ONCE: Asking._cancel_once,
    Do.KEEP: Asking._keep,
    Do.KEEP_SOON: Asking._keep_soon,
    Do.KEEP_NOW: Asking._keep_now,
    Do.LET_GO: Asking._let_go,
    Do.WAIT_GRACE: Asking._wait_grace,
    Do.STOP_GRACE: Asking._stop_grace,
    Do.HOPE: Asking._hope,
    Do.BE_PATIENT: Asking._be_patient,
    Do.SWALLOW: Asking._swallow,
    Do.TELL_ACCEPTED: Asking._tell_accepted,
    Do.TELL_OUTCOME: Asking._tell_outcome,
    Do.TELL_REFUSED: partial(Asking._tell_refused, error=RequestRefused),
    Do.TELL_FORGOTTEN: partial(Asking._tell_refused, error=RunFailed),
    Do.TELL_GONE: partial(Asking._tell_failed, error=RunFailed, why="is gone"),
    Do.TELL_REBORN: partial(Asking._tell_failed, error=ServerRestarted, why="was restarted"),
    Do.TELL_SILENT: Asking._tell_silent,
    Do.TELL_UNSTOPPABLE: Asking._tell_unstoppable,
}

"""The asking side of long requests, pure: calls, answers, presence and time in; messages and endings out.

What becomes of one request is `TABLE` in asking_table.py. `Asking` keeps any number of requests and their
deadlines, and follows the table.

    effects = asking.send(keys.BLOCK, request, now)
    effects = asking.hear(answer, now)                 # and server_gone, server_there, cancel
    effects = asking.tick(now)                         # whenever `asking.deadline` has come
"""

from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import partial
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import (
    Cause,
    EngageError,
    Fault,
    NeverEnded,
    OutcomeUnknown,
    RequestRefused,
    ServerRestarted,
)
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
from engage_hri.services.bus.deadlines import FORGOTTEN_AFTER, Sight, Silences
from engage_hri.services.requests.asking_table import TABLE, AskingAction, AskingEvent, AskingState
from engage_hri.services.requests.serving_table import ANEW, unwieldy


class PublishCommand(Struct, frozen=True):
    """Publish this message. expression: the key expression of the command, as in `schemas/keys.py`."""

    expression: str
    message: Request


class Renew(Struct, frozen=True):
    """Send `server` a `KeepAlive` for these requests."""

    server: str
    live: tuple[Kept, ...]


class TellAccepted(Struct, frozen=True):
    """Tell the caller that the server has accepted the request."""

    id: str
    answer: Accepted


class TellEnd(Struct, frozen=True):
    """Tell the caller how the request has ended. There is exactly one for each request."""

    id: str
    end: Outcome | EngageError


class AskingFault(Struct, frozen=True):
    """Publish this fault for all to see."""

    fault: Fault


Effect = PublishCommand | Renew | TellAccepted | TellEnd | AskingFault


class Patience(Struct, frozen=True, kw_only=True):
    """Limits of a requester, times in seconds.

    first_resend: until a request that nobody has answered is sent again; the wait doubles up to longest_resend.
    grace: how long the server may be gone before its requests fail: a restart of the router looks like a death. By
    then it has ended them, if it lives: it misses us a silent link's lease later than we miss it, and has its grace.
    pulse: between two `KeepAlive`. lease: how long a request that is not renewed stays alive at its server.
    cancel: how long after its cancellation a request may take to end. silence: how long a server that is there may
    leave a request without any answer. swallow: how long late answers to a request that was given up are ignored.
    window: number of requests that a server may have before it without an answer; more wait here.
    """

    first_resend: Seconds = 0.3
    longest_resend: Seconds = 2.0
    grace: Seconds = 4.0
    pulse: Seconds = 1.0
    lease: Seconds = 5.0
    cancel: Seconds = 30.0
    silence: Seconds = 30.0
    swallow: Seconds = 60.0
    window: int = 64


class SentRequest:
    """One request. run: the life of the server that accepted it. sent_at: when it was sent last; None: never."""

    def __init__(self, expression: str, request: Request) -> None:
        self.expression = expression
        self.server = keys.server_of(expression)
        self.kind = kind_of(request)
        self.request = request
        self.cancel: Cancel | None = None
        self.state = AskingState.SENT
        self.run = ""
        self.sent_at: Seconds | None = None
        self.resend_after: Seconds = 0.0


class Server:
    """The requests that one server is asked to keep alive.

    period: seconds between two `KeepAlive`. soon: seconds until the one after the next.
    """

    def __init__(self, period: Seconds) -> None:
        self.kept: dict[str, SentRequest] = {}
        self.period = period
        self.soon = period


class SendWindow:
    """Requests to one server that are on their way without an answer; those that wait for that, in their order.

    Who asks for ten thousand things at once would else fill the links and the queue of the server, which are the
    others' too, and would send again what only has not come yet.
    """

    def __init__(self, size: int) -> None:
        """size: number of requests that may be on their way."""
        self._size = size
        self._on_their_way: set[str] = set()
        self._waiting: dict[str, None] = {}

    def has_waiting(self, id: str) -> bool:
        """True for a request that has not been sent, and waits for others."""
        return id in self._waiting

    def enter(self, id: str) -> bool:
        """Tell whether a request may be sent, also again; it waits if not."""
        if id not in self._on_their_way and len(self._on_their_way) >= self._size:
            self._waiting[id] = None
            return False
        self._waiting.pop(id, None)
        self._on_their_way.add(id)
        return True

    def leave(self, id: str) -> str | None:
        """Take the news that a request has been answered, or is given up; returns the one that may be sent now."""
        self._waiting.pop(id, None)
        if id not in self._on_their_way:
            return None
        self._on_their_way.discard(id)
        return next(iter(self._waiting), None)


_Said = Answer | None
"""The answer of the server that is the event; None with all other events."""


SHORTEST_PULSE: Seconds = 0.05
"""Least time between two `KeepAlive`, whatever the lease: a shorter one would flood the bus."""

ASLEEP: Seconds = FORGOTTEN_AFTER / 2
"""Time after which a request without an answer is not sent again. This process was asleep meanwhile, as a notebook is
that was closed, and the server may soon have forgotten that it has performed the request already."""

# Members that are used with each message: an enum is slow to look one up.
_SENT, _ENDED, _FINISHED = AskingState.SENT, AskingState.ENDED, AskingEvent.FINISHED
_OVER = (AskingState.GIVEN_UP, AskingState.ENDED)
_UNDECIDED = (AskingState.SENT, AskingState.HEARD)
_RESEND, _GRACE, _PATIENCE, _CANCEL, _SWALLOW = _CLOCKS = (
    AskingEvent.RESEND_DUE, AskingEvent.GRACE_OVER, AskingEvent.PATIENCE_OVER, AskingEvent.CANCELLED,
    AskingEvent.SWALLOW_OVER,
)  # fmt: skip
_OWN = (None, AskingEvent.RESEND_DUE, AskingEvent.SWALLOW_OVER)
"""Deadlines of what this side is to do: they wait for nobody."""
_SENDS_AGAIN = (AskingEvent.RESEND_DUE, AskingEvent.BACK)
_ANSWERS = {
    Heard: AskingEvent.HEARD,
    Accepted: AskingEvent.ACCEPTED,
    Outdated: AskingEvent.OUTDATED,
    Refused: AskingEvent.REFUSED,
}
"""The event that an answer of the server is; every other answer is an end."""


class Asking:
    """All requests of one life of one requester."""

    def __init__(self, requester: str, life: str, patience: Patience, sight: Sight | None = None) -> None:
        self._requester = requester
        self._sight = sight or Sight(requester)
        self._life = life
        self._patience = patience
        self._asked: dict[str, SentRequest] = {}
        self._servers: dict[str, Server] = {}
        self._windows = defaultdict[str, SendWindow](partial(SendWindow, patience.window))
        self._runs: dict[str, str] = {}
        """Participants that are there: the life of each."""
        self._gone: set[str] = set()
        """Servers that have been there and are not: those of live requests, and all services of a robot."""
        self._deadlines = Silences[tuple[AskingEvent | None, str]](self._sight, is_own=lambda name: name[0] in _OWN)
        """Deadlines of requests, by event and id; of the next `KeepAlive`, by None and server."""
        self._effects: list[Effect] = []

    # -- questions ------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        """Time at which to call `tick`; there may be nothing to do by then."""
        return None if self._deadlines.look == inf else self._deadlines.look

    def state(self, id: str) -> AskingState:
        asked = self._asked.get(id)
        return AskingState.ENDED if asked is None else asked.state

    def request(self, id: str) -> Request | None:
        """The newest content of the request; None if it has ended."""
        asked = self._asked.get(id)
        return None if asked is None else asked.request

    @property
    def ids(self) -> tuple[str, ...]:
        """Ids of the requests that have not ended for the caller."""
        return tuple(id for id, asked in self._asked.items() if asked.state is not AskingState.GIVEN_UP)

    # -- events ---------------------------------------------------------------------------------------------------

    def send(self, expression: str, request: Request, now: Seconds, within: Seconds | None = None) -> list[Effect]:
        """Send a new request, or other content of a live one.

        The id of a request that was given up, or of a live one of another kind, is refused.
        within: seconds after which the request is cancelled if it has not ended.
        """
        asked = self._asked.get(request.id)
        if (bad := unwieldy(request, keys.server_of(expression))) is not None:
            return [TellEnd(request.id, RequestRefused(bad))]
        if asked is None:
            request = replace(request, requester=self._requester, life=self._life, lease=self._lease(request))
            asked = self._asked[request.id] = SentRequest(expression, request)
        elif (fault := _id_taken(asked, request)) is not None:
            return [TellEnd(request.id, RequestRefused(fault))]
        elif asked.cancel is None:
            known = asked.request
            same = {"requester": known.requester, "life": known.life, "lease": known.lease}
            asked.request = replace(request, **same, revision=known.revision + 1)
        if within is not None:
            self._deadlines.set((_CANCEL, request.id), now + within)
        self._step(asked, AskingEvent.ASKED, now)
        return self._new_effects()

    def _lease(self, request: Request) -> Seconds:
        return request.term if 0.0 < request.term < inf else self._patience.lease

    def cancel(self, id: str, why: Fault, now: Seconds) -> list[Effect]:
        """Cancel the request; without effect if it has ended or is being cancelled."""
        self._cancel(id, why, now)
        return self._new_effects()

    def forget(self, id: str, now: Seconds) -> list[Effect]:
        """Forget a request that could not even be sent."""
        if (asked := self._asked.pop(id, None)) is not None:
            self._let_go(asked)
            for clock in _CLOCKS:
                self._deadlines.clear((clock, id))
            self._answered(asked, now)
        return self._new_effects()

    def _cancel(self, id: str, why: Fault, now: Seconds) -> None:
        asked = self._asked.get(id)
        if asked is None or asked.cancel is not None:
            return
        asked.cancel = self._cancellation(asked, why)
        if asked.sent_at is None:
            fault = asked.cancel.fault(id).following("cancelled before it was sent", id)
            told = Refused(id=id, fault=replace(fault, service=why.service))  # nobody else has heard of it
            self._step(asked, AskingEvent.REFUSED, now, told)
        else:
            self._step(asked, AskingEvent.CANCELLED, now)

    def hear(self, answer: Answer, now: Seconds, server: str) -> list[Effect]:
        """Take an answer; one from another server, or to another requester or life, changes nothing."""
        asked = self._asked.get(answer.id)
        if asked is None or answer.life != self._life or answer.requester != self._requester:
            return []
        if answer.kind != asked.kind or server != asked.server:
            return []
        if isinstance(answer, Accepted | Heard):
            asked.run = self._runs.get(server, asked.run)
        self._step(asked, _ANSWERS.get(type(answer), _FINISHED), now, answer)
        return self._new_effects()

    def server_gone(self, server: str, now: Seconds) -> list[Effect]:
        """Take the news that the presence token of a server has gone."""
        was_there = self._runs.pop(server, None) is not None
        live = self._asked_of(server)
        if live or (was_there and server in keys.SERVICES):
            self._gone.add(server)
        for asked in live:
            self._step(asked, AskingEvent.GONE, now)
        return self._new_effects()

    def server_there(self, server: str, run: str, now: Seconds) -> list[Effect]:
        """Take the news that the presence token of a server is there. run: its life; empty: unknown."""
        self._runs[server] = run
        self._gone.discard(server)
        for asked in self._asked_of(server):
            is_another = bool(asked.run and run and asked.run != run)
            self._step(asked, AskingEvent.REBORN if is_another else AskingEvent.BACK, now)
            asked.run = asked.run or run
        return self._new_effects()

    def tick(self, now: Seconds) -> list[Effect]:
        """Carry out all that is due by now."""
        while (due := self._deadlines.due(now)) is not None:
            event, name = due
            if event is None:
                self._renew(name, now)
            elif event is AskingEvent.CANCELLED:
                self._give_up(name, now)
            elif (asked := self._asked.get(name)) is not None:
                self._step(asked, event, now)
        return self._new_effects()

    # -- one request ----------------------------------------------------------------------------------------------

    def _asked_of(self, server: str) -> list[SentRequest]:
        return [asked for asked in self._asked.values() if asked.server == server]

    def _new_effects(self) -> list[Effect]:
        """All effects since the last call."""
        effects, self._effects = self._effects, []
        return effects

    def _step(self, asked: SentRequest, event: AskingEvent, now: Seconds, answer: Answer | None = None) -> None:
        """Let `event` happen to a request: take its row of the table and do what that says."""
        before = asked.state
        if (
            event in _SENDS_AGAIN
            and before in _UNDECIDED
            and asked.sent_at is not None
            and now - asked.sent_at > ASLEEP
        ):
            event = AskingEvent.PATIENCE_OVER
        asked.state, actions = TABLE[before][event]
        for action in actions:
            _ACTIONS[action](self, asked, now, answer)
        if before is _SENT and asked.state is not _SENT:
            if self._windows[asked.server].has_waiting(asked.request.id):
                asked.state = _ENDED  # there is nothing that the server could answer
            self._answered(asked, now)
        if asked.state is not before and asked.state in _OVER:
            self._let_go(asked)
            id = asked.request.id
            for clock in _CLOCKS:
                if clock not in (_SWALLOW, _RESEND) or asked.state is _ENDED:
                    self._deadlines.clear((clock, id))
            if asked.state is _ENDED:
                del self._asked[id]

    def _answered(self, asked: SentRequest, now: Seconds) -> None:
        """Send the next of those that wait for the server to keep up."""
        following = self._windows[asked.server].leave(asked.request.id)
        if following is not None:
            self._send_and_repeat(self._asked[following], now, None, is_first=True)
            self._await_answer(self._asked[following], now, None)

    def _send_and_repeat(self, asked: SentRequest, now: Seconds, answer: _Said, *, is_first: bool) -> None:
        after = self._patience.first_resend if is_first else 2 * asked.resend_after
        asked.resend_after = min(after, self._patience.longest_resend)
        if asked.server in self._gone:
            return  # Sent when it is back: what nobody gets now would all come then.
        if asked.state is _SENT and not self._windows[asked.server].enter(asked.request.id):
            return
        self._send(asked, now, None)
        wait = asked.resend_after
        if asked.cancel is None and asked.server in self._runs:  # it may have begun: sending it renews it
            wait = min(wait, _period(asked.request))
        self._deadlines.set((_RESEND, asked.request.id), now + wait)

    def _send(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        asked.sent_at = now
        expression = asked.expression if asked.cancel is None else keys.cancel(asked.server)
        self._effects.append(PublishCommand(expression, asked.cancel or asked.request))

    def _withdraw(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        asked.cancel = asked.cancel or self._cancellation(asked, Fault(reason="given up"))
        self._send_and_repeat(asked, now, answer, is_first=True)

    def _send_no_more(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        self._deadlines.clear((_RESEND, asked.request.id))

    def _keep_soon(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        self._renew_soon(asked.server, now, self._patience.first_resend)

    def _keep_now(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        self._renew_soon(asked.server, now, 0.0)

    def _wait_grace(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        self._deadlines.set((_GRACE, asked.request.id), now + self._patience.grace)
        self._send_no_more(asked, now, answer)
        if asked.cancel is None:
            self._deadlines.clear((_PATIENCE, asked.request.id))

    def _stop_grace(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        self._deadlines.clear((_GRACE, asked.request.id))

    def _await_answer(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        if asked.server in self._runs and not self._windows[asked.server].has_waiting(asked.request.id):
            self._deadlines.set((_PATIENCE, asked.request.id), now + self._patience.silence)

    def _await_end(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        self._deadlines.set((_PATIENCE, asked.request.id), now + self._patience.cancel)

    def _swallow(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        self._deadlines.set((_SWALLOW, asked.request.id), now + self._patience.swallow)

    def _tell_accepted(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        assert isinstance(answer, Accepted)
        self._effects.append(TellAccepted(asked.request.id, answer))

    def _tell_outcome(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        assert isinstance(answer, Outcome)
        self._effects.append(TellEnd(asked.request.id, answer))

    def _tell_refused(self, asked: SentRequest, now: Seconds, answer: _Said, *, error: type[EngageError]) -> None:
        assert isinstance(answer, Refused)
        self._effects.append(TellEnd(asked.request.id, error(answer.fault)))

    def _tell_gone(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        missed = self._sight.misses(asked.server, asked.request.id, now - self._patience.grace, now, ANEW)
        self._fail(asked, OutcomeUnknown(missed))

    def _tell_reborn(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        self._fail(asked, ServerRestarted(self._sight.restarted(asked.server, asked.request.id, ANEW)))

    def _tell_silent(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        what = f"is there, but has not answered for {self._patience.silence:g} s"
        self._fail(asked, OutcomeUnknown(self._fault(asked, what, "silent", now - self._patience.silence, ANEW)))

    def _tell_unstoppable(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        what = f"has not ended it within {self._patience.cancel:g} s of its cancellation"
        advice = f"is {asked.server} stuck? It is not asked any more"
        fault = self._fault(asked, what, "late", now - self._patience.cancel, advice)
        self._fail(asked, NeverEnded(fault))
        self._effects.append(AskingFault(fault))

    def _fault(self, asked: SentRequest, what: str, cause: Cause, since: Seconds, advice: str) -> Fault:
        """what: the server has not done, and for how long."""
        return self._sight.fault(f"{asked.server} {what}", "", cause, asked.server, asked.request.id, since, advice)

    def _fail(self, asked: SentRequest, error: EngageError) -> None:
        self._effects.append(TellEnd(asked.request.id, error))

    def _give_up(self, id: str, now: Seconds) -> None:
        if (asked := self._asked.get(id)) is not None:
            since = now if asked.sent_at is None else asked.sent_at
            late = self._sight.fault("it has taken too long", "", "late", asked.server, "", since)
            self._cancel(id, late, now)

    def _cancellation(self, asked: SentRequest, why: Fault) -> Cancel:
        return Cancel(
            id=asked.request.id, requester=self._requester, life=self._life, of=asked.kind, reason=why.reason,
            cause=why.cause, whose=why.whose,
        )  # fmt: skip

    # -- keeping alive --------------------------------------------------------------------------------------------

    def _keep(self, asked: SentRequest, now: Seconds, answer: _Said) -> None:
        self._deadlines.clear((_RESEND, asked.request.id))
        self._deadlines.clear((_PATIENCE, asked.request.id))
        server = self._servers.get(asked.server)
        if server is None:
            server = self._servers[asked.server] = Server(self._patience.pulse)
        server.kept[asked.request.id] = asked
        server.period = max(SHORTEST_PULSE, min(server.period, _period(asked.request)))
        self._renew_soon(asked.server, now, server.period)

    def _let_go(self, asked: SentRequest, now: Seconds = 0.0, answer: _Said = None) -> None:
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
        """Send `server` a `KeepAlive`. Each wait is twice the last, up to the period: a lost change shows soon.

        One that has gone gets none: what it performs ends when the lease is over that was granted before.
        """
        if name in self._gone:
            return
        server = self._servers[name]
        requests = [asked.request for asked in server.kept.values()]
        kept = [Kept(kind_of(each), each.id, each.revision, each.authority, each.lease) for each in requests]
        self._effects.append(Renew(name, tuple(kept)))
        self._deadlines.set((None, name), now + server.soon)
        server.soon = min(2 * server.soon, server.period)


def _period(request: Request) -> Seconds:
    """Seconds between two renewals of a request: two may be late, or lost."""
    return min(request.lease, request.unheard or inf) / 3


def _id_taken(asked: SentRequest, request: Request) -> Fault | None:
    """A fault if `request` must not have the id of `asked`; None if it is an update of that."""
    known, kind = asked.kind, kind_of(request)
    if asked.state is AskingState.GIVEN_UP:
        reason = f"{known} {request.id!r} was given up, and may still be answered"
    elif known != kind:
        reason = f"{request.id!r} is the id of a live {known}"
    else:
        return None
    return Fault(reason=reason, where=request.id, advice=f"give this {kind} another id")


_ACTIONS: Mapping[AskingAction, Callable[[Asking, SentRequest, Seconds, _Said], None]] = {
    AskingAction.SEND: partial(Asking._send_and_repeat, is_first=True),
    AskingAction.SEND_AGAIN: partial(Asking._send_and_repeat, is_first=False),
    AskingAction.SEND_ONCE: Asking._send,
    AskingAction.WITHDRAW: Asking._withdraw,
    AskingAction.SEND_NO_MORE: Asking._send_no_more,
    AskingAction.KEEP: Asking._keep,
    AskingAction.KEEP_SOON: Asking._keep_soon,
    AskingAction.KEEP_NOW: Asking._keep_now,
    AskingAction.LET_GO: Asking._let_go,
    AskingAction.WAIT_GRACE: Asking._wait_grace,
    AskingAction.STOP_GRACE: Asking._stop_grace,
    AskingAction.AWAIT_ANSWER: Asking._await_answer,
    AskingAction.AWAIT_END: Asking._await_end,
    AskingAction.SWALLOW: Asking._swallow,
    AskingAction.TELL_ACCEPTED: Asking._tell_accepted,
    AskingAction.TELL_OUTCOME: Asking._tell_outcome,
    AskingAction.TELL_REFUSED: partial(Asking._tell_refused, error=RequestRefused),
    AskingAction.TELL_FORGOTTEN: partial(Asking._tell_refused, error=OutcomeUnknown),
    AskingAction.TELL_GONE: Asking._tell_gone,
    AskingAction.TELL_REBORN: Asking._tell_reborn,
    AskingAction.TELL_SILENT: Asking._tell_silent,
    AskingAction.TELL_UNSTOPPABLE: Asking._tell_unstoppable,
}

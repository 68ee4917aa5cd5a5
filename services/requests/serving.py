"""The serving side of long requests, pure: commands, the service's answers, presence and time in; messages out.

What becomes of one request is `TABLE` in serving_table.py. `Serving` knows requests by requester, life, kind
and id, and calls each by a name that no other request of this server has or had lately (`Names`). What has ended is
remembered, so that none of it is performed again (`EndedRequests`).

    effects = serving.take(request, now)               # a command; keep_alive, requester_gone, requester_there, tick
    effects = serving.answer(name, Accepted(id=name), now)      # what the service decides
"""

from collections import OrderedDict, defaultdict
from collections.abc import Callable, Iterable, Mapping
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.faults import Cause, Fault
from engage_hri.schemas.requests import (
    Accepted,
    Answer,
    Cancel,
    Heard,
    KeepAlive,
    Kept,
    Outdated,
    Refused,
    Request,
    answering,
    is_life_of,
    kind_meant,
    kind_of,
)
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import LATE, Absent, Sight, Silences
from engage_hri.services.requests.serving_table import (
    ANEW,
    TABLE,
    Key,
    Record,
    ServingAction,
    ServingEvent,
    ServingState,
    content_of,
    event_of,
    key_of,
)

MOST = 8 * 1024 * 1024
"""Bytes of the requests that are remembered, of all senders together."""
EACH = 1024
"""Bytes that a request takes beside its text and that of its answer: names, and its place in tables. Measured."""


class EndedRequests:
    """Requests that have ended, by sender, until nobody has spoken of them for `FORGOTTEN_AFTER`.

    Who sends many makes room for them himself: it forgets nobody else's. The last of all is remembered whatever its
    size. bytes: what all of them take, at most `MOST`.
    """

    def __init__(self) -> None:
        self._of = defaultdict[str, dict[str, Record]](dict)
        """By sender and name; of each the oldest first."""
        self._bytes: dict[str, int] = {}
        self.bytes = 0
        self._quiet: Absent[Record] = Absent()

    def __len__(self) -> int:
        return len(self._quiet)

    def add(self, record: Record, now: Seconds) -> list[Record]:
        """Remember a request that has ended, as `Record.pack` leaves it.

        Returns those that are forgotten for want of room.
        """
        sender, size = record.sender, EACH + record.pack()
        self._of[sender][record.name] = record
        self._bytes[sender] = self._bytes.get(sender, 0) + size
        self.bytes += size
        self._quiet.leaves(record, now)
        forgotten = []
        while self.bytes > MOST:
            loudest = max(self._bytes, key=self._bytes.__getitem__)
            oldest = next(iter(self._of[loudest].values()))
            if oldest is record:
                break
            self.discard(oldest)
            forgotten.append(oldest)
        return forgotten

    def named(self, record: Record, now: Seconds) -> None:
        """Note that somebody still speaks of a request: it is remembered from now."""
        if record in self._quiet:
            self._quiet.leaves(record, now)

    def forgotten(self, now: Seconds) -> list[Record]:
        """Forget those of which nobody has spoken for long; returns them."""
        old = self._quiet.forgotten(now)
        for record in old:
            self._drop(record)
        return old

    def discard(self, record: Record) -> None:
        """Forget a request, if it is here."""
        if record in self._quiet:
            self._quiet.comes(record)
            self._drop(record)

    def _drop(self, record: Record) -> None:
        sender, size = record.sender, EACH + record.size
        del self._of[sender][record.name]
        self._bytes[sender] -= size
        self.bytes -= size
        if not self._of[sender]:
            del self._of[sender], self._bytes[sender]


class PublishAnswer(Struct, frozen=True):
    """Publish this answer. again: it has been given before."""

    answer: Answer
    again: bool = False


class Hand(Struct, frozen=True):
    """Give this to the service: a request, new or changed, or a `Cancel`. Its `id` is its name at this server.

    is_asked: the message itself has just come; otherwise it was made here, as after a lease is over.
    """

    request: Request
    is_asked: bool


class HoldRequest(Struct, frozen=True, tag="hold_request"):
    """Tell the service to hold the request of this name, since nobody renews it, or to go on with it.

    until: when it ends unless it is renewed; None: it goes on. why: what has happened, and whose it was.
    """

    name: str
    until: Seconds | None
    why: Fault | None = None


class ServingFault(Struct, frozen=True):
    """Publish this fault for all to see. is_ours: it is a mistake of the service itself."""

    fault: Fault
    is_ours: bool


Effect = PublishAnswer | Hand | HoldRequest | ServingFault


KEPT = 4096


class Names:
    """Names that were not given lately: the id itself, then `ask~2`, `ask~3`. kept: ids that are remembered."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept = kept
        self._used: OrderedDict[str, int] = OrderedDict()

    def unique(self, id: str) -> str:
        """A name for `id` that no other has."""
        while (count := self._used.pop(id, 0) + 1) > 1:
            self._used[id] = count
            id = f"{id}~{count}"
        self._used[id] = count
        while len(self._used) > self._kept:
            self._used.popitem(last=False)
        return id


GRACE: Seconds = 2.0
"""Seconds that a requester may be gone before its requests end: a restart of the router looks like a death."""
LIFELESS_KEPT: Seconds = 10.0
"""Seconds for which an ended request that names no life is remembered: longer than any wait to send one again."""

# Members that are used with each message: an enum is slow to look one up.
_ENDED, _UNKNOWN = ServingState.ENDED, ServingState.UNKNOWN
_STOPPED = (ServingState.CANCELLED, ServingState.ENDED)
_GRACE_OVER, _UNHEARD, _LEASE_OVER = ServingEvent.GRACE_OVER, ServingEvent.UNHEARD, ServingEvent.LEASE_OVER
_DECISIONS = {Heard: ServingEvent.HEAR, Accepted: ServingEvent.ACCEPT, Refused: ServingEvent.REFUSE}
"""The event that an answer of the service is; every other answer is an end."""


class Renewal(Struct, frozen=True):
    """Part of a `KeepAlive` about one request. sent: when it was sent, by local time."""

    kept: Kept
    sent: Seconds


_Cause = Request | Answer | Renewal | None
"""The message, or the part of a `KeepAlive`, that is the event; None with all other events."""


class Serving:
    """All requests to one server. term: lease in seconds of a request that names none; None: without limit."""

    def __init__(self, server: str, term: Seconds | None = None, sight: Sight | None = None) -> None:
        self._server = server
        self._sight = sight or Sight(server)
        self._term = term
        self._known: dict[tuple[Key, str], Record] = {}
        """Requests by key and kind, live or ended."""
        self._newest: dict[Key, Record] = {}
        """The newest request of each key, of any kind."""
        self._named: dict[str, Record] = {}
        self._live: dict[str, Record] = {}
        """Requests that have not ended, by name."""
        self._ended = EndedRequests()
        self._names = Names()
        self._runs: dict[str, str] = {}
        self._deadlines = Silences[tuple[ServingEvent, str]](self._sight)
        self._effects: list[Effect] = []

    # -- questions ------------------------------------------------------------------------------------------------

    @property
    def deadline(self) -> Seconds | None:
        """Time at which to call `tick`; there may be nothing to do by then."""
        return None if self._deadlines.look == inf else self._deadlines.look

    def is_live(self, name: str) -> bool:
        return name in self._live

    @property
    def live(self) -> int:
        """Number of requests that have not ended."""
        return len(self._live)

    @property
    def remembered(self) -> int:
        """Bytes of the requests that have ended and are remembered."""
        return self._ended.bytes

    def asked(self, name: str) -> Request | None:
        """The request as it came, with its own id; None if it was never made, or is forgotten."""
        record = self._named.get(name)
        return None if record is None else record.request

    def is_there(self, requester: str) -> bool:
        return requester in self._runs

    # -- events ---------------------------------------------------------------------------------------------------

    def take(self, request: Request, now: Seconds, sender: str = "") -> list[Effect]:
        """Take a command that has come; its `requester` is the one that its key names.

        sender: the process, or the connection, that it came from; empty if nothing tells.
        """
        for old in self._ended.forgotten(now):
            self._forget(old)
        key, kind = key_of(request), kind_meant(request)
        newest = self._newest.get(key)
        if newest is not None and newest.state is not _ENDED and kind not in ("", newest.kind):
            is_cancel = isinstance(request, Cancel)
            advice = f"`of` is the kind of what it ends: {newest.kind}" if is_cancel else "give it another id"
            self._refuse(request, f"{request.id!r} is the id of a live {newest.kind}", advice)
        elif (record := self._record(key, kind)) is not None and self._is_claimed(record, sender):
            self._warn_stranger(request.id, kind_of(request))
        else:
            if record is None or record.sender != sender or self._is_new(record, request, now):
                record = self._new(request, sender)
            self._step(record, event_of(record, request), now, request)
        return self._new_effects()

    def refuse(self, request: Request, fault: Fault) -> list[Effect]:
        """Refuse a request that came on a wrong key, or could not be read.

        If the same request is live here, or has ended, it stays as it is.
        """
        record = self._record(key_of(request), kind_meant(request))
        if record is not None and record.state is not _ENDED:
            return [ServingFault(fault, False)]
        known = None if record is None else record.answer
        answer = answering(request, known or Refused(id=request.id, fault=fault))
        return [PublishAnswer(answer, again=known is not None)]

    def keep_alive(self, message: KeepAlive, sent: Seconds, now: Seconds, sender: str = "") -> list[Effect]:
        """Renew the requests that a `KeepAlive` names. sent: when it was sent, by local time, not after `now`.

        What has expired on its way, as behind a cut, is left out: a newer one follows it. sender: as in `take`.
        """
        for kept in message.live:
            if sent + kept.valid < now:
                continue
            record = self._known.get(((message.requester, message.life, kept.id), kept.kind))
            if record is None:
                unknown = Cancel(id=kept.id, requester=message.requester, life=message.life, of=kept.kind)
                record = Record(kept.id, unknown, sender, "")
            elif self._is_claimed(record, sender):
                self._warn_stranger(kept.id, "keep_alive")
                continue
            is_newer = record.request.is_updatable and kept.revision > record.request.revision
            self._step(record, ServingEvent.EXTENDED if is_newer else ServingEvent.NAMED, now, Renewal(kept, sent))
        return self._new_effects()

    def answer(self, name: str, answer: Answer, now: Seconds) -> list[Effect]:
        """Take the service's answer to the request that it knows by `name`."""
        record = self._named.get(name)
        if record is None:
            self._warn_ended(name, answer, "was never made")
        else:
            self._step(record, _DECISIONS.get(type(answer), ServingEvent.END), now, answer)
        return self._new_effects()

    def requester_gone(self, requester: str, now: Seconds) -> list[Effect]:
        """Take the news that the presence token of a requester has gone."""
        self._runs.pop(requester, None)
        for record in self._live_of(requester):
            self._step(record, ServingEvent.GONE, now)
        return self._new_effects()

    def requester_there(self, requester: str, run: str, now: Seconds) -> list[Effect]:
        """Take the news that the presence token of a requester is there. run: its life; empty: unknown."""
        self._runs[requester] = run
        for record in self._live_of(requester):
            is_another = bool(record.run and run and record.run != run)
            self._step(record, ServingEvent.REBORN if is_another else ServingEvent.BACK, now)
            record.run = run
        return self._new_effects()

    def tick(self, now: Seconds) -> list[Effect]:
        """Carry out all that is due by now."""
        while (due := self._deadlines.due(now)) is not None:
            event, name = due
            if (record := self._named.get(name)) is not None:
                self._step(record, event, now)
        return self._new_effects()

    # -- one request ----------------------------------------------------------------------------------------------

    def _new_effects(self) -> list[Effect]:
        """All effects since the last call."""
        effects, self._effects = self._effects, []
        return effects

    def _live_of(self, requester: str) -> Iterable[Record]:
        return [record for record in self._live.values() if record.key[0] == requester]

    def _is_new(self, record: Record, request: Request, now: Seconds) -> bool:
        """True if `request` is another than the one of `record`, which has ended.

        With a life it never is. Without one it is taken for another if its content differs, or after `LIFELESS_KEPT`.
        """
        if record.state is not _ENDED or request.life:
            return False
        may_differ = not isinstance(request, Cancel) and not isinstance(record.request, Cancel)
        differs = may_differ and content_of(request) != content_of(record.request)
        return differs or now - record.ended_at > LIFELESS_KEPT

    def _record(self, key: Key, kind: str) -> Record | None:
        """The request of this key and kind; the newest of the key if no kind is given, or that one has none."""
        newest = self._newest.get(key)
        if newest is not None and (not kind or (not newest.kind and (key, kind) not in self._known)):
            return newest
        return self._known.get((key, kind))

    def _is_claimed(self, record: Record, sender: str) -> bool:
        """True if the request is another sender's. A mere cancellation of what has not come yet binds nobody."""
        return record.sender != sender and not isinstance(record.request, Cancel)

    def _new(self, request: Request, sender: str) -> Record:
        run = self._runs.get(request.requester, "")
        if not is_life_of(request.life, run):
            run = ""  # The token of its new life is still on its way.
        while (name := self._names.unique(request.id)) in self._named:
            pass  # A live request from so long ago that `Names` has forgotten its name has this one.
        record = Record(name, request, sender, run)
        known = (record.key, record.kind)
        if (before := self._known.get(known)) is not None:
            self._forget(before)
        self._known[known] = self._named[name] = self._live[name] = self._newest[record.key] = record
        return record

    def _forget(self, record: Record) -> None:
        self._ended.discard(record)
        self._named.pop(record.name, None)
        self._live.pop(record.name, None)
        if self._known.get((record.key, record.kind)) is record:
            del self._known[record.key, record.kind]
        if self._newest.get(record.key) is record:
            del self._newest[record.key]

    def _step(self, record: Record, event: ServingEvent, now: Seconds, cause: _Cause = None) -> None:
        """Let `event` happen to a request: take its row of the table and do what that says."""
        before = record.state
        record.state, actions = TABLE[before][event]
        for action in actions:
            _ACTIONS[action](self, record, now, cause)
        if record.state is not before and record.state in _STOPPED:
            for clock in ((_GRACE_OVER, record.name), (_UNHEARD, record.name), record.lease):
                self._deadlines.clear(clock)
            if record.state is _ENDED:
                record.ended_at = now
                self._live.pop(record.name, None)
                for oldest in self._ended.add(record, now):
                    self._forget(oldest)
        elif before is _ENDED:
            self._ended.named(record, now)

    # -- actions of the table, each with the message that has caused it -------------------------------------------

    def _hand_asked(self, record: Record, now: Seconds, cause: _Cause) -> None:
        assert isinstance(cause, Request)
        if not isinstance(cause, Cancel):
            record.request = cause
        self._hand(record, cause, is_asked=True)

    def _hand_extended(self, record: Record, now: Seconds, cause: _Cause) -> None:
        """Hand over the old content with new authority; the answer `Outdated` then asks for the newest content."""
        assert isinstance(cause, Renewal)
        self._hand(record, record.request.with_authority(cause.kept.authority))

    def _renew(self, record: Record, now: Seconds, cause: _Cause) -> None:
        """Extend the lease. A late message never shortens what a newer one has granted."""
        sent, term = (cause.sent, cause.kept.valid) if isinstance(cause, Renewal) else (now, record.request.term)
        if not 0.0 < term < inf:
            term = inf if self._term is None else self._term
        record.renewed_at = max(record.renewed_at, sent)
        if term < inf:
            self._deadlines.set(record.lease, max(self._deadlines[record.lease] or 0.0, sent + term))
        self._heard(record, sent, now)

    def _heard(self, record: Record, sent: Seconds, now: Seconds) -> None:
        """Let a request go on for as long as it may without being renewed again, from when it was renewed.

        The time in which a late server hears first what came is part of that: the body is held no later for it.
        """
        unheard, clock = record.request.unheard, (_UNHEARD, record.name)
        unheard -= min(LATE, unheard / 3)
        if not 0.0 < unheard < inf or sent + unheard <= now:
            return
        self._deadlines.set(clock, max(self._deadlines[clock] or 0.0, sent + unheard))
        if record.is_held:
            record.is_held = False
            self._effects.append(HoldRequest(record.name, None))

    def _hold(self, record: Record, now: Seconds, cause: _Cause) -> None:
        if record.is_held or not 0.0 < record.request.unheard < inf:
            return
        record.is_held = True
        self._deadlines.clear((_UNHEARD, record.name))
        lease, requester = self._deadlines[record.lease], record.request.requester
        is_there = not record.run or requester in self._runs
        missed = self._sight.unrenewed if is_there else self._sight.misses
        why = missed(requester, record.name, record.renewed_at, now)
        self._effects.append(HoldRequest(record.name, inf if lease is None else lease, why))

    def _wait_grace(self, record: Record, now: Seconds, cause: _Cause) -> None:
        if not record.request.unheard:  # else it is held meanwhile, and may take the time of its lease
            self._deadlines.set((_GRACE_OVER, record.name), now + GRACE)

    def _stop_grace(self, record: Record, now: Seconds, cause: _Cause) -> None:
        self._deadlines.clear((_GRACE_OVER, record.name))

    def _say_outdated(self, record: Record, now: Seconds, cause: _Cause) -> None:
        self._effects.append(PublishAnswer(answering(record.request, Outdated(id=record.name))))

    def _answer(self, record: Record, now: Seconds, cause: _Cause) -> None:
        assert isinstance(cause, Answer)
        record.answer = answer = answering(record.request, cause)
        self._effects.append(PublishAnswer(answer))

    def _repeat(self, record: Record, now: Seconds, cause: _Cause) -> None:
        """Answer again: the request that comes now, since a cancellation of no kind may have come before it."""
        asks = cause if isinstance(cause, Request) and not isinstance(cause, Cancel) else record.request
        self._effects.append(PublishAnswer(answering(asks, record.answer or Heard(id=record.name)), again=True))

    def _refuse_unheard(self, record: Record, now: Seconds, cause: _Cause) -> None:
        reason = f"cancelled before {self._server} had heard of it; it is refused should it come yet"
        asked, advice = record.request, "a cancellation names requester and life, too"
        fault = self._fault(asked.id, reason, advice, "cancelled", asked.requester)
        self._answer(record, now, Refused(id=record.name, fault=fault))

    def _refuse_forgotten(self, record: Record, now: Seconds, cause: _Cause) -> None:
        id = record.request.id
        fault = self._fault(id, f"{self._server} does not know it any more", ANEW, "forgotten", self._server)
        self._effects.append(PublishAnswer(answering(record.request, Refused(id=id, fault=fault))))

    def _warn_different(self, record: Record, now: Seconds, cause: _Cause) -> None:
        which = "an ended" if record.state is _ENDED else "a live"
        reason = f"{which} {record.kind} of this id has other content, and that counts"
        self._complain(record.request.id, reason, "give what is new another id", is_ours=False)

    def _warn_over(self, record: Record, now: Seconds, cause: _Cause) -> None:
        assert isinstance(cause, Answer)
        self._warn_ended(record.name, cause, f"has ended already, with {record.answer}")

    def _hand(self, record: Record, request: Request, *, is_asked: bool = False) -> None:
        named = request if request.id == record.name else replace(request, id=record.name)
        self._effects.append(Hand(named, is_asked))

    def _hand_gone(self, record: Record, now: Seconds, cause: _Cause) -> None:
        self._hand_end(record, self._sight.misses(record.request.requester, record.name, now - GRACE, now))

    def _hand_reborn(self, record: Record, now: Seconds, cause: _Cause) -> None:
        self._hand_end(record, self._sight.restarted(record.request.requester, record.name))

    def _hand_lapsed(self, record: Record, now: Seconds, cause: _Cause) -> None:
        self._hand_end(record, self._sight.unrenewed(record.request.requester, record.name, record.renewed_at, now))

    def _hand_end(self, record: Record, why: Fault) -> None:
        asked = record.request
        lost = Cancel(
            id=asked.id, requester=asked.requester, life=asked.life,
            reason=why.reason, cause=why.cause, whose=why.whose,
        )  # fmt: skip
        self._hand(record, lost)

    # -- faults ---------------------------------------------------------------------------------------------------

    def _fault(self, where: str, reason: str, advice: str = "", cause: Cause = "", whose: str = "") -> Fault:
        return Fault(reason=reason, where=where, advice=advice, service=self._server, cause=cause, whose=whose)

    def _refuse(self, request: Request, reason: str, advice: str) -> None:
        refusal = Refused(id=request.id, fault=self._fault(request.id, reason, advice))
        self._effects.append(PublishAnswer(answering(request, refusal)))

    def _complain(self, where: str, reason: str, advice: str, *, is_ours: bool) -> None:
        self._effects.append(ServingFault(self._fault(where, reason, advice), is_ours))

    def _warn_stranger(self, id: str, what: str) -> None:
        advice = "only who has asked can change, renew or cancel a request"
        self._complain(id, f"{what} of a request that came from another process; ignored", advice, is_ours=False)

    def _warn_ended(self, name: str, answer: Answer, why: str) -> None:
        reason = f"request {name} {why}; now {type(answer).__name__}"
        self._complain(name, reason, "a mistake of this service", is_ours=True)


_ACTIONS: Mapping[ServingAction, Callable[[Serving, Record, Seconds, _Cause], None]] = {
    ServingAction.HAND: Serving._hand_asked,
    ServingAction.HAND_EXTENDED: Serving._hand_extended,
    ServingAction.HAND_CANCEL: Serving._hand_asked,
    ServingAction.HAND_GONE: Serving._hand_gone,
    ServingAction.HAND_REBORN: Serving._hand_reborn,
    ServingAction.HAND_LAPSED: Serving._hand_lapsed,
    ServingAction.RENEW: Serving._renew,
    ServingAction.HOLD: Serving._hold,
    ServingAction.WAIT_GRACE: Serving._wait_grace,
    ServingAction.STOP_GRACE: Serving._stop_grace,
    ServingAction.SAY_OUTDATED: Serving._say_outdated,
    ServingAction.REPEAT: Serving._repeat,
    ServingAction.ANSWER: Serving._answer,
    ServingAction.REFUSE_UNHEARD: Serving._refuse_unheard,
    ServingAction.REFUSE_FORGOTTEN: Serving._refuse_forgotten,
    ServingAction.WARN_DIFFERENT: Serving._warn_different,
    ServingAction.WARN_ENDED: Serving._warn_over,
}

"""The states of a request at its server: each has a row for each event. Data, drawn in docs/bus.md.

The counterpart of `asking_table.py`, which tells the theory. Three rules follow from it for a server:

1. The service gets a request once (`HAND`), however often it comes. What comes again is answered with the last
   answer, also long after the end (`ENDED`), since the first answer may have been lost.
2. A cancellation may come before its request. It is remembered, and refuses the request when that comes
   (`REFUSE_UNHEARD`).
3. A requester may die while its request moves the robot. So a request is renewed, and not only at its end: without
   news it is held, then ended (`HOLD`, `HAND_LAPSED`; decisions 0001 and 0037). If the requester is back in another
   life, nobody is there any more who wants it (`HAND_REBORN`).

Nothing that a requester, the service itself, the bus or the clock does at any moment is undefined. `serving.py`
follows this table.

Below the table stands what is kept of one request (`Record`): it tells which event a command is that comes.
"""

from collections.abc import Mapping
from enum import auto
from math import inf

from msgspec.structs import replace

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.messages import decode, encode
from engage_hri.schemas.requests import Answer, Cancel, KeepAlive, Request, kind_meant
from engage_hri.schemas.units import Seconds
from engage_hri.services.requests.asking_table import TableMember, rows


class ServingState(TableMember):
    """State of one request at its server."""

    UNKNOWN = auto()
    """The request has never come, or was forgotten long after its end."""
    TAKEN = auto()
    """The service has the request, and has not decided yet."""
    ACCEPTED = auto()
    CANCELLED = auto()
    """The service has been told to end the request, and has not done so yet."""
    ENDED = auto()
    """The last answer is kept, for a requester that asks again."""


class ServingEvent(TableMember):
    """Event in the life of one request."""

    CAME = auto()
    """The request has come, for the first time or with the content that is known."""
    CHANGED = auto()
    """The request has come with newer content, and its kind allows that."""
    DIFFERED = auto()
    """The request has come with other content, and its kind does not allow that."""
    CANCEL = auto()
    NAMED = auto()
    """A `KeepAlive` names the request, to keep it alive."""
    EXTENDED = auto()
    """A `KeepAlive` names the request, with newer content than is known here."""
    HEAR = auto()
    """The service itself answers, here and in the next three; here that it has begun, and will decide."""
    ACCEPT = auto()
    REFUSE = auto()
    END = auto()
    GONE = auto()
    """The presence token of the requester has gone."""
    BACK = auto()
    REBORN = auto()
    """The requester is there, but in another life."""
    GRACE_OVER = auto()
    UNHEARD = auto()
    """It has not been renewed for as long as it may go on without."""
    LEASE_OVER = auto()


class ServingAction(TableMember):
    """Action that follows from an event."""

    HAND = auto()
    """Give the service the request as it has just come."""
    HAND_EXTENDED = auto()
    """Give the service the request with the movement authority that `KeepAlive` grants."""
    HAND_CANCEL = auto()
    HAND_GONE = auto()
    """Tell the service to end the request: the requester is gone."""
    HAND_REBORN = auto()
    """Tell the service to end the request: the requester has begun another life."""
    HAND_LAPSED = auto()
    """Tell the service to end the request: its lease is over."""
    RENEW = auto()
    """Count the lease from now, and let the service go on with what it was told to hold."""
    HOLD = auto()
    """Tell the service to hold what it does, if the request is of a kind that is held."""
    WAIT_GRACE = auto()
    """Count the time that the requester may be gone, unless the request is of a kind that is held meanwhile."""
    STOP_GRACE = auto()
    SAY_OUTDATED = auto()
    """Ask the requester for the newest content."""
    REPEAT = auto()
    """Answer with the last answer; before there is one, that the request was heard."""
    ANSWER = auto()
    """Send the answer of the service."""
    REFUSE_UNHEARD = auto()
    """Refuse the cancelled request: it has not come, and will be refused if it does."""
    REFUSE_FORGOTTEN = auto()
    """Refuse what a `KeepAlive` names: it is not known here."""
    WARN_DIFFERENT = auto()
    """Publish a fault: the other content is ignored. (A request that names no life would be a new one.)"""
    WARN_ENDED = auto()
    """Report a mistake of the service: it answers a request that has ended or never was."""


Row = tuple[ServingState, tuple[ServingAction, ...]]

S, E = ServingState, ServingEvent


def going_on(
    state: ServingState,
    heard: Mapping[ServingEvent, tuple[ServingState, *tuple[ServingAction, ...]]],
    *without_effect: ServingEvent,
) -> Mapping[ServingEvent, Row]:
    """Rows of a request that the service has, decided or not. heard: of the service's own word that it has begun."""
    return rows(state, {
        E.CAME: (state, ServingAction.RENEW, ServingAction.REPEAT),
        E.CHANGED: (state, ServingAction.RENEW, ServingAction.HAND),
        E.DIFFERED: (state, ServingAction.RENEW, ServingAction.WARN_DIFFERENT, ServingAction.REPEAT),
        E.CANCEL: (S.CANCELLED, ServingAction.HAND_CANCEL),
        E.NAMED: (state, ServingAction.RENEW),
        E.EXTENDED: (state, ServingAction.RENEW, ServingAction.HAND_EXTENDED, ServingAction.SAY_OUTDATED),
        **heard,
        E.ACCEPT: (S.ACCEPTED, ServingAction.ANSWER),
        E.REFUSE: (S.ENDED, ServingAction.ANSWER),
        E.END: (S.ENDED, ServingAction.ANSWER),
        E.GONE: (state, ServingAction.WAIT_GRACE, ServingAction.HOLD),
        E.BACK: (state, ServingAction.STOP_GRACE),
        E.REBORN: (S.CANCELLED, ServingAction.HAND_REBORN),
        E.GRACE_OVER: (S.CANCELLED, ServingAction.HAND_GONE),
        E.UNHEARD: (state, ServingAction.HOLD),
        E.LEASE_OVER: (S.CANCELLED, ServingAction.HAND_LAPSED),
    }, *without_effect)  # fmt: skip


TABLE: Mapping[ServingState, Mapping[ServingEvent, Row]] = {
    S.UNKNOWN: rows(S.UNKNOWN, {
        E.CAME: (S.TAKEN, ServingAction.RENEW, ServingAction.HAND),
        E.CHANGED: (S.TAKEN, ServingAction.RENEW, ServingAction.HAND),
        E.DIFFERED: (S.TAKEN, ServingAction.RENEW, ServingAction.HAND),
        E.CANCEL: (S.ENDED, ServingAction.REFUSE_UNHEARD),
        E.NAMED: (S.UNKNOWN, ServingAction.REFUSE_FORGOTTEN),
        E.EXTENDED: (S.UNKNOWN, ServingAction.REFUSE_FORGOTTEN),
        E.HEAR: (S.UNKNOWN, ServingAction.WARN_ENDED),
        E.ACCEPT: (S.UNKNOWN, ServingAction.WARN_ENDED),
        E.REFUSE: (S.UNKNOWN, ServingAction.WARN_ENDED),
        E.END: (S.UNKNOWN, ServingAction.WARN_ENDED),
    }, E.GONE, E.BACK, E.REBORN, E.GRACE_OVER, E.UNHEARD, E.LEASE_OVER),
    S.TAKEN: going_on(S.TAKEN, {E.HEAR: (S.TAKEN, ServingAction.ANSWER)}),
    S.ACCEPTED: going_on(S.ACCEPTED, {}, E.HEAR),
    S.CANCELLED: rows(S.CANCELLED, {
        E.CAME: (S.CANCELLED, ServingAction.REPEAT),
        E.CHANGED: (S.CANCELLED, ServingAction.REPEAT),
        E.DIFFERED: (S.CANCELLED, ServingAction.REPEAT),
        E.CANCEL: (S.CANCELLED, ServingAction.REPEAT),
        E.ACCEPT: (S.CANCELLED, ServingAction.ANSWER),
        E.REFUSE: (S.ENDED, ServingAction.ANSWER),
        E.END: (S.ENDED, ServingAction.ANSWER),
    }, E.HEAR, E.NAMED, E.EXTENDED, E.GONE, E.BACK, E.REBORN, E.GRACE_OVER, E.UNHEARD, E.LEASE_OVER),
    S.ENDED: rows(S.ENDED, {
        E.CAME: (S.ENDED, ServingAction.REPEAT),
        E.CHANGED: (S.ENDED, ServingAction.REPEAT),
        E.DIFFERED: (S.ENDED, ServingAction.WARN_DIFFERENT, ServingAction.REPEAT),
        E.CANCEL: (S.ENDED, ServingAction.REPEAT),
        E.NAMED: (S.ENDED, ServingAction.REPEAT),
        E.EXTENDED: (S.ENDED, ServingAction.REPEAT),
        E.ACCEPT: (S.ENDED, ServingAction.WARN_ENDED),
        E.REFUSE: (S.ENDED, ServingAction.WARN_ENDED),
        E.END: (S.ENDED, ServingAction.WARN_ENDED),
    }, E.HEAR, E.GONE, E.BACK, E.REBORN, E.GRACE_OVER, E.UNHEARD, E.LEASE_OVER),
}  # fmt: skip


ANEW = "if it is to be done again, send it under a new id"
"""Advice about a request of which nobody knows, or remembers, what became of it."""
LONGEST = 1000
"""Letters of an id, and of a life: answers name them, and answers are kept."""

Key = tuple[str, str, str]
"""Requester, life and id. Only one request of a key is live at a time."""


class Record:
    """One request. sender: the process that it came from. run: the requester's life by its token.

    kind: of the request, or of what a cancellation ends. is_held: the service was told to hold it.
    """

    __slots__ = (
        "_answer", "_request", "ended_at", "is_held", "key", "kind", "lease", "name", "renewed_at", "run", "sender",
        "size", "state",
    )  # fmt: skip

    def __init__(self, name: str, request: Request, sender: str, run: str) -> None:
        self.name = name
        self._request: Request | bytes = request
        self._answer: Answer | bytes | None = None
        self.sender = sender
        self.run = run
        self.key = key_of(request)
        self.kind = kind_meant(request)
        self.lease = (ServingEvent.LEASE_OVER, name)
        """Name of its lease among the deadlines."""
        self.state = ServingState.UNKNOWN
        self.is_held = False
        self.renewed_at: Seconds = -inf
        self.ended_at: Seconds = inf
        self.size = 0
        """Bytes of request and answer, once they are packed."""

    @property
    def request(self) -> Request:
        return decode(self._request) if isinstance(self._request, bytes) else self._request  # type: ignore[return-value]

    @request.setter
    def request(self, request: Request) -> None:
        self._request = request

    @property
    def answer(self) -> Answer | None:
        return decode(self._answer) if isinstance(self._answer, bytes) else self._answer  # type: ignore[return-value]

    @answer.setter
    def answer(self, answer: Answer) -> None:
        self._answer = answer

    def pack(self) -> int:
        """Keep request and answer as their bytes from now on: as objects they take twice as much, and more.

        Returns the number of these bytes.
        """
        self._request = encode(self.request)  # type: ignore[arg-type]
        self._answer = None if self._answer is None else encode(self.answer)  # type: ignore[arg-type]
        self.size = len(self._request) + len(self._answer or b"")
        return self.size


def key_of(request: Request) -> Key:
    return (request.requester, request.life, request.id)


def event_of(record: Record, request: Request) -> ServingEvent:
    """The event that this command is for the request of `record`."""
    if isinstance(request, Cancel):
        return ServingEvent.CANCEL
    known = record.request
    if record.state is ServingState.UNKNOWN or isinstance(known, Cancel) or request == known:
        return ServingEvent.CAME
    if not request.is_updatable:
        return ServingEvent.CAME if content_of(request) == content_of(known) else ServingEvent.DIFFERED
    return ServingEvent.CAME if request.revision < known.revision else ServingEvent.CHANGED


def content_of(request: Request) -> Request:
    """The request without the fields that are no content."""
    return replace(request, revision=0, lease=0.0)


def unwieldy(command: Request | KeepAlive, server: str) -> Fault | None:
    """A fault if an id or the life in a command is too long to be answered; None otherwise."""
    ids = [each.id for each in command.live] if isinstance(command, KeepAlive) else [command.id]
    most = max(map(len, (command.life, *ids)))
    if most <= LONGEST:
        return None
    reason = f"an id of {most} letters; at most {LONGEST} are read"
    return Fault(reason=reason, where=type(command).__name__, service=server)

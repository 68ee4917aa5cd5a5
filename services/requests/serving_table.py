"""What becomes of a request at its server: each state has a row for each event. Data, drawn in docs/bus.md.

Nothing that a requester, the service itself, the bus or the clock does at any moment is undefined.
services/requests/serving.py follows it.
"""

from collections.abc import Mapping
from enum import auto

from engage_hri.services.requests.transitions import Name, rows


class State(Name):
    """Of one request."""

    UNKNOWN = auto()
    """It has never come, or was forgotten long after its end."""
    TAKEN = auto()
    """The service has it, and has not decided yet."""
    ACCEPTED = auto()
    CANCELLED = auto()
    """The service has been told to end it, and has not yet."""
    ENDED = auto()
    """Its terminal state is kept for whoever asks again."""


class Event(Name):
    """What can happen to one request."""

    CAME = auto()
    """The request, for the first time or as it is known."""
    CHANGED = auto()
    """The request with newer content, which its kind allows."""
    DIFFERED = auto()
    """The request with other content, which its kind does not allow."""
    CANCEL = auto()
    NAMED = auto()
    """A `KeepAlive` wants it alive."""
    EXTENDED = auto()
    """The same, with newer content than is known here."""
    ACCEPT = auto()
    """The service's own answers."""
    REFUSE = auto()
    END = auto()
    GONE = auto()
    """The requester's token has gone."""
    BACK = auto()
    REBORN = auto()
    """The requester is there as another life."""
    GRACE_OVER = auto()
    LEASE_OVER = auto()


class Do(Name):
    """What follows from an event."""

    HAND = auto()
    """Give the request, as it has just come, to the service."""
    HAND_EXTENDED = auto()
    """Give the service the request with the authority that `KeepAlive` grants."""
    HAND_CANCEL = auto()
    HAND_GONE = auto()
    """Tell the service to end it: the requester is gone."""
    HAND_LAPSED = auto()
    """Tell the service to end it: nobody has renewed it."""
    RENEW = auto()
    """Its lease counts from now."""
    WAIT_GRACE = auto()
    STOP_GRACE = auto()
    SAY_OUTDATED = auto()
    """Ask for the newest content."""
    REPEAT = auto()
    """Answer with the last state; before there is one, that it was heard."""
    ANSWER = auto()
    """With what the service says."""
    REFUSE_UNHEARD = auto()
    """The request of this cancellation never came, and it is too late for it now."""
    REFUSE_FORGOTTEN = auto()
    """A `KeepAlive` names what is not known here."""
    WARN_DIFFERENT = auto()
    """The other content is ignored, and everybody is told. Of a request that names no life it would be a new one."""
    WARN_ENDED = auto()
    """The service answers what has ended or never was: a mistake of its own."""


Row = tuple[State, tuple[Do, ...]]

S, E = State, Event
TABLE: Mapping[State, Mapping[Event, Row]] = {
    S.UNKNOWN: rows(S.UNKNOWN, {
        E.CAME: (S.TAKEN, Do.RENEW, Do.HAND),
        E.CHANGED: (S.TAKEN, Do.RENEW, Do.HAND),
        E.DIFFERED: (S.TAKEN, Do.RENEW, Do.HAND),
        E.CANCEL: (S.ENDED, Do.REFUSE_UNHEARD),
        E.NAMED: (S.UNKNOWN, Do.REFUSE_FORGOTTEN),
        E.EXTENDED: (S.UNKNOWN, Do.REFUSE_FORGOTTEN),
        E.ACCEPT: (S.UNKNOWN, Do.WARN_ENDED),
        E.REFUSE: (S.UNKNOWN, Do.WARN_ENDED),
        E.END: (S.UNKNOWN, Do.WARN_ENDED),
    }, E.GONE, E.BACK, E.REBORN, E.GRACE_OVER, E.LEASE_OVER),
    S.TAKEN: rows(S.TAKEN, {
        E.CAME: (S.TAKEN, Do.RENEW, Do.REPEAT),
        E.CHANGED: (S.TAKEN, Do.RENEW, Do.HAND),
        E.DIFFERED: (S.TAKEN, Do.RENEW, Do.WARN_DIFFERENT, Do.REPEAT),
        E.CANCEL: (S.CANCELLED, Do.HAND_CANCEL),
        E.NAMED: (S.TAKEN, Do.RENEW),
        E.EXTENDED: (S.TAKEN, Do.RENEW, Do.HAND_EXTENDED, Do.SAY_OUTDATED),
        E.ACCEPT: (S.ACCEPTED, Do.ANSWER),
        E.REFUSE: (S.ENDED, Do.ANSWER),
        E.END: (S.ENDED, Do.ANSWER),
        E.GONE: (S.TAKEN, Do.WAIT_GRACE),
        E.BACK: (S.TAKEN, Do.STOP_GRACE),
        E.REBORN: (S.CANCELLED, Do.HAND_GONE),
        E.GRACE_OVER: (S.CANCELLED, Do.HAND_GONE),
        E.LEASE_OVER: (S.CANCELLED, Do.HAND_LAPSED),
    }),
    S.ACCEPTED: rows(S.ACCEPTED, {
        E.CAME: (S.ACCEPTED, Do.RENEW, Do.REPEAT),
        E.CHANGED: (S.ACCEPTED, Do.RENEW, Do.HAND),
        E.DIFFERED: (S.ACCEPTED, Do.RENEW, Do.WARN_DIFFERENT, Do.REPEAT),
        E.CANCEL: (S.CANCELLED, Do.HAND_CANCEL),
        E.NAMED: (S.ACCEPTED, Do.RENEW),
        E.EXTENDED: (S.ACCEPTED, Do.RENEW, Do.HAND_EXTENDED, Do.SAY_OUTDATED),
        E.ACCEPT: (S.ACCEPTED, Do.ANSWER),
        E.REFUSE: (S.ENDED, Do.ANSWER),
        E.END: (S.ENDED, Do.ANSWER),
        E.GONE: (S.ACCEPTED, Do.WAIT_GRACE),
        E.BACK: (S.ACCEPTED, Do.STOP_GRACE),
        E.REBORN: (S.CANCELLED, Do.HAND_GONE),
        E.GRACE_OVER: (S.CANCELLED, Do.HAND_GONE),
        E.LEASE_OVER: (S.CANCELLED, Do.HAND_LAPSED),
    }),
    S.CANCELLED: rows(S.CANCELLED, {
        E.CAME: (S.CANCELLED, Do.REPEAT),
        E.CHANGED: (S.CANCELLED, Do.REPEAT),
        E.DIFFERED: (S.CANCELLED, Do.REPEAT),
        E.CANCEL: (S.CANCELLED, Do.REPEAT),
        E.ACCEPT: (S.CANCELLED, Do.ANSWER),
        E.REFUSE: (S.ENDED, Do.ANSWER),
        E.END: (S.ENDED, Do.ANSWER),
    }, E.NAMED, E.EXTENDED, E.GONE, E.BACK, E.REBORN, E.GRACE_OVER, E.LEASE_OVER),
    S.ENDED: rows(S.ENDED, {
        E.CAME: (S.ENDED, Do.REPEAT),
        E.CHANGED: (S.ENDED, Do.REPEAT),
        E.DIFFERED: (S.ENDED, Do.WARN_DIFFERENT, Do.REPEAT),
        E.CANCEL: (S.ENDED, Do.REPEAT),
        E.NAMED: (S.ENDED, Do.REPEAT),
        E.EXTENDED: (S.ENDED, Do.REPEAT),
        E.ACCEPT: (S.ENDED, Do.WARN_ENDED),
        E.REFUSE: (S.ENDED, Do.WARN_ENDED),
        E.END: (S.ENDED, Do.WARN_ENDED),
    }, E.GONE, E.BACK, E.REBORN, E.GRACE_OVER, E.LEASE_OVER),
}  # fmt: skip

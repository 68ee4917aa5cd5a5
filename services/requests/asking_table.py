"""What becomes of a request at its requester: each state has a row for each event. Data, drawn in docs/bus.md.

Nothing that a caller, a server, the bus or the clock does at any moment is undefined. asking.py follows it.
"""

from collections.abc import Mapping
from enum import auto

from engage_hri.services.requests.transitions import Name, rows


class State(Name):
    """Of one request."""

    SENT = auto()
    """No decisive answer yet: it is sent again."""
    ACCEPTED = auto()
    """The server performs it: `KeepAlive` names it."""
    WITHDRAWING = auto()
    """Cancelled before it was accepted: the cancellation is sent again."""
    STOPPING = auto()
    """Cancelled after it was accepted."""
    GIVEN_UP = auto()
    """Its caller has been told that it failed; answers that come late are swallowed."""
    ENDED = auto()
    """Or never made. Nothing is known of it any more."""


class Event(Name):
    """What can happen to one request."""

    ASKED = auto()
    """The caller sends it: for the first time, or with other content."""
    CANCELLED = auto()
    HEARD = auto()
    ACCEPTED = auto()
    OUTDATED = auto()
    """The server has an older content."""
    REFUSED = auto()
    FINISHED = auto()
    """Its outcome has come."""
    GONE = auto()
    """The server's token has gone."""
    BACK = auto()
    """The server's token is there, of the same life as far as is known."""
    REBORN = auto()
    """The token of another life than the one that accepted it."""
    RESEND_DUE = auto()
    GRACE_OVER = auto()
    PATIENCE_OVER = auto()
    SWALLOW_OVER = auto()


class Do(Name):
    """What follows from an event."""

    SEND = auto()
    """Publish the request, or its cancellation once there is one, and again after a while."""
    SEND_AGAIN = auto()
    """The same; the next time after twice as long."""
    SEND_ONCE = auto()
    """Publish it; `KeepAlive` finds out whether it got there."""
    CANCEL_ONCE = auto()
    """Publish a cancellation that nobody waits for."""
    KEEP = auto()
    """Name it in `KeepAlive` from now on instead of sending it again."""
    KEEP_SOON = auto()
    """Send the next `KeepAlive` soon: the content has changed."""
    KEEP_NOW = auto()
    LET_GO = auto()
    """Name it no longer."""
    WAIT_GRACE = auto()
    STOP_GRACE = auto()
    HOPE = auto()
    """Wait anew for a decisive answer of a server that is there."""
    BE_PATIENT = auto()
    """Wait so long for the end of what was cancelled."""
    SWALLOW = auto()
    """Forget it after a while."""
    TELL_ACCEPTED = auto()
    TELL_OUTCOME = auto()
    TELL_REFUSED = auto()
    TELL_FORGOTTEN = auto()
    """The server does not know what it has accepted."""
    TELL_GONE = auto()
    TELL_REBORN = auto()
    TELL_SILENT = auto()
    TELL_UNSTOPPABLE = auto()
    """The cancellation was in vain, which everybody is to know."""


Row = tuple[State, tuple[Do, ...]]

S, E = State, Event
TABLE: Mapping[State, Mapping[Event, Row]] = {
    S.SENT: rows(S.SENT, {
        E.ASKED: (S.SENT, Do.SEND, Do.HOPE),
        E.CANCELLED: (S.WITHDRAWING, Do.SEND, Do.BE_PATIENT),
        E.HEARD: (S.SENT, Do.HOPE),
        E.ACCEPTED: (S.ACCEPTED, Do.TELL_ACCEPTED, Do.KEEP),
        E.OUTDATED: (S.SENT, Do.SEND, Do.HOPE),
        E.REFUSED: (S.ENDED, Do.TELL_REFUSED),
        E.FINISHED: (S.ENDED, Do.TELL_OUTCOME),
        E.GONE: (S.SENT, Do.WAIT_GRACE),
        E.BACK: (S.SENT, Do.STOP_GRACE, Do.SEND, Do.HOPE),
        E.REBORN: (S.SENT, Do.STOP_GRACE, Do.SEND, Do.HOPE),
        E.RESEND_DUE: (S.SENT, Do.SEND_AGAIN),
        E.GRACE_OVER: (S.GIVEN_UP, Do.TELL_GONE, Do.CANCEL_ONCE, Do.SWALLOW),
        E.PATIENCE_OVER: (S.GIVEN_UP, Do.TELL_SILENT, Do.CANCEL_ONCE, Do.SWALLOW),
    }, E.SWALLOW_OVER),
    S.ACCEPTED: rows(S.ACCEPTED, {
        E.ASKED: (S.ACCEPTED, Do.SEND_ONCE, Do.KEEP_SOON),
        E.CANCELLED: (S.STOPPING, Do.LET_GO, Do.SEND, Do.BE_PATIENT),
        E.OUTDATED: (S.ACCEPTED, Do.SEND_ONCE, Do.KEEP_SOON),
        E.REFUSED: (S.ENDED, Do.TELL_FORGOTTEN),
        E.FINISHED: (S.ENDED, Do.TELL_OUTCOME),
        E.GONE: (S.ACCEPTED, Do.WAIT_GRACE),
        E.BACK: (S.ACCEPTED, Do.STOP_GRACE, Do.KEEP_NOW),
        E.REBORN: (S.GIVEN_UP, Do.TELL_REBORN, Do.CANCEL_ONCE, Do.SWALLOW),
        E.GRACE_OVER: (S.GIVEN_UP, Do.TELL_GONE, Do.CANCEL_ONCE, Do.SWALLOW),
    }, E.HEARD, E.ACCEPTED, E.RESEND_DUE, E.PATIENCE_OVER, E.SWALLOW_OVER),
    S.WITHDRAWING: rows(S.WITHDRAWING, {
        E.ACCEPTED: (S.STOPPING, Do.TELL_ACCEPTED),
        E.REFUSED: (S.ENDED, Do.TELL_REFUSED),
        E.FINISHED: (S.ENDED, Do.TELL_OUTCOME),
        E.GONE: (S.WITHDRAWING, Do.WAIT_GRACE),
        E.BACK: (S.WITHDRAWING, Do.STOP_GRACE, Do.SEND),
        E.REBORN: (S.WITHDRAWING, Do.STOP_GRACE, Do.SEND),
        E.RESEND_DUE: (S.WITHDRAWING, Do.SEND_AGAIN),
        E.GRACE_OVER: (S.GIVEN_UP, Do.TELL_GONE, Do.CANCEL_ONCE, Do.SWALLOW),
        E.PATIENCE_OVER: (S.GIVEN_UP, Do.TELL_UNSTOPPABLE, Do.SWALLOW),
    }, E.ASKED, E.CANCELLED, E.HEARD, E.OUTDATED, E.SWALLOW_OVER),
    S.STOPPING: rows(S.STOPPING, {
        E.REFUSED: (S.ENDED, Do.TELL_FORGOTTEN),
        E.FINISHED: (S.ENDED, Do.TELL_OUTCOME),
        E.GONE: (S.STOPPING, Do.WAIT_GRACE),
        E.BACK: (S.STOPPING, Do.STOP_GRACE, Do.SEND),
        E.REBORN: (S.GIVEN_UP, Do.TELL_REBORN, Do.CANCEL_ONCE, Do.SWALLOW),
        E.RESEND_DUE: (S.STOPPING, Do.SEND_AGAIN),
        E.GRACE_OVER: (S.GIVEN_UP, Do.TELL_GONE, Do.CANCEL_ONCE, Do.SWALLOW),
        E.PATIENCE_OVER: (S.GIVEN_UP, Do.TELL_UNSTOPPABLE, Do.SWALLOW),
    }, E.ASKED, E.CANCELLED, E.HEARD, E.ACCEPTED, E.OUTDATED, E.SWALLOW_OVER),
    S.GIVEN_UP: rows(S.GIVEN_UP, {
        # A server that still works for nobody hears of it by the lease, which is not renewed. To answer what it says
        # with a cancellation each time, which the server answers in turn, would never end.
        E.REFUSED: (S.ENDED,),
        E.FINISHED: (S.ENDED,),
        E.BACK: (S.GIVEN_UP, Do.CANCEL_ONCE),
        E.REBORN: (S.ENDED,),
        E.SWALLOW_OVER: (S.ENDED,),
    }, E.ASKED, E.CANCELLED, E.HEARD, E.ACCEPTED, E.OUTDATED, E.GONE, E.RESEND_DUE, E.GRACE_OVER, E.PATIENCE_OVER),
    S.ENDED: rows(S.ENDED, {}, *Event),
}  # fmt: skip

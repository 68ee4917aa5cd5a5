"""The states of a request at its requester: each has a row for each event. Data, drawn in docs/bus.md.

The aim: a request is performed at most once, and its requester is told what came of it, whatever dies meanwhile.
Zenoh delivers a message, or loses it with a link, and tells neither side. So four things could go wrong:

1. The request is lost. It is sent again until the server has answered (`SENT`). The server knows it by its id.
2. An answer is lost. The server keeps its last answer, and gives it again to each request that comes again.
3. The server dies and comes back. What it had accepted, its new life knows nothing of. To send it again could move
   the robot twice. So the requester is told that it is unknown what came of it (`TELL_REBORN`). A request that no
   life had heard of is sent to the new one.
4. The requester gives up while the request still is on its way. Then the server might begin it after that. So a
   cancellation follows it, and is sent until it is answered (`GIVEN_UP`): a cancellation that comes first refuses
   the request that comes after it.

Decision 0010 says how a request is known, 0087 why "unknown" is an answer of its own. Nothing that a caller, a
server, the bus or the clock does at any moment is undefined: `asking.py` follows this table, and a model in the
tests plays both tables against each other with losses and deaths.
"""

from collections.abc import Mapping
from enum import Enum, auto
from typing import TypeVar


class TableMember(Enum):
    """Member of a table. It is looked up with each message, so it hashes as any object does: faster than an enum."""

    __hash__ = object.__hash__


StateT = TypeVar("StateT", bound=TableMember)
EventT = TypeVar("EventT", bound=TableMember)
DoT = TypeVar("DoT", bound=TableMember)


def rows(
    state: StateT, changes: Mapping[EventT, tuple[StateT, *tuple[DoT, ...]]], *ignored: EventT
) -> dict[EventT, tuple[StateT, tuple[DoT, ...]]]:
    """The rows of `state`: for each event the state after it, and what to do. ignored: events that change nothing."""
    unchanged: dict[EventT, tuple[StateT, tuple[DoT, ...]]] = dict.fromkeys(ignored, (state, ()))
    return unchanged | {event: (after, tuple(actions)) for event, (after, *actions) in changes.items()}


class AskingState(TableMember):
    """State of one request at its requester."""

    SENT = auto()
    """The server has neither accepted nor ended it yet: it is sent again and again."""
    HEARD = auto()
    """The server has it, and may have begun, though it has not decided: another life must not begin it again."""
    ACCEPTED = auto()
    """The server performs it: `KeepAlive` names it."""
    WITHDRAWING = auto()
    """Cancelled before it was accepted: the cancellation is sent again."""
    STOPPING = auto()
    """Cancelled after it was accepted."""
    GIVEN_UP = auto()
    """The caller has been told that it failed. Its cancellation is sent until it is answered; other answers are
    ignored."""
    ENDED = auto()
    """Nothing is known of it any more; or it was never sent."""


class AskingEvent(TableMember):
    """Event in the life of one request."""

    ASKED = auto()
    """The caller sends the request: for the first time, or with other content."""
    CANCELLED = auto()
    HEARD = auto()
    ACCEPTED = auto()
    OUTDATED = auto()
    """The server has older content."""
    REFUSED = auto()
    FINISHED = auto()
    """The server has sent its outcome."""
    GONE = auto()
    """The presence token of the server has gone."""
    BACK = auto()
    """The server's token is there, of the same life as far as is known."""
    REBORN = auto()
    """The server's token is there, but of another life than the one that accepted the request."""
    RESEND_DUE = auto()
    GRACE_OVER = auto()
    PATIENCE_OVER = auto()
    SWALLOW_OVER = auto()


class AskingAction(TableMember):
    """Action that follows from an event."""

    SEND = auto()
    """Publish the request, or its cancellation once there is one, and repeat that after a while."""
    SEND_AGAIN = auto()
    """The same; the wait until the next time is twice as long."""
    SEND_ONCE = auto()
    """Publish the request; `KeepAlive` finds out whether it got there."""
    WITHDRAW = auto()
    """Publish a cancellation, and repeat that after a while."""
    SEND_NO_MORE = auto()
    """Stop publishing for now: nobody would get it."""
    KEEP = auto()
    """Name the request in `KeepAlive` from now on instead of sending it again."""
    KEEP_SOON = auto()
    """Send the next `KeepAlive` soon: the content has changed."""
    KEEP_NOW = auto()
    LET_GO = auto()
    """Name the request in `KeepAlive` no longer."""
    WAIT_GRACE = auto()
    """Count the time that the server may be gone; nothing is sent and renewed meanwhile."""
    STOP_GRACE = auto()
    AWAIT_ANSWER = auto()
    """Count the time anew that a server that is there has for a decisive answer."""
    AWAIT_END = auto()
    """Limit how long the cancelled request may take to end."""
    SWALLOW = auto()
    """Forget the request after a while."""
    TELL_ACCEPTED = auto()
    TELL_OUTCOME = auto()
    TELL_REFUSED = auto()
    TELL_FORGOTTEN = auto()
    """Tell the caller that the server does not know what it has accepted."""
    TELL_GONE = auto()
    TELL_REBORN = auto()
    TELL_SILENT = auto()
    TELL_UNSTOPPABLE = auto()
    """Tell the caller, and publish a fault: the cancellation was in vain."""


Row = tuple[AskingState, tuple[AskingAction, ...]]

S, E = AskingState, AskingEvent


def undecided(state: AskingState, reborn: tuple[AskingState, *tuple[AskingAction, ...]]) -> Mapping[AskingEvent, Row]:
    """Rows of a request that is on its way and not decided. reborn: what another life of the server changes."""
    return rows(state, {
        E.ASKED: (state, AskingAction.SEND, AskingAction.AWAIT_ANSWER),
        E.CANCELLED: (S.WITHDRAWING, AskingAction.SEND, AskingAction.AWAIT_END),
        E.HEARD: (S.HEARD, AskingAction.AWAIT_ANSWER),
        E.ACCEPTED: (S.ACCEPTED, AskingAction.TELL_ACCEPTED, AskingAction.KEEP),
        E.OUTDATED: (state, AskingAction.SEND, AskingAction.AWAIT_ANSWER),
        E.REFUSED: (S.ENDED, AskingAction.TELL_REFUSED),
        E.FINISHED: (S.ENDED, AskingAction.TELL_OUTCOME),
        E.GONE: (state, AskingAction.WAIT_GRACE),
        E.BACK: (state, AskingAction.STOP_GRACE, AskingAction.SEND, AskingAction.AWAIT_ANSWER),
        E.REBORN: reborn,
        E.RESEND_DUE: (state, AskingAction.SEND_AGAIN),
        E.GRACE_OVER: (S.GIVEN_UP, AskingAction.TELL_GONE, AskingAction.SWALLOW),
        E.PATIENCE_OVER: (S.GIVEN_UP, AskingAction.TELL_SILENT, AskingAction.WITHDRAW, AskingAction.SWALLOW),
    }, E.SWALLOW_OVER)  # fmt: skip


TABLE: Mapping[AskingState, Mapping[AskingEvent, Row]] = {
    S.SENT: undecided(S.SENT, reborn=(S.SENT, AskingAction.STOP_GRACE, AskingAction.SEND, AskingAction.AWAIT_ANSWER)),
    S.HEARD: undecided(
        S.HEARD, reborn=(S.GIVEN_UP, AskingAction.TELL_REBORN, AskingAction.WITHDRAW, AskingAction.SWALLOW)
    ),
    S.ACCEPTED: rows(S.ACCEPTED, {
        E.ASKED: (S.ACCEPTED, AskingAction.SEND_ONCE, AskingAction.KEEP_SOON),
        E.CANCELLED: (S.STOPPING, AskingAction.LET_GO, AskingAction.SEND, AskingAction.AWAIT_END),
        E.OUTDATED: (S.ACCEPTED, AskingAction.SEND_ONCE, AskingAction.KEEP_SOON),
        E.REFUSED: (S.ENDED, AskingAction.TELL_FORGOTTEN),
        E.FINISHED: (S.ENDED, AskingAction.TELL_OUTCOME),
        E.GONE: (S.ACCEPTED, AskingAction.WAIT_GRACE),
        E.BACK: (S.ACCEPTED, AskingAction.STOP_GRACE, AskingAction.KEEP_NOW),
        E.REBORN: (S.GIVEN_UP, AskingAction.TELL_REBORN, AskingAction.WITHDRAW, AskingAction.SWALLOW),
        E.GRACE_OVER: (S.GIVEN_UP, AskingAction.TELL_GONE, AskingAction.SWALLOW),
    }, E.HEARD, E.ACCEPTED, E.RESEND_DUE, E.PATIENCE_OVER, E.SWALLOW_OVER),
    S.WITHDRAWING: rows(S.WITHDRAWING, {
        E.ACCEPTED: (S.STOPPING, AskingAction.TELL_ACCEPTED),
        E.REFUSED: (S.ENDED, AskingAction.TELL_REFUSED),
        E.FINISHED: (S.ENDED, AskingAction.TELL_OUTCOME),
        E.GONE: (S.WITHDRAWING, AskingAction.WAIT_GRACE),
        E.BACK: (S.WITHDRAWING, AskingAction.STOP_GRACE, AskingAction.SEND),
        E.REBORN: (S.WITHDRAWING, AskingAction.STOP_GRACE, AskingAction.SEND),
        E.RESEND_DUE: (S.WITHDRAWING, AskingAction.SEND_AGAIN),
        E.GRACE_OVER: (S.GIVEN_UP, AskingAction.TELL_GONE, AskingAction.SWALLOW),
        E.PATIENCE_OVER: (S.GIVEN_UP, AskingAction.TELL_UNSTOPPABLE, AskingAction.WITHDRAW, AskingAction.SWALLOW),
    }, E.ASKED, E.CANCELLED, E.HEARD, E.OUTDATED, E.SWALLOW_OVER),
    S.STOPPING: rows(S.STOPPING, {
        E.REFUSED: (S.ENDED, AskingAction.TELL_FORGOTTEN),
        E.FINISHED: (S.ENDED, AskingAction.TELL_OUTCOME),
        E.GONE: (S.STOPPING, AskingAction.WAIT_GRACE),
        E.BACK: (S.STOPPING, AskingAction.STOP_GRACE, AskingAction.SEND),
        E.REBORN: (S.GIVEN_UP, AskingAction.TELL_REBORN, AskingAction.WITHDRAW, AskingAction.SWALLOW),
        E.RESEND_DUE: (S.STOPPING, AskingAction.SEND_AGAIN),
        E.GRACE_OVER: (S.GIVEN_UP, AskingAction.TELL_GONE, AskingAction.SWALLOW),
        E.PATIENCE_OVER: (S.GIVEN_UP, AskingAction.TELL_UNSTOPPABLE, AskingAction.WITHDRAW, AskingAction.SWALLOW),
    }, E.ASKED, E.CANCELLED, E.HEARD, E.ACCEPTED, E.OUTDATED, E.SWALLOW_OVER),
    S.GIVEN_UP: rows(S.GIVEN_UP, {
        E.REFUSED: (S.ENDED,),
        E.FINISHED: (S.ENDED,),
        E.GONE: (S.GIVEN_UP, AskingAction.SEND_NO_MORE),
        E.BACK: (S.GIVEN_UP, AskingAction.WITHDRAW),
        E.REBORN: (S.ENDED,),
        E.RESEND_DUE: (S.GIVEN_UP, AskingAction.SEND_AGAIN),
        E.SWALLOW_OVER: (S.ENDED,),
    }, E.ASKED, E.CANCELLED, E.HEARD, E.ACCEPTED, E.OUTDATED, E.GRACE_OVER, E.PATIENCE_OVER),
    S.ENDED: rows(S.ENDED, {}, *AskingEvent),
}  # fmt: skip

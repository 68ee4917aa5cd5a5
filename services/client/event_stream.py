"""Connection events as one stream for one reader: what is open, then each change exactly once, in order. Pure.

Recognition tells each change (`keys.connection_event`), and right after it, as a state, which events of that person
are open (`keys.open_events`). A reader that comes late gets that state, and needs nothing that was told before it. A
reader that is there when recognition dies is told that the open events are `lost`.
"""

from collections.abc import Callable, Collection

from msgspec.structs import replace

from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, OpenEvents, session_of
from engage_hri.schemas.units import Seconds, Stamp

GRACE: Seconds = 2.0
"""Time that recognition may be gone before its events are lost: a router's restart looks like a death."""


class EventStream:
    """Connection events for one reader, made of everything on three keys: events, open events, liveliness.

    began: when the reader came, local time. stamp: makes a stamp of a local time. kinds: only these; all if empty.
    opening: tell also the events that were open already. open: events that have not ended, by id.
    deadline: when to call `expire`.
    """

    def __init__(
        self, began: Seconds, stamp: Callable[[Seconds], Stamp], *, kinds: Collection[str] = (), opening: bool = True
    ) -> None:
        self.open: dict[str, ConnectionEvent] = {}
        self.deadline: Seconds | None = None
        self._began = began
        self._stamp = stamp
        self._kinds = kinds
        self._opening = opening
        self._session = ""
        self._lost: tuple[ConnectionEvent, ...] = ()
        self._ended: dict[str, ConnectionEvent] = {}

    def feed(self, message: Message, at: Seconds, now: Seconds, *, past: bool = False) -> list[ConnectionEvent]:
        """Take a message; returns the changes to tell. at: the local instant that the message speaks of.

        past: the message is from before the subscription.
        """
        match message:
            case PeerAlive(participant="recognition", run=run):
                self.deadline = None
                return [*self._follow(session_of(run), now), *self._regain()]
            case PeerGone(participant="recognition"):
                self.deadline = at + GRACE
            case ConnectionEvent() if not past or at > self._began:  # which older events are open, the state tells
                return [*self._follow(message.session, now), *self._change(message)]
            case OpenEvents(session=session):
                return [*self._follow(session, now), *self._compare(message, now)]
        return []

    def expire(self, now: Seconds) -> list[ConnectionEvent]:
        """Tell all open events as lost, if `deadline` has passed: recognition stays away."""
        if self.deadline is None or now < self.deadline:
            return []
        self.deadline = None
        self._lost = tuple(self.open.values())
        return self._lose(self._lost, now)

    def _follow(self, session: str, now: Seconds) -> list[ConnectionEvent]:
        """Tell all open events as lost if this is another life of recognition: it does not know them."""
        if session in ("", self._session):
            return []
        self._session, self._lost = session, ()
        return self._lose(tuple(self.open.values()), now)

    def _regain(self) -> list[ConnectionEvent]:
        """Tell the lost events again: recognition was only cut off. The changes meanwhile come after this."""
        regained, self._lost = self._lost, ()
        return [told for event in regained for told in self._change(event)]

    def _compare(self, state: OpenEvents, now: Seconds) -> list[ConnectionEvent]:
        """Tell the differences from a person's open events. Usually there are none: the changes have come before."""
        still_open = {event.id for event in state.events}
        ended = [event for event in self.open.values() if _is_with(state.actor, event) and event.id not in still_open]
        told = self._lose(ended, now)
        # A repeated change comes before the state that follows it, so older endings need not be remembered.
        self._ended = {id: event for id, event in self._ended.items() if not _is_with(state.actor, event)}
        for event in state.events:
            if self._opening or event.id in self.open:
                told += self._change(event)
        return told

    def _change(self, event: ConnectionEvent) -> list[ConnectionEvent]:
        known = self.open.get(event.id) or self._ended.get(event.id)
        if (self._kinds and event.kind not in self._kinds) or (known and not _is_news(event, known)):
            return []
        if event.state in ENDINGS:
            self.open.pop(event.id, None)
            self._ended[event.id] = event
        else:
            self.open[event.id] = event
        return [event]

    def _lose(self, events: Collection[ConnectionEvent], now: Seconds) -> list[ConnectionEvent]:
        for event in events:
            del self.open[event.id]
        return [replace(event, state="lost", at=self._stamp(now)) for event in events]


def _is_with(person: str, event: ConnectionEvent) -> bool:
    return person in (event.initiator, event.responder)


def _is_news(event: ConnectionEvent, known: ConnectionEvent) -> bool:
    """Tell whether a change is later in the event's life than what is known, or has something else in the same place.

    This may be other words, a request of the robot that has adopted the event, or another id of the person.
    """
    if _progress(event) == _progress(known):
        people, were = (event.initiator, event.responder), (known.initiator, known.responder)
        if event.block not in ("", known.block) or (event.retold and people != were):
            return True
        return event.words != known.words and (event.retold or bool(event.words))
    return _progress(event) > _progress(known)


def _progress(event: ConnectionEvent) -> int:
    """Place of the event's state in its life: 0 started, 1 decided, 2 over."""
    return 0 if event.state == "started" else 1 if event.state == "succeeded" else 2

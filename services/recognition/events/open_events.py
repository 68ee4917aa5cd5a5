"""Open events for subscribers that come late: one message per person, made anew at each change."""

from collections.abc import Iterable

from msgspec.structs import replace

from engage_hri.schemas.recognition import ENDINGS, ConnectionEvent, OpenEvents
from engage_hri.schemas.units import Stamp


class OpenEventTracker:
    """The open events of each person with `robot`. session: prefix of the event ids."""

    def __init__(self, robot: str, session: str) -> None:
        self._robot = robot
        self._session = session
        self._open: dict[str, dict[str, ConnectionEvent]] = {}

    def feed(self, changes: Iterable[ConnectionEvent], at: Stamp) -> list[OpenEvents]:
        """Take changes of events. Returns the messages of the persons concerned. at: now."""
        touched: dict[str, tuple[ConnectionEvent, ...]] = {}
        for change in changes:
            person = change.person(self._robot)
            events = self._open.setdefault(person, {})
            if change.state in ENDINGS:
                events.pop(change.id, None)
            else:
                events[change.id] = replace(change, retold=False)
            touched[person] = tuple(events.values())
            if not events:
                del self._open[person]
        return [
            OpenEvents(actor=person, session=self._session, at=at, events=events)
            for person, events in sorted(touched.items())
        ]

    def join(self, other: str, kept: str, at: Stamp) -> list[OpenEvents]:
        """Tell the open events of a person as those of `kept`. Returns both messages if there are any. at: now."""
        if other not in self._open:
            return []
        person = {other: kept}
        moved = {
            id: replace(
                event,
                initiator=person.get(event.initiator, event.initiator),
                responder=person.get(event.responder, event.responder),
            )
            for id, event in self._open.pop(other).items()
        }
        events = self._open[kept] = {**self._open.get(kept, {}), **moved}
        told = {kept: tuple(events.values()), other: ()}
        return [OpenEvents(actor=id, session=self._session, at=at, events=each) for id, each in told.items()]

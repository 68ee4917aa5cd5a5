"""People's actions, as a perception tells them: each event, and the state that follows from it."""

from collections.abc import Iterable

from engage_hri.schemas import keys
from engage_hri.schemas.messages import Message
from engage_hri.services.bus.interface import Bus
from engage_hri.services.reports.ongoing_actions import ActionEvent, OngoingActionTracker


class PerceivedActions:
    """The actions of people that one participant perceives.

        perceived = PerceivedActions(bus)
        perceived.tell(ActorFound(actor="ann", at=bus.stamp()))
        perceived.tell(ActionBegan(actor="ann", action="look", targets=("robot",), at=bus.stamp()))

    bus: its view of the bus; its name is the reporter's.
    """

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._tracker = OngoingActionTracker()

    def tell(self, *events: ActionEvent) -> None:
        """Publish what has begun and ended, and what goes on after it. Events of one instant belong in one call.

        events: in their order, that of their stamps for each person.
        """
        for event in events:
            self._bus.publish(keys.PERCEIVED_ACTION, event)
        self.follow(events)

    def follow(self, published: Iterable[Message]) -> None:
        """Publish what goes on after events that have been published already.

        published: other messages among them are ignored.
        """
        for state in self._tracker.feed(published, self._bus.stamp()):
            if keys.is_chunk(state.actor):
                self._bus.publish(keys.perceived_ongoing(self._bus.name, state.actor), state)
        forgotten = self._tracker.forget(self._bus.now())
        self._bus.withdraw(*(keys.perceived_ongoing(self._bus.name, actor) for actor in forgotten))

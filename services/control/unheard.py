"""Behaviors that wait since nobody renews their authority. The pulse of a requester is the lease of its movements."""

from collections.abc import Mapping

from engage_hri.schemas import keys
from engage_hri.schemas.holds import BodyHeld, Hold
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.control.live import LiveBehavior


class Unheard:
    """Holds behaviors whose requester is not heard, and tells of it. live: behaviors by the name of their request."""

    def __init__(self, bus: Bus, live: Mapping[str, LiveBehavior]) -> None:
        self._bus = bus
        self._live = live
        self._held: dict[str, Hold] = {}

    def hold(self, name: str, until: Seconds | None) -> None:
        """Hold a behavior, or let it go on if `until` is None. until: when it ends unless it is renewed."""
        if (live := self._live.get(name)) is None:
            return
        live.miss(until is not None)
        if until is None:
            self.forget(name)
        else:
            since, until = self._bus.stamp(), max(until, self._bus.now())
            hold = Hold(
                block=live.request.block,
                behavior=live.request.behavior.id,
                since=since,
                until=self._bus.stamp(until),
            )
            self._held[name] = hold
            self.tell()

    def forget(self, name: str) -> None:
        """Hold a behavior no longer: it goes on, or has ended."""
        if self._held.pop(name, None) is not None:
            self.tell()

    def tell(self) -> None:
        """Publish what waits now."""
        self._bus.publish(keys.BODY_HELD, BodyHeld(at=self._bus.stamp(), holds=tuple(self._held.values())))

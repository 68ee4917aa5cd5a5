"""Behaviors that wait since nobody renews their authority.

A realizer may die, or be cut off, while an arm is on its way. The arm must not go on by a plan that nobody watches,
nor fall: a cut of half a second is common, and no reason to give up a gesture. So the pulse of a requester is the
lease of its movements (decision 0037). Whoever is not heard has its behaviors held where they can wait. They go on
when it is heard again, and end when their lease is over. Here is the list of those that wait, as it is told on the
bus.
"""

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.holds import Hold
from engage_hri.schemas.units import Stamp
from engage_hri.services.control.serving.live_behavior import LiveBehavior


class Unheard:
    """Behaviors whose requester is not heard, by the names of their requests."""

    def __init__(self) -> None:
        self._holds: dict[str, Hold] = {}

    @property
    def holds(self) -> tuple[Hold, ...]:
        """Holds that are in force, the oldest first."""
        return tuple(self._holds.values())

    def hold(self, live: LiveBehavior, since: Stamp, until: Stamp, why: Fault | None) -> None:
        """Hold a behavior. until: when it ends unless it is renewed. why: what has happened."""
        live.miss(True)
        request = live.request
        self._holds[request.id] = Hold(
            block=request.block, behavior=request.behavior.id, since=since, until=until, why=why
        )

    def let_go(self, live: LiveBehavior) -> None:
        """Let a behavior go on."""
        live.miss(False)
        self.forget(live)

    def forget(self, live: LiveBehavior) -> bool:
        """Forget a behavior that has ended. True if it was held."""
        return self._holds.pop(live.request.id, None) is not None

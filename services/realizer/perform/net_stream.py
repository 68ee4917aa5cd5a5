"""The running net of a block, published for whoever watches: what has changed, in one message for each round."""

from engage_hri.schemas import keys
from engage_hri.schemas.nets import Fired, NetMarked, NetPlace, NetPlanned, NetTransition
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.net.running import RunningNet
from engage_hri.services.realizer.plan.planner import Plan
from engage_hri.services.realizer.points import Point


class NetStream:
    """Publisher of one block's marking. An observer of the net (see net/running.py)."""

    def __init__(self, bus: Bus, block: str) -> None:
        self._bus = bus
        self._block = block
        self._fired: list[Fired] = []

    def planned(self, plan: Plan, net: RunningNet, began: Seconds) -> None:
        """Publish the net that runs from now on."""
        self._net = net
        self._began = began
        net.changes()
        transitions = [
            NetTransition(name=each.name, time=time)
            for each, time in zip(plan.net.transitions, plan.schedule, strict=True)
        ]
        places = [
            NetPlace(kind=each.kind, source=each.source, target=each.target, lag=each.lag, behavior=each.behavior)
            for each in plan.net.places
        ]
        marked = [number for number, content in enumerate(net.marking) if content]
        message = NetPlanned(
            block=self._block,
            at=self._bus.stamp(began),
            transitions=tuple(transitions),
            places=tuple(places),
            marked=tuple(marked),
        )
        self._bus.publish(keys.NET, message)

    def changed(self, *, is_over: bool = False) -> None:
        """Publish what has changed since the last message, if anything has."""
        put, taken = self._net.changes()
        fired, self._fired = self._fired, []
        if fired or put or taken or is_over:
            message = NetMarked(block=self._block, fired=tuple(fired), put=put, taken=taken, is_over=is_over)
            self._bus.publish(keys.NET, message)

    # -- what happens (see `Observer`) ---------------------------------------------------------------------------

    def on_began(self, behavior: str, at: Seconds) -> None:
        """Nothing: no token moves."""

    def on_arrived(self, point: Point, at: Seconds) -> None:
        """Nothing: the token stays in its place."""

    def on_reached(self, point: Point, at: Seconds) -> None:
        """Nothing: the net knows which places have changed."""

    def on_opened(self, transition: int) -> None:
        """Nothing: no token moves."""

    def on_fired(self, transition: int, at: Seconds) -> None:
        self._fired.append(Fired(transition=transition, time=at - self._began))

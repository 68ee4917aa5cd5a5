"""The running net of a block, published for whoever watches: what has changed, at most twenty times a second.

Before that, if it waits for its turn, for which blocks.

Messages of a stream may be dropped, and watchers may come late. So all of it is told again every two seconds.
"""

from collections.abc import Iterator
from contextlib import contextmanager

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import NetMarked, NetWaiting
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.export import described, firings
from engage_hri.services.realizer.net.running import Observer, RunningNet
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.words import Spelling
from engage_hri.services.realizer.together.live import Live
from engage_hri.services.runtime.loop import Timer

EVERY: Seconds = 0.05
"""Least time between two messages about what has changed: nobody sees more of it."""
AGAIN: Seconds = 2.0
"""Time between two messages that tell all."""


class NetStream(Observer):
    """Publisher of one block's marking. follows: ids of the blocks before it in the same turn."""

    def __init__(self, bus: Bus, block: str, spelling: Spelling, follows: tuple[str, ...] = ()) -> None:
        self._bus = bus
        self._block = block
        self._spelling = spelling
        self._follows = follows
        self._fired: dict[int, Seconds] = {}
        """Transitions that have fired since the last message."""
        self._net: RunningNet | None = None
        self._is_untold = False
        """True if the net was planned anew since the last message."""
        self._soon = Timer(self._tell)
        self._again = Timer(self._tell_all)

    def planned(self, plan: Plan, net: RunningNet, began: Seconds) -> None:
        """Publish the net that runs from now on: at once as the block begins, later in a moment.

        A block that others are tied to is planned anew several times in one moment: watchers need the last alone.
        """
        is_first = self._net is None
        self._net = net
        self._began = began
        self._plan = plan
        if is_first:
            self._tell_all()
        else:
            self._is_untold = True
            self.tell_soon()

    def tell_soon(self) -> None:
        """Publish what has changed since the last message, in a moment."""
        if self._soon.at is None:
            self._soon.set(self._bus.now() + EVERY)

    def end(self) -> None:
        """Publish the last changes: the block has ended."""
        self._tell(is_over=True)
        self.close()

    def close(self) -> None:
        """Publish nothing any more."""
        self._soon.set(None)
        self._again.set(None)

    def _tell(self, *, is_over: bool = False) -> None:
        assert self._net is not None
        if self._is_untold:
            self._tell_all()
        put, taken = self._net.changes()
        fired, self._fired = self._fired, {}
        if fired or put or taken or is_over:
            told = firings({each: at - self._began for each, at in fired.items()})
            message = NetMarked(block=self._block, fired=told, put=put, taken=taken, is_over=is_over)
            self._bus.publish(keys.NET, message)

    def _tell_all(self) -> None:
        assert self._net is not None
        self._is_untold = False
        self._net.changes()
        self._fired.clear()
        fired = {each: at - self._began for each, at in self._net.fired.items()}
        message = described(self._plan, self._bus.stamp(self._began), self._net.marking, fired, self._spelling)
        self._bus.publish(keys.NET, replace(message, block=self._block, follows=self._follows))
        self._again.set(self._bus.now() + AGAIN)

    # -- what happens (see `Observer`) ---------------------------------------------------------------------------

    def on_fired(self, transition: int, at: Seconds) -> None:
        self._fired[transition] = at


@contextmanager
def telling_of_turn(bus: Bus, live: Live) -> Iterator[None]:
    """Publish, while the body of `with` runs, for which blocks a block waits, if it waits for its turn at all.

    If it ends meanwhile, that is published, too.
    """
    block, since = live.request.block, bus.stamp()
    others = live.earlier if block.composition != "MERGE" else []
    again = Timer(lambda: tell())

    def tell(_: object = None) -> None:
        left = tuple(each.id for each in others if not each.ended.done())
        bus.publish(keys.NET, NetWaiting(block=block.id, since=since, waits_for=left))
        again.set(bus.now() + AGAIN)

    if others:
        tell()
    for each in others:
        each.ended.add_done_callback(tell)
    try:
        yield
    finally:
        again.set(None)
        for each in others:
            each.ended.remove_done_callback(tell)
        if others and live.ending.done():
            bus.publish(keys.NET, NetMarked(block=block.id, is_over=True))

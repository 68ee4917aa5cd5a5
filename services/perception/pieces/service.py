"""The service of pieces: watches a source of them, and tells the bus what lies on the table.

Where a piece lies goes into the world that all share, with the table itself. What touches what, by the rules of
Appendix A, is said in the log as it changes.
"""

import asyncio
import time
from contextlib import aclosing

from engage_hri.schemas import keys
from engage_hri.schemas.tables import Relation, TaskTable, relations
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus, Received, Subscription
from engage_hri.services.client.people.shared_world import SharedWorld
from engage_hri.services.perception.eyes.watching import InsideWatching, OutsideWatching, SourceLost, SourceOrder
from engage_hri.services.perception.pieces.colors import read_palette, task_table
from engage_hri.services.perception.pieces.config import PiecesConfig
from engage_hri.services.perception.pieces.keeping import COVERED, HandKeeper, PieceKeeper
from engage_hri.services.perception.pieces.spotting import SpottedPieces, table_settings
from engage_hri.services.perception.pieces.watching import TABLES_SEEN
from engage_hri.services.perception.sense_faults import SenseFaults
from engage_hri.services.runtime.service import Ready, tell_settings

AGAIN: Seconds = 2.0
"""Time after which a device is tried again that gave no picture."""


async def keep_an_eye(bus: Bus, ready: Ready, config: PiecesConfig) -> None:
    """Serve until cancelled, or until a film is over.

    Raises InputRefused: there is no such task or source, its colors were not learned, or a package is missing.
    """
    table = task_table(config.task)
    settings = table_settings(config, table, read_palette(config.colors, table))
    order = SourceOrder(config.source.partition(":")[0], settings)
    is_real = abs(bus.now() - time.monotonic()) < 1.0
    watching = OutsideWatching(order, TABLES_SEEN) if is_real else InsideWatching(order, TABLES_SEEN)
    with bus.subscribe(keys.ANY_ROBOT_ALIVE, keys.WORLD) as inbox:
        tell_settings(bus, "pieces", config)
        looking, is_ready = _Looking(bus, table, inbox), False
        try:
            while True:
                try:
                    async with aclosing(watching.watch()) as told:
                        async for spotted in told:
                            if not is_ready:
                                is_ready = True
                                ready()
                            if spotted is not None:
                                looking.see(spotted)
                    return
                except SourceLost as lost:
                    looking.faults.lose(lost.fault)  # all stays where it was seen last
                if not is_ready:
                    is_ready = True
                    ready()
                await asyncio.sleep(AGAIN)
        finally:
            looking.close()


class _Looking:
    """State of the service."""

    def __init__(self, bus: Bus, table: TaskTable, inbox: Subscription) -> None:
        self._bus, self._inbox = bus, inbox
        self._keeper, self._hands, self._world = PieceKeeper(table), HandKeeper(table), SharedWorld(bus.name)
        top = table.surface
        self._top = Entity(id=top.id, kind="surface", position=top.center, footprint=top.footprint)
        self._own: tuple[Entity, ...] = ()
        self._touching: frozenset[Relation] = frozenset()
        self.faults = SenseFaults(bus)

    def see(self, spotted: SpottedPieces) -> None:
        """Take what is seen in a picture."""
        self.faults.get()
        is_due = False
        while (received := self._inbox.take()) is not None:
            is_due |= self._take(received)
        pieces = self._keeper.feed(spotted, spotted.at.seconds)
        people = [each for each in self._world.entities if each.kind == "person"]
        own = (self._top, *pieces, *self._hands.feed(spotted.hands, people, spotted.at.seconds))
        if own != self._own or is_due:
            self._own = own
            self._show(spotted.at.seconds)
        self._tell_touching(pieces)

    def close(self) -> None:
        """Take away what was told."""
        self._own = ()
        self._show(self._bus.now())

    def _take(self, received: Received) -> bool:
        with self._bus.containing(received):
            return self._world.take(received.message, received.source, self._bus.now())
        return False

    def _show(self, at: Seconds) -> None:
        entities = self._world.tell(self._own, self._bus.now())
        self._bus.publish(keys.WORLD, World(entities=entities, at=self._bus.stamp(at)))

    def _tell_touching(self, pieces: tuple[Entity, ...]) -> None:
        """Say in the log what touches what, of pieces that rest in view."""
        sure = [each for each in pieces if each.confidence > COVERED and not any(each.velocity)]
        ids, now = {each.id for each in sure}, relations(sure)
        hidden = {each for each in self._touching if not {each.piece, each.landmark} <= ids}
        for each in sorted(now - self._touching, key=str):
            self._bus.log.info("%s touches the %s of %s", each.piece, each.side, each.landmark)
        for each in sorted(self._touching - now - hidden, key=str):
            self._bus.log.info("%s does not touch the %s of %s any more", each.piece, each.side, each.landmark)
        self._touching = now | hidden

"""Ids of the objects that somebody who writes for the robot may name now."""

from collections.abc import Callable

from engage_hri.schemas.units import Seconds
from engage_hri.schemas.world import COVERED_FOR, CoveredObjects, World
from engage_hri.services.client.chunking import UNKNOWN
from engage_hri.services.client.feeds import Feed
from engage_hri.services.text.marks import Ids

WORLD_PATIENCE: Seconds = 0.3
"""Time from the start of a turn for which a bracket waits for the world: it alone says what a reference is."""


class KnownObjects:
    """Ids of the objects in the world as it is, with those that are covered for a moment."""

    def __init__(self, worlds: Feed[World], now: Callable[[], Seconds]) -> None:
        self._worlds = worlds
        self._now = now
        self._objects = CoveredObjects(COVERED_FOR)
        self._ids = UNKNOWN
        self._until = now() + WORLD_PATIENCE

    @property
    def known(self) -> Ids:
        """The ids as they were last told."""
        return self._ids

    async def ids(self, *, is_needed: bool) -> Ids:
        """Return the ids, or `UNKNOWN`. is_needed: wait for a world that nobody has told yet."""
        patience = max(0.0, self._until - self._now()) if is_needed and self._ids.is_unknown else 0.0
        while (world := await self._worlds.next(patience)) is not None:
            self._objects.see(world, self._now())
            patience = 0.0
        if (known := self._objects.at(self._now())) is not None:
            found = frozenset(each.id for each in known.objects)
            self._ids = self._ids if not self._ids.is_unknown and found == self._ids.ids else Ids(found)
        return self._ids

"""Services that are on the bus, or were."""

import asyncio

from engage_hri.schemas import keys
from engage_hri.schemas.presence import PeerAlive, PeerGone


class Presence:
    """Services that are, or were, on the bus; not managers: ever new ones come. changed: at the next change."""

    def __init__(self) -> None:
        self._there: set[str] = set()
        self._left: set[str] = set()
        self._loop = asyncio.get_running_loop()
        self.changed: asyncio.Future[None] = self._loop.create_future()

    def feed(self, message: PeerAlive | PeerGone) -> None:
        if message.participant not in keys.SERVICES:
            return
        now, before = (self._there, self._left) if isinstance(message, PeerAlive) else (self._left, self._there)
        now.add(message.participant)
        before.discard(message.participant)
        self.changed.set_result(None)
        self.changed = self._loop.create_future()

    def has_left(self, participant: str) -> bool:
        """True if the participant was there and is not now."""
        return participant in self._left

    def __contains__(self, participant: str) -> bool:
        return participant in self._there

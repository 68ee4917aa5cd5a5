"""Who is on the bus, as the realizer hears it."""

import asyncio

from engage_hri.schemas.presence import PeerAlive, PeerGone


class Presence:
    """Who is on the bus. changed: resolved when that changes next."""

    def __init__(self) -> None:
        self._there: set[str] = set()
        self._left: set[str] = set()
        self._loop = asyncio.get_running_loop()
        self.changed: asyncio.Future[None] = self._loop.create_future()

    def feed(self, message: PeerAlive | PeerGone) -> None:
        now, before = (self._there, self._left) if isinstance(message, PeerAlive) else (self._left, self._there)
        now.add(message.participant)
        before.discard(message.participant)
        self.changed.set_result(None)
        self.changed = self._loop.create_future()

    def has_left(self, participant: str) -> bool:
        """It was there, and is not now. Who never showed himself has not."""
        return participant in self._left

    def __contains__(self, participant: str) -> bool:
        return participant in self._there

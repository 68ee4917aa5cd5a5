"""What the performances of one realizer share."""

import asyncio
from collections.abc import Callable, Iterable, MutableMapping
from typing import Protocol

from msgspec import Struct

from engage_hri.schemas.body import SyncPointArrived, SyncPointReached
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.services.bus.interface import Bus, Containing
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.perform.live_blocks import LiveBlocks
from engage_hri.services.requests.ends import Requester


class PeersThere:
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


class Moving(Protocol):
    """What a performance is to the others, and to the reports of the body."""

    @property
    def parts_moving(self) -> set[str]: ...
    def containing(self) -> Containing: ...
    def feed(self, message: SyncPointArrived | SyncPointReached) -> None: ...


class Surroundings(Struct, frozen=True):
    """routes: the block of each request to the body. others: all that are performed. live_blocks: for ties."""

    bus: Bus
    requests: Requester
    config: RealizerConfig
    peers: PeersThere
    routes: MutableMapping[str, Moving]
    others: Callable[[], Iterable[Moving]]
    live_blocks: LiveBlocks

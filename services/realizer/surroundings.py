"""What a performance has around it, and how it ends."""

import asyncio
from collections.abc import Callable, Iterable, MutableMapping
from typing import TYPE_CHECKING, Literal

from msgspec import Struct

from schemas.faults import Fault
from schemas.presence import PeerAlive, PeerGone
from services.bus import Bus
from services.realizer.config import RealizerConfig
from services.realizer.ledger import Ledger
from services.requests import Requester

if TYPE_CHECKING:
    from services.realizer.executor import Performance

Status = Literal["done", "failed", "interrupted"]


class Ending(Struct, frozen=True):
    """Why a block ends."""

    status: Status
    fault: Fault | None = None
    replaced_by: str = ""


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


class Surroundings(Struct, frozen=True):
    """What performances of one realizer share.

    routes: whose body requests are whose. others: all that are performed. ledger: what they may be tied to.
    """

    bus: Bus
    requests: Requester
    config: RealizerConfig
    peers: Presence
    routes: MutableMapping[str, "Performance"]
    others: Callable[[], Iterable["Performance"]]
    ledger: Ledger

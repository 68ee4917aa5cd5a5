"""The context that all performances of one realizer share."""

import asyncio
from collections.abc import Callable, Iterable, MutableMapping
from typing import Protocol

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.body import SyncPointArrived, SyncPointReached
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus, Containing
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.together.body_questions import is_crowd, parts_moved
from engage_hri.services.realizer.together.live_blocks import LiveBlocks
from engage_hri.services.realizer.together.rehearsal import Ask, Rehearsing
from engage_hri.services.realizer.together.ties import Tied
from engage_hri.services.requests.ends import Requester


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


class Moving(Tied, Protocol):
    """A performance, as the others and the reports of the body see it."""

    rehearsing: Rehearsing

    @property
    def parts_moving(self) -> set[str]: ...
    @property
    def last_deed(self) -> Seconds: ...
    def containing(self) -> Containing: ...
    def feed(self, message: SyncPointArrived | SyncPointReached) -> None: ...


class SharedContext(Struct, frozen=True):
    """Context of every performance.

    routes: for the id of each request to the body, the performance that sent it. others: all performances, in the
    order in which they began. live_blocks: for ties between blocks. over: told of each block and behavior of it that
    is held and has ended. ask: asks the body about behaviors of a block.
    """

    bus: Bus
    requests: Requester
    config: RealizerConfig
    peers: Presence
    routes: MutableMapping[str, Moving]
    others: Callable[[], Iterable[Moving]]
    live_blocks: LiveBlocks
    over: Callable[[str, str], None]
    ask: Ask

    def rehearse(self, plan: Plan, but: object = None) -> None:
        """Let blocks rehearse what is to come, since a plan is new. but: a performance that need not."""
        performed = list(self.others())
        parts = parts_moved(plan, plan.chains)
        for each in () if is_crowd(performed) else performed:
            if each is not but:
                each.rehearsing.look_again(parts)

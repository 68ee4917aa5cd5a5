"""What a performance has around it, how it ends, and who ends with it."""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, MutableMapping, Sequence
from typing import TYPE_CHECKING, Literal

from msgspec import Struct

from engage_hri.schemas.blocks import BlockOutcome, PerformBlock
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.services.bus.interface import Bus
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.perform.ledger import Ledger
from engage_hri.services.requests.ends import Requester

if TYPE_CHECKING:
    from engage_hri.services.realizer.perform.performance import Performance

Status = Literal["done", "failed", "interrupted"]


class Ending(Struct, frozen=True):
    """Why a block ends."""

    status: Status
    fault: Fault | None = None
    replaced_by: str = ""


class Live:
    """A block from its request to its outcome.

    earlier: those that were there when it came. ended: resolved when its outcome is out. ending: how it is to end.
    """

    def __init__(self, request: PerformBlock, earlier: Sequence["Live"]) -> None:
        loop = asyncio.get_running_loop()
        self.request = request
        self.earlier = list(earlier)
        self.ended: asyncio.Future[None] = loop.create_future()
        self.ending: asyncio.Future[Ending] = loop.create_future()
        self.performance: Performance | None = None
        there = {each.request.block.id: each for each in reversed(earlier)}  # a second of an id is refused
        self.leaders = tuple([there[id] for id in request.follows if id in there])
        """Those whose turn it goes on with: it ends with any of them that is not done."""
        self.ended_by: Live | None = None
        """The one of them that it ends with."""
        self._followers: list[Live] = []
        for leader in self.leaders:
            leader._followers.append(self)
            if leader.ending.done():
                self._end_with(leader)

    def stop(self, ending: Ending) -> None:
        """End it now. The first to end it decides how. Its followers end at once: before they hear what is lost."""
        if self.ending.done():
            return
        self.ending.set_result(ending)
        todo = deque([self])
        while todo:
            leader = todo.popleft()
            todo += [each for each in leader._followers if each._end_with(leader)]

    def _end_with(self, leader: "Live") -> bool:
        """Whether it does."""
        ending = leader.ending.result()
        if ending.status == "done" or self.ending.done():
            return False
        verb = "failed" if ending.status == "failed" else "was interrupted"
        why = f": {ending.fault.reason}" if ending.fault else ""
        fault = Fault(reason=f"{leader.request.block.id}, which it follows, {verb}{why}", where=self.request.block.id)
        self.ended_by = leader
        self.ending.set_result(Ending("interrupted", fault, ending.replaced_by))
        return True

    def __str__(self) -> str:
        return f"block {self.request.block.id}"

    def fail(self, fault: Fault) -> None:
        self.stop(Ending("failed", fault))

    @property
    def outcome(self) -> BlockOutcome:
        """As it is if nothing of it was performed."""
        ending = self.ending.result()
        return BlockOutcome(
            id=self.request.id,
            block=self.request.block.id,
            status=ending.status,
            replaced_by=ending.replaced_by,
            fault=ending.fault,
        )


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

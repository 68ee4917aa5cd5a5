"""The life of a block, from its request to its outcome: how it ends, and which blocks end with it."""

import asyncio
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.advice import suggestion
from engage_hri.schemas.blocks import Block, BlockOutcome, PerformBlock
from engage_hri.schemas.faults import Fault
from engage_hri.services.realizer.points import as_told
from engage_hri.services.realizer.together.live_blocks import Past

Status = Literal["done", "failed", "interrupted"]


class Ending(Struct, frozen=True):
    """Reason for the end of a block."""

    status: Status
    fault: Fault | None = None
    replaced_by: str = ""


def told(fault: Fault) -> Fault:
    """The fault with the ids of blocks for their names."""
    texts = {"reason": fault.reason, "where": fault.where, "advice": fault.advice}
    return replace(fault, **{field: as_told(text) for field, text in texts.items()})


def absence(block: str, behavior: str, live: Iterable["Live"]) -> Fault:
    """Fault that a block, or a behavior of it, is not being performed. live: all live blocks."""
    where, named = f"{block}: {behavior}" if behavior else block, {each.id: each for each in live}
    if block not in named:
        reason, advice = f"no live block is called {block!r}", suggestion(block, named, "none is live")
    elif behavior not in (known := {each.id for each in named[block].block.behaviors}):
        reason = f"block {block!r} has no behavior {behavior!r}"
        advice = suggestion(behavior, known, "it has no behaviors")
    else:
        reason, advice = "it has ended, or was dropped or interrupted", ""
    return Fault(reason=f"it is not being performed: {reason}", where=where, advice=advice)


class Live:
    """A block from its request to its outcome.

    block: as it is performed, with names for ids (see `LiveBlocks`). elsewhere: other live blocks that it may refer
    to, by name. earlier: blocks that were live when it came. ended: resolved when its outcome is out. ending: how it
    is to end.
    """

    def __init__(self, request: PerformBlock, earlier: Sequence["Live"], past: Past[Ending]) -> None:
        """past: how the blocks have ended that are over, by id."""
        loop = asyncio.get_running_loop()
        self.request = request
        self.block = request.block
        self.elsewhere: Mapping[str, Block] = {}
        self.earlier = list(earlier)
        self.ended: asyncio.Future[None] = loop.create_future()
        self.ending: asyncio.Future[Ending] = loop.create_future()
        self.settled: asyncio.Future[None] = loop.create_future()
        """Resolved while it is being performed, has ended, or waits for its turn: others can be planned now."""
        self.is_planning = False
        """True while it is planned, with those in mind that are being performed: no other is to begin meanwhile."""
        there = {each.id: each for each in reversed(earlier)}  # a second one with an id is refused
        self.leaders = tuple([there[id] for id in request.follows if id in there])
        """Live blocks that it continues (`follows`): it ends with any of them that ends otherwise than done."""
        over = {id: past.get(id) for id in request.follows if id not in there}
        self.unknown = tuple([id for id, ending in over.items() if ending is None])
        """Ids of blocks that it continues and of which nothing is known."""
        self.ended_by: Live | None = None
        """The leader that it ends with."""
        self.taken_out: dict[str, str] = {}
        """Behaviors that were interrupted before it has begun, each with the reason if one was given."""
        self._followers: list[Live] = []
        for leader in self.leaders:
            leader._followers.append(self)
            if leader.ending.done():
                self._end_with(leader)
        for id, ending in over.items() if not self.unknown else ():
            if ending is not None:
                self._end_after(id, ending)

    def has_yet(self, behavior: str) -> bool:
        """True if a behavior is to be performed when it begins."""
        return behavior not in self.taken_out and any(each.id == behavior for each in self.block.behaviors)

    def settle(self) -> None:
        """Let blocks that came later be planned."""
        self.is_planning = False
        if not self.settled.done():
            self.settled.set_result(None)

    def unsettle(self) -> None:
        """Let blocks that come be planned after this one: its turn has come."""
        if self.settled.done():
            self.settled = asyncio.get_running_loop().create_future()

    def stop(self, ending: Ending) -> None:
        """End it now, as the first call says. Its followers end at once, before they hear what is lost."""
        if self.ending.done():
            return
        self.ending.set_result(replace(ending, fault=None if ending.fault is None else told(ending.fault)))
        todo = deque([self])
        while todo:
            leader = todo.popleft()
            todo += [each for each in leader._followers if each._end_with(leader)]

    def _end_with(self, leader: "Live") -> bool:
        """End it because its leader ends; False if that is no reason, or it ends already."""
        if not self._end_after(leader.id, leader.ending.result()):
            return False
        self.ended_by = leader
        return True

    def _end_after(self, leader: str, ending: Ending) -> bool:
        """End it because a block that it continues has ended so; False if that is no reason, or it ends already."""
        if ending.status == "done" or self.ending.done():
            return False
        verb = "failed" if ending.status == "failed" else "was interrupted"
        reason = f"{leader}, which it follows, {verb}"
        fault = ending.fault.following(reason, self.id) if ending.fault else Fault(reason=reason, where=self.id)
        self.ending.set_result(Ending("interrupted", fault, ending.replaced_by))
        return True

    def __str__(self) -> str:
        return f"block {self.id}"

    @property
    def id(self) -> str:
        """Id of the block, as its manager knows it."""
        return self.request.block.id

    def fail(self, fault: Fault) -> None:
        self.stop(Ending("failed", fault))

    @property
    def outcome(self) -> BlockOutcome:
        """The outcome if nothing of it was performed."""
        ending = self.ending.result()
        return BlockOutcome(
            id=self.request.id,
            block=self.id,
            status=ending.status,
            replaced_by=ending.replaced_by,
            fault=ending.fault,
        )

"""What live blocks may be to one another: whose points others can name, when each is to be, or was, or never will."""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from math import inf
from typing import Protocol

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.syncref import BLOCK_ITSELF
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.schedule import EPSILON
from engage_hri.services.realizer.points import Point


class TiedBlock(Protocol):
    """A block that is tied to points of others. Their behaviors are named `block:behavior`."""

    def hear(self, point: Point, at: Seconds) -> None:
        """A point of another block is reached."""

    def foresee(self, point: Point, at: Seconds) -> None:
        """A point of another block is expected at another time than before."""

    def miss(self, behaviors: Iterable[str]) -> None:
        """What has not been reached of these never will be."""


class Author(Protocol):
    """A block that is being performed."""

    def follow(self, points: Iterable[Point]) -> None:
        """Others are tied to these points of it: tell them from now on when they are expected."""


class _Page:
    """Of one live block. lost: behaviors that were dropped. named: its points that others are tied to.

    expected: when these are to be, as far as is known and has been told.
    """

    def __init__(self, block: Block) -> None:
        self.block = block
        self.author: Author | None = None
        self.named: set[Point] = set()
        self.expected: dict[Point, Seconds] = {}
        self.reached: dict[Point, Seconds] = {}
        self.lost: set[str] = set()
        self.followers: list[TiedBlock] = []


class LiveBlocks:
    """All live blocks, from their request to their end. Ids are free again after that."""

    def __init__(self) -> None:
        self._pages: dict[str, _Page] = {}
        self._untold: deque[tuple[_Page, Point, Seconds]] = deque()
        """What followers have not been told yet: they foresee otherwise for it, and theirs are told after that."""
        self._is_telling = False

    @contextmanager
    def opened(self, block: Block) -> Iterator[None]:
        """The block lives inside."""
        page = self._pages[block.id] = _Page(block)
        try:
            yield
        finally:
            del self._pages[block.id]
            ends = (BLOCK_ITSELF, *(behavior.id for behavior in block.behaviors))
            for follower in list(page.followers):
                follower.miss(f"{block.id}:{id}" for id in ends)

    @property
    def blocks(self) -> Mapping[str, Block]:
        return {id: page.block for id, page in self._pages.items()}

    def reach(self, block: str, point: Point, at: Seconds) -> None:
        """A point of a live block is reached. The block itself is the behavior `bml`."""
        page = self._pages[block]
        page.reached[point] = at
        for follower in list(page.followers):
            follower.hear(_qualified(block, point), at)

    def perform(self, block: str, author: Author) -> None:
        """It begins."""
        page = self._pages[block]
        page.author = author
        author.follow(page.named)

    def foresee(self, block: str, expected: Mapping[Point, Seconds]) -> None:
        """When points of a live block are to be. What is no news is not told."""
        page = self._pages[block]
        for point, at in expected.items():
            if abs(at - page.expected.get(point, inf)) > EPSILON:
                page.expected[point] = at
                self._untold.append((page, point, at))
        if not self._is_telling:
            self._is_telling = True
            try:
                self._tell()
            finally:
                self._is_telling = False

    def _tell(self) -> None:
        """One after the other: a turn may be a chain of more blocks than calls may be nested."""
        while self._untold:
            page, point, at = self._untold.popleft()
            for follower in list(page.followers):
                follower.foresee(_qualified(page.block.id, point), at)

    def lose(self, block: str, behavior: str) -> None:
        """A behavior of a live block is dropped. Said again, it is no news."""
        page = self._pages[block]
        if behavior in page.lost:
            return
        page.lost.add(behavior)
        for follower in list(page.followers):
            follower.miss((f"{block}:{behavior}",))

    @contextmanager
    def followed(self, follower: TiedBlock, points: Iterable[Point], blocks: Mapping[str, Block]) -> Iterator[None]:
        """Tell `follower` what becomes of these points of other `blocks`, and what already has.

        A block that has taken the id of one of them since is another block.
        """
        wanted = sorted(points)
        there = ((id, self._pages.get(id)) for id in map(_home, wanted))
        pages = {id: page for id, page in there if page is not None and page.block is blocks.get(id)}
        for page in pages.values():
            page.followers.append(follower)
        for point in wanted:
            block = _home(point)
            named = Point(point.behavior.removeprefix(f"{block}:"), point.sync)
            page_or_none = pages.get(block)
            if page_or_none is None or named.behavior in page_or_none.lost:
                follower.miss((point.behavior,))
            elif (at := page_or_none.reached.get(named)) is not None:
                follower.hear(point, at)
            else:
                page_or_none.named.add(named)
                if (expected := page_or_none.expected.get(named)) is not None:
                    follower.foresee(point, expected)
        for page in pages.values():
            if page.author is not None:
                page.author.follow(page.named)
        try:
            yield
        finally:
            for page in pages.values():
                page.followers.remove(follower)


def _qualified(block: str, point: Point) -> Point:
    """As other blocks name it."""
    return Point(f"{block}:{point.behavior}", point.sync)


def _home(point: Point) -> str:
    """The block of a point that is named from elsewhere."""
    return point.behavior.partition(":")[0]

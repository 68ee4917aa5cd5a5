"""Receipts: what a window and one of its pages know of the page's orders, whichever links break between them. Pure.

The page numbers its orders as it sends them: 1, 2, 3... The window takes each number once, and none before the one
that precedes it, and tells which it took last. So a page whose link was cut learns from the first frame of the next
one which orders arrived, and sends exactly the others. News of orders are told again until a frame with them was
drawn.
"""

from collections import deque
from typing import Literal

from msgspec import Struct

Panel = Literal["part", "wizard", "player"]
"""Panel in which an order was given: the seat, the robot by hand, or the bar of a recording."""
MOST = 1000
"""Number of news that wait for a page that draws nothing; it may give no more orders then."""


class OrderNews(Struct, frozen=True, omit_defaults=True):
    """News of an order for who gave it. number: of the news; a page that has seen it does not show it again.

    refused: number of the order that was not done for the reason in `text`; 0: none was refused.
    """

    number: int
    panel: Panel
    text: str
    refused: int = 0


class Receipts:
    """Receipts for one page. session: their id; a page that comes back with it has its orders counted on.

    taken: number of the last order that was taken.
    """

    def __init__(self, session: str = "") -> None:
        self.session = session
        self.taken = 0
        self._news: deque[OrderNews] = deque()
        self._told = 0
        """Number of the last news."""
        self._shown = 0
        """Number of the last news that was in a frame."""

    @property
    def is_full(self) -> bool:
        """True while the page has to draw news before it may give more orders."""
        return len(self._news) >= MOST

    def take(self, number: int) -> bool:
        """Take an order by its number. Returns whether it is to be carried out: it was not taken before."""
        is_next = number == self.taken + 1
        self.taken += is_next
        return is_next

    def tell(self, panel: Panel, text: str, *, refused: int = 0) -> None:
        """Tell the page something about an order. refused: the number of one that is not done."""
        self._told += 1
        self._news.append(OrderNews(self._told, panel, text, refused))

    def news(self) -> tuple[OrderNews, ...]:
        """All news for the next frame: those of which it is not known that they were drawn."""
        self._shown = self._told
        return tuple(self._news)

    def confirm(self) -> None:
        """Take note that the last frame was drawn."""
        while self._news and self._news[0].number <= self._shown:
            self._news.popleft()

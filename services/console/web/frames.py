"""Frames and receipts: what a page gets next. Pure.

A frame is all that has changed since the last one that a browser drew.

A receipt is what the window and one of its pages know of the page's orders, whichever links break between them. The
page numbers its orders as it sends them: 1, 2, 3... The window takes each number once, and none before the one that
precedes it, and tells which it took last. So a page whose link was cut learns from the first frame of the next one
which orders arrived, and sends exactly the others. News of orders are told again until a frame with them was drawn.
"""

from collections import deque
from typing import Protocol

from msgspec import Raw, Struct
from msgspec.json import Encoder

from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web.orders import Panel

NEWS_KEPT = 1000
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
        return len(self._news) >= NEWS_KEPT

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


HEARTBEAT: Seconds = 1.0
"""Time after which a browser gets a frame though nothing has changed, so that it knows that the window is there."""


class PageFrame(Struct, frozen=True, omit_defaults=True):
    """Message to the browser. now: seconds of the picture. sections: by name. gone: names of those that are over.

    session: id of what the window keeps of this page, in the first frame of a link. taken: number of the last
    order that it has taken, in the first frame and whenever it changes. told: what became of orders. you: who looks
    at this page. place: of a recording, where the page is in it.
    """

    now: Seconds
    sections: dict[str, Raw] = {}
    gone: tuple[str, ...] = ()
    session: str = ""
    taken: int | None = None
    you: "You | None" = None
    told: tuple[OrderNews, ...] = ()
    place: "PlaybackPlace | None" = None


class PlaybackPlace(Struct, frozen=True):
    """Place of a page in a recording.

    at, end: seconds from its beginning. speed: times as fast as it was. visit: counts how often the page has jumped;
    what it knew before a jump is void.
    """

    at: Seconds
    end: Seconds
    paused: bool
    speed: float
    visit: int


class You(Struct, frozen=True):
    """The one who looks at a page.

    person: id of the person that they are; empty: none. there: who sits before the robot already, in words, and what
    that means for somebody who sits down. sit: what the button for that says. denied: rights that they do not have,
    with the reason.
    script: titles of the prepared fragments. faults: kinds of faults that the body can play. inhibits: they keep the
    gaze now.
    """

    person: str = ""
    there: str = ""
    sit: str = ""
    denied: dict[str, str] = {}
    script: tuple[str, ...] = ()
    faults: tuple[str, ...] = ()
    inhibits: bool = False


class Shown(Protocol):
    """Source of what a page shows: the picture, or a part of it."""

    @property
    def versions(self) -> dict[str, int]:
        """Number of the newest state of each section."""

    def section(self, name: str) -> bytes:
        """A section as JSON."""

    def zero(self, at: Seconds) -> Seconds:
        """Seconds of the picture at a local instant."""


class Viewer:
    """One browser, which draws a frame before it gets the next: a slow one misses frames, and nothing queues up."""

    def __init__(self) -> None:
        self._known: dict[str, int] = {}
        self._you: You | None = None
        self._taken: int | None = None
        self._told: Seconds | None = None
        self._place: PlaybackPlace | None = None
        self._encoder = Encoder()

    def frame(
        self,
        picture: Shown,
        now: Seconds,
        you: You | None = None,
        receipts: Receipts | None = None,
        place: PlaybackPlace | None = None,
        clock: Seconds | None = None,
    ) -> bytes | None:
        """The next frame as JSON; None: there is nothing new, and the browser has heard of the window lately.

        receipts: of the orders of its page. place: with a recording; at another visit the picture is another one, and
        is told whole. clock: what runs on while the time of the picture stands still; None: that never does.
        """
        told: tuple[OrderNews, ...] = ()
        taken, session = None, ""
        if receipts is not None:
            told = receipts.news()
            taken = receipts.taken if receipts.taken != self._taken else None
            session = receipts.session if self._taken is None else ""
            self._taken = receipts.taken
        if place is not None and (self._place is None or place.visit != self._place.visit):
            self._known = {}
        is_moved, self._place = place != self._place, place
        versions = picture.versions
        new = {name: version for name, version in versions.items() if self._known.get(name) != version}
        gone = tuple(self._known.keys() - versions.keys())
        beat = now if clock is None else clock
        is_new = new or gone or told or taken is not None or is_moved or you != self._you
        if not is_new and self._told is not None and beat - self._told < HEARTBEAT:
            return None
        self._told = beat
        self._known = dict(versions)
        sections = {name: Raw(picture.section(name)) for name in new}
        news, self._you = (you if you != self._you else None), you
        return self._encoder.encode(PageFrame(picture.zero(now), sections, gone, session, taken, news, told, place))

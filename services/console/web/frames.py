"""Frames: what a browser gets next, which is all that has changed since the last one that it drew. Pure."""

from msgspec import Raw, Struct
from msgspec.json import Encoder

from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web.picture import Picture
from engage_hri.services.console.web.receipts import OrderNews, Receipts

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
        picture: Picture,
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
        new = {name: version for name, version in picture.versions.items() if self._known.get(name) != version}
        gone = tuple(self._known.keys() - picture.versions.keys())
        beat = now if clock is None else clock
        is_new = new or gone or told or taken is not None or is_moved or you != self._you
        if not is_new and self._told is not None and beat - self._told < HEARTBEAT:
            return None
        self._told = beat
        self._known = dict(picture.versions)
        sections = {name: Raw(picture.section(name)) for name in new}
        news, self._you = (you if you != self._you else None), you
        return self._encoder.encode(PageFrame(picture.zero(now), sections, gone, session, taken, news, told, place))

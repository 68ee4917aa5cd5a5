"""Frames: what a browser gets next, which is all that has changed since the last one that it drew. Pure."""

from msgspec import Raw, Struct
from msgspec.json import Encoder

from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web.picture import Picture

HEARTBEAT: Seconds = 1.0
"""Time after which a browser gets a frame though nothing has changed, so that it knows that the window is there."""


class Frame(Struct, frozen=True, omit_defaults=True):
    """Message to the browser. now: seconds of the picture. sections: by name. gone: names of those that are over."""

    now: Seconds
    sections: dict[str, Raw] = {}
    gone: tuple[str, ...] = ()


class Viewer:
    """One browser, which draws a frame before it gets the next: a slow one misses frames, and nothing queues up."""

    def __init__(self) -> None:
        self._known: dict[str, int] = {}
        self._told: Seconds | None = None
        self._encoder = Encoder()

    def frame(self, picture: Picture, now: Seconds) -> bytes | None:
        """The next frame as JSON; None: there is nothing new, and the browser has heard of the window lately."""
        new = {name: version for name, version in picture.versions.items() if self._known.get(name) != version}
        gone = tuple(self._known.keys() - picture.versions.keys())
        if not new and not gone and self._told is not None and now - self._told < HEARTBEAT:
            return None
        self._told = now
        self._known = dict(picture.versions)
        sections = {name: Raw(picture.section(name)) for name in new}
        return self._encoder.encode(Frame(picture.zero(now), sections, gone))

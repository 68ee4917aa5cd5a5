"""Links that Zenoh has forgotten: they still bring messages, and nothing is sent to their other end any more.

When a link is full, each thread of Zenoh that waits for it ends it. The other process calls again at once, and a
thread that is late then strikes the new link off the table of those to send to: Zenoh 1.10 strikes off whatever it
has of that process. Nobody is told, so it stays like that (docs/decisions/0136-a-link-that-zenoh-has-forgotten.md).
"""

import asyncio
import socket
from collections.abc import Callable
from typing import Any

import zenoh

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.zenoh.volume import end, place

LOOK: Seconds = 0.5
"""Time between two looks."""


class Forgotten:
    """Ends the links of this process that Zenoh has forgotten, so that they are opened anew, until it is closed."""

    def __init__(self, session: zenoh.Session, tell: Callable[[str], None]) -> None:
        """tell: called with a line for each link that is ended."""
        self._info: Any = session.info
        self._tell = tell
        self._links: dict[tuple[str, str], tuple[str, str]] = {}
        """Id of the process at the other end of each link, and how it is called, by the places of both ends."""
        self._loop = asyncio.get_running_loop()
        self._timer = self._loop.call_later(LOOK, self._look)

    def close(self) -> None:
        self._timer.cancel()

    def changed(self, event: zenoh.LinkEvent) -> None:
        """Take a link that has come or gone."""
        link = event.link
        zid, places = str(link.zid), (place(str(link.src)), place(str(link.dst)))
        if event.kind == zenoh.SampleKind.PUT:
            self._links[places] = (zid, link.auth_identifier or f"process {zid}")
        else:
            self._links.pop(places, None)

    def _look(self) -> None:
        self._timer = self._loop.call_later(LOOK, self._look)
        known = {str(transport.zid) for transport in self._info.transports()}
        lost = {places: name for places, (zid, name) in self._links.items() if zid not in known}
        if lost:
            # Only what comes is cut off: so Zenoh has done with the link before the other process calls again.
            for places in end(lambda own, other: (own, other) in lost, socket.SHUT_RD):
                self._tell(f"deaf: Zenoh sends {lost[places]} nothing any more; their link is opened anew")

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
        self._links: dict[str, tuple[tuple[str, str], str]] = {}
        """Places of both ends of the link to each process, and how it is called. Zenoh does not tell of every end."""
        self._loop = asyncio.get_running_loop()
        self._timer = self._loop.call_later(LOOK, self._look)

    def close(self) -> None:
        self._timer.cancel()

    def changed(self, event: zenoh.LinkEvent) -> None:
        """Take a link that has come or gone."""
        link = event.link
        zid, places = str(link.zid), (place(str(link.src)), place(str(link.dst)))
        if event.kind == zenoh.SampleKind.PUT:
            self._links[zid] = (places, link.auth_identifier or f"process {zid}")
        elif zid in self._links and self._links[zid][0] == places:
            del self._links[zid]

    def _look(self) -> None:
        self._timer = self._loop.call_later(LOOK, self._look)
        known = {str(transport.zid) for transport in self._info.transports()}
        if gone := self._links.keys() - known:
            lost = dict(self._links.pop(zid) for zid in gone)
            # Only what comes is cut off: so Zenoh has done with the link before the other process calls again.
            for places in end(lambda own, other: (own, other) in lost, socket.SHUT_RD):
                self._tell(f"deaf: Zenoh sends {lost[places]} nothing any more; their link is opened anew")

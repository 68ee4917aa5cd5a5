"""Links of this process: news of the router, and those that Zenoh has forgotten.

The router has one line when it is gone, and one when it is back. A link that Zenoh has forgotten still brings
messages, and nothing is sent to its other end any more. When a link is full, each thread of Zenoh that waits for it
ends it. The other process calls again at once, and a thread that is late then strikes the new link off the table of
those to send to: Zenoh 1.10 strikes off whatever it has of that process. Nobody is told, so it stays like that
(docs/decisions/0136-a-link-that-zenoh-has-forgotten.md).
"""

import asyncio
import os
import socket
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from math import inf
from typing import Any, NamedTuple

import zenoh

from engage_hri.schemas.access import LOUD, LOUD_ROBOT
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.zenoh.bridge import LoopBridge

# -- bytes that links bring and carry away ---------------------------------------------------------------------------
# Zenoh drops a message that is too large before it is whole, and says nothing of it; nor does it count. The router
# does not close the link of one who is loud (docs/decisions/0111-a-flood-is-told-and-not-cut.md).
#
# It ends the link of one who reads nothing. Zenoh would, but waits for the other side with its goodbye, and as long
# each further message for that link halts whoever sends it (docs/decisions/0135-a-link-that-is-not-read-is-ended.md).

SPAN: Seconds = 1.0
"""Time over which their speed is taken."""
FULL = 32_768
"""Bytes that wait for a link to be read from which on it counts as full: a quarter of what may wait."""
UNREAD: Seconds = 0.15
"""Time without a byte that is read after which a full link is ended. Zenoh itself gives it 0.2 s (`STALL_US`)."""
EXCUSED = 4
"""Bytes that a holder may send besides for each that it gets: who is asked much has to answer."""
_COUNTS = 120
"""Place of `tcpi_bytes_acked` and `tcpi_bytes_received` in the kernel's `struct tcp_info`, and after the numbers of
segments `tcpi_notsent_bytes`."""


class Link(NamedTuple):
    """A link of the router. zid: of the process at its other end. name: that in its certificate, if it has one.

    address: of its other end, as Zenoh writes it.
    """

    zid: str
    name: str
    address: str


class Volume(NamedTuple):
    """Bytes that a link has brought since it opened, that it has carried away, and that wait for it to be read."""

    brought: int
    taken: int = 0
    waiting: int = 0


class Volumes:
    """Tells when a link begins to be loud. Pure: time is an argument."""

    def __init__(self, now: Seconds) -> None:
        self._at = now
        self._before: Mapping[str, Volume] = {}
        self._loud: frozenset[str] = frozenset()

    def look(self, volumes: Mapping[str, Volume], names: Mapping[str, str], now: Seconds) -> list[str]:
        """Take the volumes of all links; returns the lines to tell.

        names: common names of the other ends, by link.
        """
        span, self._at = max(now - self._at, SPAN), now
        speeds = {link: self._came(link, volume) / span for link, volume in volumes.items()}
        self._before = volumes
        loud = frozenset(link for link, speed in speeds.items() if speed > _bound(names.get(link, "")))
        begun, self._loud = loud - self._loud, loud
        return [f"loud: {names.get(link, link)} sends {speeds[link] / 1e6:.1f} MB a second" for link in sorted(begun)]

    def _came(self, link: str, volume: Volume) -> int:
        before = self._before.get(link, Volume(0))
        return volume.brought - before.brought - EXCUSED * (volume.taken - before.taken)


def _bound(name: str) -> int:
    return LOUD.get(name.split("/")[1], LOUD_ROBOT) if name else LOUD_ROBOT


class Unread:
    """Tells which links are full and are not read any more. Pure: time is an argument."""

    def __init__(self) -> None:
        self._since: dict[str, tuple[int, Seconds]] = {}
        """For each full link, what it had carried away when that last grew, and when."""

    def look(self, volumes: Mapping[str, Volume], now: Seconds) -> list[str]:
        """Take the volumes of all links; returns those to end."""
        before, self._since = self._since, {}
        for link, volume in volumes.items():
            if volume.waiting >= FULL:
                taken, since = before.get(link, (volume.taken, now))
                self._since[link] = (volume.taken, since if taken == volume.taken else now)
        return [link for link, (_, since) in self._since.items() if now >= since + UNREAD]


def place(endpoint: str) -> str:
    """Host and port of an endpoint."""
    return endpoint.partition("/")[2]


def volumes() -> dict[str, Volume]:
    """Volume of each TCP link of this process, by its other end. Nothing where no kernel tells."""
    found = {}
    for _, where, link in sockets():
        with suppress(OSError, AttributeError, struct.error):
            told = link.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _COUNTS + 28)
            taken, brought, waiting = struct.unpack_from("QQ8xI", told, _COUNTS)
            found[where] = Volume(brought, taken, waiting)
    return found


def end(is_meant: Callable[[str, str], bool], how: int = socket.SHUT_RDWR) -> list[tuple[str, str]]:
    """End links: Zenoh cannot, so their sockets are shut down, which it takes for the other side's doing.

    is_meant: called with the places of a link's own and other end. how: which direction. Returns the places of those
    that were ended.
    """
    ended = []
    for own, where, each in sockets():
        if is_meant(own, where):
            with suppress(OSError), each.dup() as held:  # so its number is not another link's before we are done
                if _place(held.getpeername()) != where:
                    continue
                held.shutdown(how)
                ended.append((own, where))
                while held.recv(65_536, socket.MSG_DONTWAIT):
                    pass  # a kernel hands out what has come before, and Zenoh would take it
    return ended


def sockets() -> Iterator[tuple[str, str, socket.socket]]:
    """The sockets of this process with another end on the net: places of both, own first. Zenoh's stay Zenoh's."""
    try:
        numbers = [int(each) for each in os.listdir("/proc/self/fd")]
    except OSError:
        return
    for number in numbers:
        try:
            link = socket.socket(fileno=number)
        except OSError:
            continue
        try:
            if link.family in (socket.AF_INET, socket.AF_INET6):
                yield _place(link.getsockname()), _place(link.getpeername()), link
        except OSError:  # it has no other end
            continue
        finally:
            link.detach()


def _place(address: Any) -> str:
    """Spell an address as Zenoh does: one of a local link has the number of its network card."""
    host, port, *more = address
    scope = f"%{more[1]}" if more and more[1] else ""
    return f"[{host}{scope}]:{port}" if ":" in host else f"{host}:{port}"


SETTLE: Seconds = 1.0
"""Time without a router after which that is told: a link that breaks is called again within half a second."""


class RouterNews:
    """Lines about the routers of this process: that there is none, and that there is one again. Pure.

    A link that breaks, to whichever router, is no news if there is one within `SETTLE`: nothing is lost then.
    """

    def __init__(self) -> None:
        self._here: dict[str, str] = {}
        """Endpoints of the routers with a link, by Zenoh's id of their process."""
        self._last = ""
        """Endpoint of the last one; empty: there was none so far."""
        self._is_told_gone = False
        self._gone_at: Seconds = 0.0
        self._back_at: Seconds = -inf
        self.deadline: Seconds | None = None
        """Time at which `due` has something to tell, should no router come before."""

    def came(self, zid: str, endpoint: str, now: Seconds) -> str | None:
        """Take a link that is there now; returns the line to tell."""
        if self._last and not self._here:
            self._back_at = now
        self._here[zid] = self._last = endpoint
        self.deadline = None
        was_told, self._is_told_gone = self._is_told_gone, False
        return f"a router is there again, at {endpoint}, after {now - self._gone_at:.1f} s" if was_told else None

    def unlinked_at(self, now: Seconds) -> Seconds:
        """Time at which there was no router last; -inf: there has always been one, or there never was."""
        return self._back_at if self._here or not self._last else now

    def went(self, zid: str, now: Seconds) -> None:
        """Take a link that is no more."""
        if self._here.pop(zid, None) is not None and not self._here:
            self._gone_at, self.deadline = now, now + SETTLE

    def due(self, now: Seconds, direct: int) -> str | None:
        """Tell at the deadline that there is no router. direct: number of processes that are linked without one."""
        if self.deadline is None or now < self.deadline:
            return None
        self.deadline, self._is_told_gone = None, True
        left = "no other process is heard, nor hears this one"
        if direct:
            left = f"of other processes only the {direct} with a direct link are heard"
        return f"the router at {self._last} is gone: {left}. This process goes on, and keeps calling it"


class Links:
    """Listener to Zenoh's links, who tells the news, and ends those that Zenoh has forgotten.

    Nothing is told of processes that are linked directly.
    """

    def __init__(
        self, session: zenoh.Session, bridge: LoopBridge, called: Sequence[str], tell: Callable[[str], None]
    ) -> None:
        """called: endpoints that this process calls, as the user has written them."""
        self._session = session
        self._called = called
        self._tell = tell
        self._news = RouterNews()
        self._direct: set[str] = set()
        self._loop = asyncio.get_running_loop()
        self._timer: asyncio.TimerHandle | None = None
        info: Any = session.info
        self._forgotten = Forgotten(session, tell)
        self._listeners: tuple[Any, ...] = (
            info.declare_transport_events_listener(bridge.on_loop(self._changed), history=True),
            info.declare_link_events_listener(bridge.on_loop(self._forgotten.changed), history=True),
        )

    @property
    def unlinked_at(self) -> Seconds:
        """See `Bus.unlinked_at`."""
        return self._news.unlinked_at(self._loop.time())

    def close(self) -> None:
        for listener in self._listeners:
            listener.undeclare()
        self._forgotten.close()
        if self._timer is not None:
            self._timer.cancel()

    def _changed(self, event: zenoh.TransportEvent) -> None:
        zid, there = str(event.transport.zid), event.kind == zenoh.SampleKind.PUT
        if event.transport.whatami != zenoh.WhatAmI.ROUTER:
            (self._direct.add if there else self._direct.discard)(zid)
            return
        now = self._loop.time()
        if there:
            self._say(self._news.came(zid, self._endpoint(zid), now))
        else:
            self._news.went(zid, now)
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._news.deadline is not None:
            self._timer = self._loop.call_at(self._news.deadline, self._due)

    def _due(self) -> None:
        self._timer = None
        self._say(self._news.due(self._loop.time(), len(self._direct)))

    def _say(self, line: str | None) -> None:
        if line is not None:
            self._tell(line)

    def _endpoint(self, zid: str) -> str:
        if len(self._called) == 1:
            return self._called[0]
        info: Any = self._session.info
        return next((str(link.dst) for link in info.links() if str(link.zid) == zid), "another machine")


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

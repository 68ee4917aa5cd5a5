"""Bytes that each link brings to a router and carries away, from the kernel: who is loud, and who reads nothing.

Zenoh drops a message that is too large before it is whole, and says nothing of it; nor does it count. The router does
not close the link of one who is loud (docs/decisions/0111-a-flood-is-told-and-not-cut.md).

It ends the link of one who reads nothing. Zenoh would, but waits for the other side with its goodbye, and as long
each further message for that link halts whoever sends it (docs/decisions/0135-a-link-that-is-not-read-is-ended.md).
"""

import os
import socket
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import Any, NamedTuple

from engage_hri.schemas.access import LOUD, LOUD_ROBOT
from engage_hri.schemas.units import Seconds

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

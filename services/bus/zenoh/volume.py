"""Bytes that each link brings to a router, from the kernel, and who is loud.

Zenoh drops a message that is too large before it is whole, and says nothing of it; nor does it count. The router does
not close the link of one who is loud (docs/decisions/0111-a-flood-is-told-and-not-cut.md).
"""

import asyncio
import os
import socket
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import NamedTuple

from engage_hri.schemas.limits import LOUD, LOUD_ROBOT
from engage_hri.schemas.units import Seconds

LOOK: Seconds = 1.0
"""Time between two looks at the links."""
EXCUSED = 4
"""Bytes that a holder may send besides for each that it gets: who is asked much has to answer."""
_COUNTS = 120
"""Place of `tcpi_bytes_acked` and `tcpi_bytes_received` in the kernel's `struct tcp_info`."""


class Volume(NamedTuple):
    """Bytes that a link has brought since it opened, and that it has carried away."""

    brought: int
    taken: int = 0


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
        span, self._at = max(now - self._at, LOOK), now
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


class Listening:
    """Looks at the links of this process, and tells who is loud, until it is closed."""

    def __init__(self, names: Mapping[str, str], tell: Callable[[str], None]) -> None:
        """names: common names by the address at the other end of a link."""
        self._names = names
        self._tell = tell
        self._loop = asyncio.get_running_loop()
        self._volumes = Volumes(self._loop.time())
        self._timer = self._loop.call_later(LOOK, self._look)

    def close(self) -> None:
        self._timer.cancel()

    def _look(self) -> None:
        for line in self._volumes.look(volumes(), self._names, self._loop.time()):
            self._tell(line)
        self._timer = self._loop.call_later(LOOK, self._look)


def place(endpoint: str) -> str:
    """Host and port of an endpoint."""
    return endpoint.partition("/")[2]


def volumes() -> dict[str, Volume]:
    """Volume of each TCP link of this process, by its other end. Nothing where no kernel tells."""
    found = {}
    for where, link in sockets():
        with suppress(OSError, AttributeError, struct.error):
            told = link.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _COUNTS + 16)
            taken, brought = struct.unpack_from("QQ", told, _COUNTS)
            found[where] = Volume(brought, taken)
    return found


def sockets() -> Iterator[tuple[str, socket.socket]]:
    """The sockets of this process that have another end, and where that is. Zenoh's stay Zenoh's."""
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
            host, port = link.getpeername()[:2]
            yield f"[{host}]:{port}" if ":" in host else f"{host}:{port}", link
        except (OSError, ValueError):
            continue
        finally:
            link.detach()

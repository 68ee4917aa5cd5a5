"""Who sends a lot: bytes that came in by each link of a router, from the kernel.

Zenoh drops a message that is too large before it is whole, and says nothing of it.
"""

import asyncio
import os
import socket
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, suppress

import zenoh

from engage_hri.schemas.units import Seconds

LOOK: Seconds = 2.0
"""Time between two looks at the links."""
LOUD = 16 * 1024 * 1024
"""Bytes in a second from which on it is told whose they are. A process may hand out that much at once, when it is
asked for its past; nobody of ours goes on with it for two seconds."""
_BYTES_RECEIVED = 128
"""Place of `tcpi_bytes_received` in the kernel's `struct tcp_info`."""


class Volumes:
    """Bytes of each link, looked at now and then. Pure: time is an argument."""

    def __init__(self) -> None:
        self._before: Mapping[str, int] = {}
        self._at: Seconds = 0.0
        self._loud: frozenset[str] = frozenset()

    def look(self, received: Mapping[str, int], names: Mapping[str, str], now: Seconds) -> list[str]:
        """Take how many bytes each link has brought so far; returns a line for each that begins to be loud.

        names: of who is at the other end, by link.
        """
        span, before = now - self._at, self._before
        came = {link: total - before.get(link, 0) for link, total in received.items()}
        loud = frozenset(link for link, size in came.items() if size > LOUD * span)
        new, self._loud, self._before, self._at = loud - self._loud, loud, received, now
        return [f"loud: {names.get(link, link)} has sent {came[link] / 1e6:.0f} MB in {span:.1f} s" for link in new]


class Listening:
    """Looks at the links of a session, and tells who is loud, until it is closed."""

    def __init__(self, session: zenoh.Session, tell: Callable[[str], None]) -> None:
        self._session = session
        self._tell = tell
        self._loop = asyncio.get_running_loop()
        self._volumes = Volumes()
        self._look()

    def close(self) -> None:
        self._timer.cancel()

    def _look(self) -> None:
        received = dict(_received())
        names = {_place(str(link.dst)): link.auth_identifier or str(link.dst) for link in self._session.info.links()}
        for line in self._volumes.look(received, names, self._loop.time()):
            self._tell(line)
        self._timer = self._loop.call_later(LOOK, self._look)


def _place(endpoint: str) -> str:
    return endpoint.partition("/")[2]


def _received() -> Iterator[tuple[str, int]]:
    """Other end and bytes received of each TCP socket of this process. Nothing where the kernel does not tell."""
    with suppress(OSError):
        for number in map(int, os.listdir("/proc/self/fd")):
            with suppress(OSError, ValueError, struct.error):
                if os.readlink(f"/proc/self/fd/{number}").startswith("socket:"):
                    with closing(socket.socket(fileno=os.dup(number))) as link:
                        host, port = link.getpeername()[:2]
                        told = link.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _BYTES_RECEIVED + 8)
                        where = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
                        yield where, struct.unpack_from("Q", told, _BYTES_RECEIVED)[0]

"""How much each holder sends to a router, and what becomes of one who sends too much.

Zenoh bounds the size of a message (`sizes.py`), and drops one that is too large without a word. It does not bound how
many come in. So the router looks at what the kernel counts of each link. It tells who is loud, and closes the links
of a holder whose role has a bound (`MOST_A_SECOND`) and has used it up.
"""

import asyncio
import os
import socket
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from typing import NamedTuple

from engage_hri.schemas.limits import MOST_A_SECOND
from engage_hri.schemas.units import Seconds

LOOK: Seconds = 0.5
"""Time between two looks at the links."""
SAVED: Seconds = 4.0
"""Time for which a holder that has sent nothing may send at once what it did not."""
TO_JOIN = 64 * 1024
"""Bytes that a new link may have brought besides: a handshake, and what a process declares."""
LOUD = 16 * 1024 * 1024
"""Bytes in a second from which on it is told of anybody. A process may hand out that much when it is asked for its
past; nobody of ours does so again and again."""
EXCUSED = 4
"""Bytes that a holder may send besides for each that it gets: who is asked much has to answer."""
_COUNTS = 120
"""Place of `tcpi_bytes_acked` and `tcpi_bytes_received` in the kernel's `struct tcp_info`."""


class Volume(NamedTuple):
    """Bytes that a link has brought since it opened, and that it has carried away."""

    brought: int
    taken: int = 0


class Verdict(NamedTuple):
    """What follows from a look: lines to tell, and the links to close."""

    told: list[str]
    closed: list[str]


class Volumes:
    """What each holder may still send. Pure: time is an argument.

    What the links of a holder bring counts together, and so does what they may bring. A holder that has sent too much
    loses the links that did it, and each new one, until the time is over in which it might have sent as much.
    """

    def __init__(self, now: Seconds) -> None:
        self._at = now
        self._before: Mapping[str, Volume] = {}
        self._left: dict[str, float] = {}
        """Bytes that a holder may still send; of one who is not here, as many as it can save."""
        self._loud: set[str] = set()

    def look(self, volumes: Mapping[str, Volume], names: Mapping[str, str], now: Seconds) -> Verdict:
        """Take the volumes of all links. names: common names at the other ends, by link."""
        span, self._at = now - self._at, now
        new = volumes.keys() - self._before.keys()
        came = {}
        for link, (brought, taken) in volumes.items():
            before = self._before.get(link, Volume(TO_JOIN))
            came[link] = max(0, brought - before.brought - EXCUSED * (taken - before.taken))
        self._before = volumes
        links: dict[str, list[str]] = {name: [] for name in self._left}
        verdict = Verdict([], [])
        for link, size in came.items():
            name = names.get(link, "")
            links.setdefault(name, []).append(link)
            self._tell_loud(verdict, link, name or link, size / max(span, LOOK))
        for name, its in links.items():
            rate = MOST_A_SECOND.get(name.split("/")[1]) if name else None
            if rate is None:
                continue
            most = rate * max(len(its), 1)
            had = self._left.get(name, most * SAVED)
            left = self._left[name] = min(had + most * span, most * SAVED) - sum(came[link] for link in its)
            if left == most * SAVED and not its:
                del self._left[name]
            if left < 0:
                verdict.closed.extend(link for link in its if link in new or came[link] > rate * span / 8)
                if had >= 0:
                    verdict.told.append(_too_much(name, rate, LOOK - left / most))
        return verdict

    def _tell_loud(self, verdict: Verdict, link: str, name: str, speed: float) -> None:
        """Tell of a link that begins to be loud. speed: bytes a second."""
        if speed > LOUD and link not in self._loud:
            verdict.told.append(f"loud: {name} sends {speed / 1e6:.0f} MB a second")
        (self._loud.add if speed > LOUD else self._loud.discard)(link)


def _too_much(name: str, rate: int, span: Seconds) -> str:
    return f"too much: {name} has sent more than {rate // 1024} kB a second; its links are closed for {span:.1f} s"


class Listening:
    """Looks at the links of this process, and acts on what it sees, until it is closed."""

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
        told, closed = self._volumes.look(volumes(), self._names, self._loop.time())
        for line in told:
            self._tell(line)
        if closed:
            for where, link in _links():
                if where in closed:
                    with suppress(OSError):
                        link.shutdown(socket.SHUT_RDWR)
        self._timer = self._loop.call_later(LOOK, self._look)


def volumes() -> dict[str, Volume]:
    """Volume of each TCP link of this process, by its other end. Nothing where no kernel tells."""
    found = {}
    for where, link in _links():
        with suppress(OSError, AttributeError, struct.error):
            told = link.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, _COUNTS + 16)
            taken, brought = struct.unpack_from("QQ", told, _COUNTS)
            found[where] = Volume(brought, taken)
    return found


def _links() -> Iterator[tuple[str, socket.socket]]:
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

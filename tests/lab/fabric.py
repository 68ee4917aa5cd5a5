"""What a network does to frames between machines: how late each comes, or that it never does. Pure; time is given.

Frames of one path keep their order, as on a wire: jitter makes them late, it does not let one pass another.
"""

import heapq
from collections.abc import Iterator
from itertools import count
from random import Random

from msgspec import Struct

Seconds = float
BROADCAST = b"\xff" * 6
PREFIX = b"\x02\x00\x00\x00\x00"
"""First bytes of the address of each machine's network card; the last is the machine's number."""


def address_of(machine: int) -> bytes:
    """The address of a machine's network card."""
    return PREFIX + bytes([machine])


class Path(Struct):
    """How frames go from one machine to another. loss: the share that is lost. delay: one way."""

    delay: Seconds = 0.0
    jitter: Seconds = 0.0
    loss: float = 0.0
    is_cut: bool = False


class Counts(Struct):
    """Frames of one path."""

    passed: int = 0
    lost: int = 0
    cut: int = 0


class Fabric:
    """Paths between machines, and the frames that are under way. Machines are numbers."""

    def __init__(self, seed: int) -> None:
        self.machines: set[int] = set()
        self.counts: dict[tuple[int, int], Counts] = {}
        self._paths: dict[tuple[int, int], Path] = {}
        self._random = Random(seed)
        self._under_way: list[tuple[Seconds, int, tuple[int, int], bytes]] = []
        self._numbers = count()
        self._last: dict[tuple[int, int], Seconds] = {}

    def path(self, since: int, to: int) -> Path:
        """The path between two machines in one direction, which may be changed."""
        return self._paths.setdefault((since, to), Path())

    def take(self, since: int, frame: bytes, now: Seconds) -> None:
        """Take a frame that a machine has sent."""
        to, mark = frame[:6], frame[5]
        is_for_many = to[0] & 1
        meant = self.machines - {since} if is_for_many else self.machines & {mark}
        for each in sorted(meant) if is_for_many or to[:5] == PREFIX else ():
            self._send((since, each), frame, now)

    def _send(self, ends: tuple[int, int], frame: bytes, now: Seconds) -> None:
        path, counts = self.path(*ends), self.counts.setdefault(ends, Counts())
        if path.is_cut:
            counts.cut += 1
        elif path.loss and self._random.random() < path.loss:
            counts.lost += 1
        else:
            counts.passed += 1
            late = path.delay + path.jitter * self._random.uniform(-1.0, 1.0)
            at = self._last[ends] = max(self._last.get(ends, now), now + max(0.0, late))
            heapq.heappush(self._under_way, (at, next(self._numbers), ends, frame))

    def due(self, now: Seconds) -> Iterator[tuple[int, bytes]]:
        """Frames that have come to their machines by now. What is under way on a path that is cut is gone."""
        while self._under_way and self._under_way[0][0] <= now:
            _, _, ends, frame = heapq.heappop(self._under_way)
            if self.path(*ends).is_cut:
                self.counts[ends].cut += 1
            else:
                yield ends[1], frame

    @property
    def next(self) -> Seconds | None:
        """Time at which the next frame comes; None: nothing is under way."""
        return self._under_way[0][0] if self._under_way else None

"""Memory of requests that have ended, so that none of them is performed again. Pure."""

from collections import defaultdict

from engage_hri.schemas.units import Seconds
from engage_hri.services.requests.records import Record
from engage_hri.services.runtime.absent import Absent

MOST = 8 * 1024 * 1024
"""Bytes of the requests that are remembered, of all senders together."""
EACH = 1024
"""Bytes that a request takes beside its text and that of its answer: names, and its place in tables. Measured."""


class EndedRequests:
    """Requests that have ended, by sender, until nobody has spoken of them for `FORGOTTEN_AFTER`.

    Who sends many makes room for them himself: it forgets nobody else's. bytes: what all of them take.
    """

    def __init__(self, most: int = MOST) -> None:
        """most: bytes that they may have together. The last of all is remembered whatever its size."""
        self._most = most
        self._of = defaultdict[str, dict[str, Record]](dict)
        """By sender and name; of each the oldest first."""
        self._bytes: dict[str, int] = {}
        self.bytes = 0
        self._quiet: Absent[Record] = Absent()

    def __len__(self) -> int:
        return len(self._quiet)

    def add(self, record: Record, now: Seconds) -> list[Record]:
        """Remember a request that has ended, as `Record.pack` leaves it.

        Returns those that are forgotten for want of room.
        """
        sender, size = record.sender, EACH + record.pack()
        self._of[sender][record.name] = record
        self._bytes[sender] = self._bytes.get(sender, 0) + size
        self.bytes += size
        self._quiet.leaves(record, now)
        forgotten = []
        while self.bytes > self._most:
            loudest = max(self._bytes, key=self._bytes.__getitem__)
            oldest = next(iter(self._of[loudest].values()))
            if oldest is record:
                break
            self.discard(oldest)
            forgotten.append(oldest)
        return forgotten

    def named(self, record: Record, now: Seconds) -> None:
        """Note that somebody still speaks of a request: it is remembered from now."""
        if record in self._quiet:
            self._quiet.leaves(record, now)

    def forgotten(self, now: Seconds) -> list[Record]:
        """Forget those of which nobody has spoken for long; returns them."""
        old = self._quiet.forgotten(now)
        for record in old:
            self._drop(record)
        return old

    def discard(self, record: Record) -> None:
        """Forget a request, if it is here."""
        if record in self._quiet:
            self._quiet.comes(record)
            self._drop(record)

    def _drop(self, record: Record) -> None:
        sender, size = record.sender, EACH + record.size
        del self._of[sender][record.name]
        self._bytes[sender] -= size
        self.bytes -= size
        if not self._of[sender]:
            del self._of[sender], self._bytes[sender]

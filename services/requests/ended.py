"""Memory of requests that have ended, so that none of them is performed again. Pure."""

from collections import OrderedDict

from engage_hri.schemas.messages import encode
from engage_hri.services.requests.records import Record

MOST = 8 * 1024 * 1024
"""Bytes of the requests that are remembered, of all senders together."""
EACH = 1024
"""Bytes that a request takes at least."""


class Ended:
    """Requests that have ended, by sender. Who sends many makes room for them himself: it forgets nobody else's."""

    def __init__(self, most: int = MOST) -> None:
        """most: bytes that they may have together. The last of all is remembered whatever its size."""
        self._most = most
        self._of: dict[str, OrderedDict[str, tuple[Record, int]]] = {}
        self._bytes: dict[str, int] = {}
        self._all = 0
        self._number = 0

    def __len__(self) -> int:
        return self._number

    def add(self, record: Record) -> list[Record]:
        """Remember a request that has ended; returns those that are to be forgotten for it."""
        sender, size = record.sender, EACH + len(encode(record.request))  # type: ignore[arg-type]
        self._of.setdefault(sender, OrderedDict())[record.name] = (record, size)
        self._bytes[sender] = self._bytes.get(sender, 0) + size
        self._all += size
        self._number += 1
        forgotten = []
        while self._all > self._most:
            loudest = max(self._bytes, key=self._bytes.__getitem__)
            oldest, _ = next(iter(self._of[loudest].values()))
            if oldest is record:
                break
            self.discard(oldest)
            forgotten.append(oldest)
        return forgotten

    def discard(self, record: Record) -> None:
        """Forget a request, if it is here."""
        sender = record.sender
        known = self._of[sender].pop(record.name, None) if sender in self._of else None
        if known is None:
            return
        self._bytes[sender] -= known[1]
        self._all -= known[1]
        self._number -= 1
        if not self._of[sender]:
            del self._of[sender], self._bytes[sender]

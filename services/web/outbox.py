"""Messages that wait for a program: as JSON, the newest of them if it is slow. Pure."""

from collections import deque
from collections.abc import Collection

import msgspec
from msgspec import Struct

from engage_hri.schemas.messages import Message

MESSAGES_KEPT = 1000
"""Number of messages that wait; the oldest are dropped for those that come after."""


class Outbox:
    """Messages for one program. only: their types, such as `connection_event`; empty: all."""

    def __init__(self, only: Collection[str] = ()) -> None:
        self._only = frozenset(only)
        self._waiting: deque[str] = deque()
        self._dropped = 0

    def put(self, message: Struct) -> bool:
        """Take a message. Returns True if it now waits for the program."""
        if self._only and message.__struct_config__.tag not in self._only:
            return False
        if len(self._waiting) == MESSAGES_KEPT:
            self._waiting.popleft()
            self._dropped += 1
        self._waiting.append(msgspec.json.encode(message).decode())
        return True

    def take(self) -> list[str]:
        """Give out what waits, in order. If some were dropped, their number comes first."""
        taken, self._waiting = [*self._waiting], deque()
        dropped, self._dropped = self._dropped, 0
        return [msgspec.json.encode({"type": "dropped", "count": dropped}).decode(), *taken] if dropped else taken


def message_types() -> frozenset[str]:
    """All types that a message may have."""
    return frozenset(kind.__struct_config__.tag for kind in Message.__args__)

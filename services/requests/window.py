"""Limit of the requests that a server has before it, without an answer to any of them. Pure.

Who asks for ten thousand things at once would else fill the links and the queue of the server, which are the others'
too, and would send again what only has not come yet.
"""


class SendWindow:
    """Requests to one server that are on their way without an answer; those that wait for that, in their order."""

    def __init__(self, size: int) -> None:
        """size: number of requests that may be on their way."""
        self._size = size
        self._on_their_way: set[str] = set()
        self._waiting: dict[str, None] = {}

    def has_waiting(self, id: str) -> bool:
        """True for a request that has not been sent, and waits for others."""
        return id in self._waiting

    def enter(self, id: str) -> bool:
        """Tell whether a request may be sent, also again; it waits if not."""
        if id not in self._on_their_way and len(self._on_their_way) >= self._size:
            self._waiting[id] = None
            return False
        self._waiting.pop(id, None)
        self._on_their_way.add(id)
        return True

    def leave(self, id: str) -> str | None:
        """Take the news that a request has been answered, or is given up; returns the one that may be sent now."""
        self._waiting.pop(id, None)
        if id not in self._on_their_way:
            return None
        self._on_their_way.discard(id)
        return next(iter(self._waiting), None)

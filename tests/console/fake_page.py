"""A page at the other end of a link of a window, in virtual time."""

import asyncio
import json
import struct
from typing import Any

from engage_hri.services.console.web import links

FRAME = bytes(range(64))


class FakePage:
    """A page at the other end of a link. got: what it was sent. closed: code and reason with which the link ended."""

    def __init__(self, query: str = "") -> None:
        self.got: list[Any] = []
        self.closed: tuple[int, str] | None = None
        self._says: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        self.say({"type": "websocket.connect"})
        scope = {"type": "websocket", "path": "/", "query_string": query.encode(), "headers": []}
        self.link = links.WebSocket(scope, self._says.get, self._take)

    async def _take(self, message: Any) -> None:
        if message["type"] == "websocket.close":
            self.closed = message["code"], message["reason"]
        elif message["type"] == "websocket.send":
            self.got.append(message.get("bytes") or json.loads(message["text"]))

    def say(self, message: dict[str, Any]) -> None:
        self._says.put_nowait(message)

    def text(self, text: str) -> None:
        self.say({"type": "websocket.receive", "text": text})

    def sound(self, at: float, samples: bytes = FRAME, number: int = 0) -> None:
        self.say({"type": "websocket.receive", "bytes": struct.pack("<dI", at, number) + samples})

    def go(self) -> None:
        self.say({"type": "websocket.disconnect", "code": 1001})


class Seated:
    """One who sits at a page."""

    def __init__(self, person: str) -> None:
        self.person = person

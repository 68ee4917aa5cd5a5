"""Links of pages besides that of their frames, each a WebSocket that is open while something is on: the robot's
voice, a microphone, a camera.

What goes over them has its instant by the window's clock. A page asks what that shows, again and again, by
`{"asked": 12.5}`, and is answered `{"asked": 12.5, "now": 93.1}`, in seconds.
"""

from collections.abc import Callable, Coroutine
from typing import Any

import msgspec
from msgspec import Struct
from starlette.websockets import WebSocket, WebSocketDisconnect

from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.console.web.visitor import Visitor

MOST_LINKS = 100
"""Links of one kind at once."""
NOT_YOURS = 4403
"""Code with which a link is closed to which a page has no right, or no more."""
TOO_MUCH = 4408
"""Code with which a link is closed whose page sends more than there is time for."""
NONSENSE = 1003
"""Code of RFC 6455 with which a link is closed that sends what does not belong there."""
ROOM = 4429
"""Code with which a link is closed for which there is no room."""


class AskedTime(Struct, frozen=True):
    """Question of a page for the time. asked: by its own clock, seconds."""

    asked: float


class ToldTime(Struct, frozen=True, omit_defaults=True):
    """Answer to `AskedTime`. now: by the window's clock, seconds. unheard: why nobody takes what this page sends."""

    asked: float
    now: Seconds
    unheard: str = ""


_asked = msgspec.json.Decoder(AskedTime)


class PageLinks:
    """Links of all pages of one kind. bus: the window's. visitor: finds the one at a page by its session."""

    def __init__(self, bus: Bus, visitor: Callable[[str], Visitor | None]) -> None:
        self._bus, self._visitor = bus, visitor
        self._links = 0
        self._newest: dict[str, WebSocket] = {}
        """The newest link of each person. A link that was cut on its way is seen to be dead only after a while: what
        it tells then, and its end, is no news of the one that the page has made meanwhile."""

    async def _linked(self, page: WebSocket, serve: Callable[[WebSocket], Coroutine[Any, Any, None]]) -> None:
        """Serve a page, until it goes, if there is room."""
        await page.accept()  # who is refused before learns no reason
        if self._links >= MOST_LINKS:
            await page.close(ROOM, f"{MOST_LINKS} pages have that already")
            return
        self._links += 1
        try:
            await serve(page)
        except WebSocketDisconnect:
            pass
        except InputRefused as error:
            await page.close(NOT_YOURS, str(error)[:120])
        finally:
            self._links -= 1
            self._newest = {person: link for person, link in self._newest.items() if link is not page}

    async def _seated(self, page: WebSocket, device: str) -> Visitor | None:
        """Find the one who sits at a page; else close the link. device: what it would be the link of, in words."""
        visitor = self._visitor(page.query_params.get("session", ""))
        if visitor is None or not visitor.person:
            await page.close(NOT_YOURS, f"take a seat first: {device} is that of a person")
            return None
        self._newest[visitor.person] = page
        return visitor

    def _is_newest(self, page: WebSocket, person: str) -> bool:
        """Tell whether a person has made no other link of this kind since this one."""
        return self._newest.get(person) is page

    async def _still_seated(self, page: WebSocket, visitor: Visitor, person: str) -> bool:
        """Tell whether a link is still that of the person at the page; else close it."""
        if visitor.person == person and self._is_newest(page, person):
            return True
        left = visitor.person != person
        await page.close(NOT_YOURS, "you have left your seat" if left else "you have it on elsewhere")
        return False

    async def _received(self, page: WebSocket, unheard: Callable[[], str] = lambda: "") -> bytes:
        """Wait for what a page sends, and tell the time meanwhile, and why nobody takes it.

        Raises WebSocketDisconnect, after nonsense as well.
        """
        while True:
            message = await page.receive()
            if message["type"] == "websocket.disconnect":
                raise WebSocketDisconnect(message["code"])
            if (content := message.get("bytes")) is not None:
                return bytes(content)
            try:
                asked = _asked.decode(message.get("text") or "")
            except (msgspec.DecodeError, RecursionError):
                await page.close(NONSENSE, "this is no question for the time")
                raise WebSocketDisconnect(NONSENSE) from None
            told = ToldTime(asked.asked, self._bus.now(), unheard())
            await page.send_text(msgspec.json.encode(told).decode())

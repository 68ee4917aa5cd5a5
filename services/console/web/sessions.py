"""Sessions of pages: what a window keeps of each page over all links to it.

A link that breaks ends nothing: the page makes another one, and has its seat, what the robot does for it, and the
news of its orders as before. The same holds for a page that is loaded anew. But nobody can tell a page that is loaded
anew from one that is closed before it comes back, and a robot must not talk to an empty seat for long. So a page that
goes has less time to come back than one whose link breaks. The session of a page that says that it is over, or does
not come back in time, ends.
"""

import asyncio
import secrets
from collections.abc import Callable
from typing import Protocol

from engage_hri.schemas.units import Seconds
from engage_hri.services.console.web.frames import Receipts, Viewer
from engage_hri.services.console.web.orders import Given

KEPT: Seconds = 20.0
"""Time that a page has to come back after its link broke."""
RELOADED: Seconds = 8.0
"""Time that a page has to come back after it was closed, or loaded anew. Ours: a slow phone loads it in five."""
OVER = 1000
"""Code with which a link ends whose page is over, by RFC 6455: a kiosk begins anew for the next visitor."""
GOING = 1001
"""Code of RFC 6455 with which a link ends whose browser goes from the page."""
LEAVES = 4001
"""Code with which a page ends its link when it goes: pages themselves cannot say 1001."""


class Guest(Protocol):
    """The one who carries out the orders of a page."""

    def take(self, given: Given) -> None:
        """Carry out an order, or begin to."""

    async def leave(self) -> None:
        """End all that was begun."""

    def frame(self, viewer: Viewer) -> bytes | None:
        """The next frame for this viewer; None: there is none."""


class PageSession:
    """One page. links: number of its links so far; only the last one counts."""

    def __init__(self, receipts: Receipts, guest: Guest, trusted: bool) -> None:
        self.receipts = receipts
        self.guest = guest
        self.trusted = trusted
        self.links = 0
        self.link: asyncio.Task[None] | None = None
        """What listens to the page now; None: it has no link."""
        self.ending: asyncio.Task[None] | None = None
        """What ends the session, unless the page comes back."""

    def take(self, given: Given) -> None:
        """Take an order, and carry it out if it was not taken before."""
        if self.receipts.take(given.number):
            self.guest.take(given)


class Sessions:
    """The sessions of all pages of a window. make: makes the guest of a page. most: number of sessions."""

    def __init__(self, make: Callable[[Receipts, bool], Guest], most: int) -> None:
        self._make = make
        self._most = most
        self._known: dict[str, PageSession] = {}

    async def enter(self, id: str, trusted: bool) -> PageSession | None:
        """The session of a page that opens a link; None: there is no room for it.

        id: of the session that the page says that it had; empty: none. trusted: it has the token of the window.
        """
        session = self._known.get(id)
        if session is not None and session.trusted == trusted:
            for task in filter(None, (session.ending, session.link)):
                task.cancel()
            session.ending = session.link = None
        else:
            if len(self._known) >= self._most and not await self._make_room():
                return None
            receipts = Receipts(secrets.token_urlsafe(12))
            session = self._known[receipts.session] = PageSession(receipts, self._make(receipts, trusted), trusted)
        session.links += 1
        return session

    def guest(self, id: str) -> Guest | None:
        """The guest of a session; None: there is no such session."""
        session = self._known.get(id)
        return session.guest if session is not None else None

    async def part(self, session: PageSession, link: int, code: int) -> None:
        """Take note that a link has ended. link: its number. code: of RFC 6455, with which it did."""
        if session.links != link or session.receipts.session not in self._known:
            return
        session.link = None
        if code == OVER:
            await self._end(session)
            return
        grace = RELOADED if code in (GOING, LEAVES) else KEPT
        session.ending = asyncio.create_task(self._end(session, grace), name="page that may come back")

    async def close(self) -> None:
        """End all sessions."""
        for session in list(self._known.values()):
            await self._end(session)

    async def _make_room(self) -> bool:
        """End the oldest session that has no link. Returns whether there was one."""
        session = next((each for each in self._known.values() if each.ending is not None), None)
        if session is not None:
            await self._end(session)
        return session is not None

    async def _end(self, session: PageSession, after: Seconds = 0.0) -> None:
        if after:
            await asyncio.sleep(after)
        elif session.ending is not None:
            session.ending.cancel()
            await asyncio.wait([session.ending])
        if self._known.pop(session.receipts.session, None) is not None:
            await session.guest.leave()

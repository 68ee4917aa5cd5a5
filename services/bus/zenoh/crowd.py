"""Bounds of what one holder may take of a router: who has too many links, tokens or processes is cut. Pure.

Zenoh bounds neither for one holder: a thousand links leave no place for others, and with the number of tokens of one
link the time grows that each further one costs (measured: 5000 tokens 0.5 s of processor, 20,000 tokens 20 s). A
token can name a process that is none, and whoever reads what that is said to publish asks it in vain again and again.
"""

from collections.abc import Iterable
from typing import NamedTuple

from engage_hri.schemas.access import Holder
from engage_hri.schemas.limits import LOUD
from engage_hri.schemas.units import Seconds

MOST_LINKS = 100
"""Links of one certificate, and processes that its tokens name."""
MOST_TOKENS = 1000
"""Tokens of one certificate; without keys, of one process. A process of ours has some three, and a robot a dozen."""
MOST_UNREAD = 3
"""Links of one certificate that may be ended within `BANNED` because nobody reads them. Each halts others for half a
second."""
BANNED: Seconds = 30.0
"""Time in which who had too many gets no new link."""


class Link(NamedTuple):
    """A link of the router. zid: of the process at its other end. name: that in its certificate, if it has one.

    address: of its other end, as Zenoh writes it.
    """

    zid: str
    name: str
    address: str


class Crowd:
    """Counts of links and tokens by holder; without keys of tokens alone, by process, for it has one link."""

    def __init__(self, holders: Iterable[Holder] = ()) -> None:
        self._marks = {holder.mark: holder.common_name for holder in holders}
        self._links: dict[str, set[Link]] = {}
        self._tokens: dict[str, dict[str, set[str]]] = {}
        """Tokens of each holder, by process."""
        self._unread: dict[str, dict[Link, Seconds]] = {}
        """When links of each were ended because nobody read them."""
        self._banned: dict[str, Seconds] = {}
        """Time until which each gets no link."""

    def is_banned(self, link: Link, now: Seconds) -> bool:
        """Tell whether who has this link gets none for now. Any thread may ask."""
        return self._banned.get(_owner(link), now) > now

    def came(self, link: Link, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        """Take a new link; returns the line to tell, and the links to end."""
        who = _owner(link)
        own = self._links.setdefault(who, set())
        own.add(link)
        if self.is_banned(link, now):
            return "", (link,)
        return self._too_many(who, "links", MOST_LINKS, now) if link.name and len(own) > MOST_LINKS else ("", ())

    def went(self, link: Link) -> None:
        """Take the end of a link."""
        who = _owner(link)
        if (own := self._links.get(who)) is not None:
            own.discard(link)
            if not own:
                del self._links[who]

    def unread(self, link: Link, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        """Take a link that is full and not read; returns as `came`.

        A service keeps its link: it is there to be asked much. So do all without keys, for they may be services.
        """
        who = _owner(link)
        if not link.name or link.name.split("/")[1] not in LOUD:
            return "", ()
        own = {one: at for one, at in self._unread.get(who, {}).items() if at > now - BANNED}
        self._unread[who] = own
        if link in own:  # it takes a while to end
            return "", (link,)
        own[link] = now
        if len(own) > MOST_UNREAD:
            line, links = self._too_many(who, "links that are not read", MOST_UNREAD, now)
            return line, (*links, link)
        return f"not read: {link.name} reads nothing; its link ends", (link,)

    def shown(self, run: str, token: str, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        """Take a new token of the process with this id; returns as `came`."""
        who = self._holder(run)
        runs = self._tokens.setdefault(who, {})
        runs.setdefault(run, set()).add(token)
        if len(runs) > MOST_LINKS:
            return self._too_many(who, "processes", MOST_LINKS, now)
        return (
            self._too_many(who, "tokens", MOST_TOKENS, now)
            if sum(map(len, runs.values())) > MOST_TOKENS
            else ("", ())
        )

    def withdrawn(self, run: str, token: str) -> None:
        """Take the end of a token."""
        who = self._holder(run)
        if (own := self._tokens.get(who, {}).get(run)) is not None:
            own.discard(token)
            if not own:
                del self._tokens[who][run]
            if not self._tokens[who]:
                del self._tokens[who]

    def _holder(self, run: str) -> str:
        return next((name for mark, name in self._marks.items() if run.startswith(mark)), run)

    def _too_many(self, who: str, what: str, most: int, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        if self._banned.get(who, now) > now:
            return "", ()
        self._banned = {each: until for each, until in self._banned.items() if until > now} | {who: now + BANNED}
        links = tuple(self._links.get(who, ()))
        name = next((link.name for link in links), "") or f"process {who}"
        told = f"too many: {name} has more than {most} {what}; its links end, and it gets none for {BANNED:g} s"
        return told, links


def _owner(link: Link) -> str:
    return link.name or link.zid

"""Bounds of what one holder may take of a router: who has too many links, tokens or processes is cut. Pure.

Zenoh bounds neither for one holder: a thousand links leave no place for others, and with the number of tokens of one
link the time grows that each further one costs (measured: 5000 tokens 0.5 s of processor, 20,000 tokens 20 s). A
token can name a process that is none, and whoever reads what that is said to publish asks it in vain again and again.

Of a service's certificate the link that came first stays, and it may call again: a stolen key shall not end the
service itself. If too many tokens still stand some seconds later it was not the service, and all its links end.
"""

from collections.abc import Iterable
from typing import NamedTuple

from engage_hri.schemas.access import LOUD, Holder
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
GOING: Seconds = 5.0
"""Time in which the tokens of links that were ended are gone: a thousand took up to two seconds on a busy machine."""


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
        self._links: dict[str, dict[Link, None]] = {}
        """Links of each holder, in the order in which they came."""
        self._tokens: dict[str, dict[str, set[str]]] = {}
        """Tokens of each holder, by process."""
        self._unread: dict[str, dict[Link, Seconds]] = {}
        """When links of each were ended because nobody read them."""
        self._banned: dict[str, Seconds] = {}
        """Time until which each gets no link."""
        self._spared: set[str] = set()
        """Of these the services that keep one link."""

    def is_banned(self, link: Link, now: Seconds) -> bool:
        """Tell whether who has this link gets none for now. Any thread may ask."""
        who = _owner(link)
        others = any(each.zid != link.zid for each in list(self._links.get(who, ())))
        return self._banned.get(who, now) > now and (who not in self._spared or others)

    def came(self, link: Link, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        """Take a new link; returns the line to tell, and the links to end."""
        who = _owner(link)
        own = self._links.setdefault(who, {})
        own[link] = None
        if self.is_banned(link, now):
            return "", (link,)
        return self._too_many(who, "links", MOST_LINKS, now) if link.name and len(own) > MOST_LINKS else ("", ())

    def went(self, link: Link) -> None:
        """Take the end of a link."""
        who = _owner(link)
        if (own := self._links.get(who)) is not None:
            own.pop(link, None)
            if not own:
                del self._links[who]

    def unread(self, link: Link, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        """Take a link that is full and not read; returns as `came`.

        A service keeps its first link: it is there to be asked much. Without keys all keep theirs: each may be one.
        """
        who = _owner(link)
        if not link.name or (_is_service(who) and link == next(iter(self._links.get(who, ())), link)):
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
        self._tokens.setdefault(who, {}).setdefault(run, set()).add(token)
        what, most = self._excess(who)
        return self._too_many(who, what, most, now) if what else ("", ())

    def still(self, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        """Look again at services of which one link was spared, `GOING` ago at least; returns as `came`."""
        judged = [who for who in sorted(self._spared) if now < self._banned.get(who, now) <= now + BANNED - GOING]
        guilty = [who for who in judged if self._excess(who)[0]]
        self._spared -= {*guilty}
        line = f"too many: {' and '.join(guilty)} still has them; all its links end" if guilty else ""
        return line, tuple(link for who in guilty for link in self._links.get(who, ()))

    def _excess(self, who: str) -> tuple[str, int]:
        """Return what the tokens of a holder are too many of, and the bound; nothing: they are not."""
        runs = self._tokens.get(who, {})
        if len(runs) > MOST_LINKS:
            return "processes", MOST_LINKS
        return ("tokens", MOST_TOKENS) if sum(map(len, runs.values())) > MOST_TOKENS else ("", 0)

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
        if (until := self._banned.get(who, now)) > now:
            return self.still(now) if now >= until - BANNED + GOING else ("", ())
        self._banned = {each: until for each, until in self._banned.items() if until > now} | {who: now + BANNED}
        self._spared -= {who}
        links = tuple(self._links.get(who, ()))
        name = next((link.name for link in links), "") or f"process {who}"
        which = "its links end"
        if _is_service(name):
            self._spared.add(who)
            which, links = "its links end but for the first", links[1:]
        return f"too many: {name} has more than {most} {what}; {which}, and it gets none for {BANNED:g} s", links


def _is_service(name: str) -> bool:
    """Tell whether the holder with this common name is one of the robot's services."""
    return "/" in name and name.split("/")[1] not in LOUD


def _owner(link: Link) -> str:
    return link.name or link.zid

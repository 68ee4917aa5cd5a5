"""A router: a process that belongs to no robot, and passes on what the processes of all machines send one another.

With keys it lets in only whom it knows, and passes on only what the table of access allows. What it cannot forbid,
for it is a question of number, it bounds (`Crowd`) or tells (`links.py`).
"""

import asyncio
import os
import time
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from contextlib import ExitStack, asynccontextmanager, closing
from typing import Any

import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.access import LOUD, Holder
from engage_hri.schemas.text import printable
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import LOG
from engage_hri.services.bus.keyring import Expiry, Keys
from engage_hri.services.bus.zenoh.bridge import LoopBridge
from engage_hri.services.bus.zenoh.denials import LEVELS
from engage_hri.services.bus.zenoh.links import SPAN, Forgotten, Link, Unread, Volumes, end, place, volumes
from engage_hri.services.bus.zenoh.rules import access_control, paced
from engage_hri.services.bus.zenoh.session import ROUTER_STALL_US, STALL, encrypted, open_router

ANSWER: Seconds = 1.0
"""Time that a question of the router itself has. There is nobody who would answer."""
TOGETHER: Seconds = 0.01
"""Time in which links that are to be ended are gathered, for all sockets are looked at. It is short: so long one who
is kept out is heard."""
SHARE = 0.1
"""Most part of the time that goes into ending links, in Zenoh's threads and on the loop each: with 2500 connections
it takes 26 ms, and who is kept out calls again and again."""
SHOWN: Seconds = 1.0
"""Time after which it is shown again that something is served."""
MOST_LINKS = 100
"""Links of one certificate, and processes that its tokens name."""
MOST_TOKENS = 1000
"""Tokens of one certificate; without keys, of one process. A process of ours has some three, and a robot a dozen."""
MOST_UNREAD = 3
"""Links of one certificate that may be ended within `BANNED` because nobody reads them. Each halts others for half a
second."""
BANNED: Seconds = 30.0
"""Time in which who had too many gets no new link."""
LOOK: Seconds = 0.05
"""Least time between two looks at links that may be ended."""
LOOKS = 0.02
"""Most part of the time that looking takes: of a thousand links that is a look each half second."""


class Routing:
    """A router that runs, and can be asked whether it still does."""

    def __init__(self, session: zenoh.Session, bridge: LoopBridge) -> None:
        self._session: Any = session
        self._bridge = bridge
        self._key = keys.own(str(session.zid()), "sign")

    async def works(self) -> None:
        """Return once it has taken in and taken back a declaration, and ended a question, as it does for others.

        Where its tables are held by somebody else's matter this does not return, and may keep the loop from going on.
        """
        self._session.liveliness().declare_token(self._key).undeclare()
        ended = asyncio.Event()
        handler = self._bridge.on_loop(lambda reply: None, lambda _: ended.set())
        self._session.get(self._key, handler, timeout=ANSWER)
        await ended.wait()


@asynccontextmanager
async def routing(
    listen: Sequence[str],
    connect: Sequence[str],
    tell: Callable[[str], None],
    keys_of_router: Keys | None = None,
    served: Callable[[], None] = lambda: None,
) -> AsyncIterator[Routing]:
    """Route while the body of `async with` runs. Gives what tells whether it does.

    listen: endpoints at which others connect. connect: other routers. tell: called with a line for each participant
    that comes or goes; it waits for no reader. served: called, in any thread, at most once
    in `SHOWN` seconds, while tokens are served: in a rush of clients the router's own question waits behind theirs,
    and yet it does not hang. keys_of_router: the router lets in only those that its keys name, and passes on only
    what the table of access allows them. Raises InputRefused when an endpoint is misspelled, RunFailed when one is
    taken.
    """
    with ExitStack() as stack:
        more: dict[str, object] = {}
        holders: Sequence[Holder] = ()
        if keys_of_router is not None:
            holders = keys_of_router.holders()
            more = {**encrypted(keys_of_router), "access_control": access_control(holders)}
            more |= {"downsampling": paced(holders), STALL: ROUTER_STALL_US}
            os.environ["RUST_LOG"] = LEVELS
            zenoh.init_log_from_env_or(LEVELS)
            own = keys_of_router.holder
            stack.enter_context(closing(Expiry(own.common_name, own.until, LOG.warning)))
        session = open_router(connect, listen, more)
        bridge = LoopBridge(lambda error, what: LOG.error("%s: %s", what, error, exc_info=error))
        door = Door(session, bridge, Crowd(holders), tell, served)
        try:
            yield Routing(session, bridge)
        finally:
            bridge.close()
            door.close()
            session.close()  # type: ignore[no-untyped-call]


class Crowd:
    """Counts of links and tokens by holder; without keys of tokens alone, by process, for it has one link. Pure.

    Zenoh bounds neither for one holder: a thousand links leave no place for others, and with the number of tokens of
    one link the time grows that each further one costs (measured: 5000 tokens 0.5 s of processor, 20,000 20 s). A
    token can name a process that is none, and whoever reads what that is said to publish asks it in vain.

    A service is only told of: to cut it would stop the robot, and who has stolen its key can do that in any case.
    """

    def __init__(self, holders: Iterable[Holder] = ()) -> None:
        self._marks = {holder.mark: holder.common_name for holder in holders}
        self._links: dict[str, dict[Link, None]] = {}
        """Links of each holder, in the order in which they came."""
        self._tokens: dict[str, dict[str, set[str]]] = {}
        """Tokens of each holder, by process."""
        self._unread: dict[str, dict[Link, Seconds]] = {}
        """When links of each were ended because nobody read them."""
        self._banned: dict[str, Seconds] = {}
        """Time until which each gets no link; of a service, until which it is not told again."""

    def is_banned(self, link: Link, now: Seconds) -> bool:
        """Tell whether who has this link gets none for now. Any thread may ask."""
        who = _owner(link)
        return self._banned.get(who, now) > now and not _is_service(who)

    def came(self, link: Link, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        """Take a new link; returns the line to tell, and the links to end."""
        own = self._links.setdefault(_owner(link), {})
        own[link] = None
        if self.is_banned(link, now):
            return "", (link,)
        return (
            self._too_many(link.name, "links", MOST_LINKS, now) if link.name and len(own) > MOST_LINKS else ("", ())
        )

    def went(self, link: Link) -> None:
        """Take the end of a link."""
        who = _owner(link)
        if (own := self._links.get(who)) is not None:
            own.pop(link, None)
            if not own:
                del self._links[who]

    def unread(self, link: Link, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        """Take a link that is full and not read; returns as `came`. Without keys all keep theirs.

        For nobody can tell a visitor from a service there, and a service may be late to read what it is asked.
        """
        if not link.name or _is_service(link.name):
            return "", ()
        own = {one: at for one, at in self._unread.get(link.name, {}).items() if at > now - BANNED}
        self._unread[link.name] = own
        if link in own:  # it takes a while to end
            return "", (link,)
        own[link] = now
        if len(own) > MOST_UNREAD:
            line, links = self._too_many(link.name, "links that are not read", MOST_UNREAD, now)
            return line, (*links, link)
        return f"not read: {link.name} reads nothing; its link ends", (link,)

    def shown(self, run: str, token: str, now: Seconds) -> tuple[str, tuple[Link, ...]]:
        """Take a new token of the process with this id; returns as `came`."""
        who = self._holder(run)
        runs = self._tokens.setdefault(who, {})
        runs.setdefault(run, set()).add(token)
        if len(runs) > MOST_LINKS:
            return self._too_many(who, "processes", MOST_LINKS, now)
        if sum(map(len, runs.values())) > MOST_TOKENS:
            return self._too_many(who, "tokens", MOST_TOKENS, now)
        return "", ()

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
        told = f"too many: {who if '/' in who else f'process {who}'} has more than {most} {what}"
        if _is_service(who):
            return f"{told}; a service of the robot keeps its links", ()
        return f"{told}; its links end, and it gets none for {BANNED:g} s", tuple(self._links.get(who, ()))


def _is_service(who: str) -> bool:
    """Tell whether this is the common name of one of the robot's services."""
    return "/" in who and who.split("/")[1] not in LOUD


def _owner(link: Link) -> str:
    return link.name or link.zid


class Door:
    """Tells who comes and goes, and ends the links of those who take too much."""

    def __init__(
        self,
        session: zenoh.Session,
        bridge: LoopBridge,
        crowd: Crowd,
        tell: Callable[[str], None],
        served: Callable[[], None],
    ) -> None:
        """tell, served: see `routing`."""
        self._links: dict[str, Link] = {}
        """Each by the address at its other end."""
        self._crowd = crowd
        self._tell = tell
        self._served = served
        self._served_at = 0.0
        self._loop = asyncio.get_running_loop()
        self._ending: set[Link] = set()
        self._ends_at = self._turns_away_at = 0.0
        self._forgotten = Forgotten(session, tell)
        self._volumes, self._unread = Volumes(self._loop.time()), Unread()
        self._next = self._loop.time() + SPAN
        self._timer = self._loop.call_later(LOOK, self._look)
        info: Any = session.info
        token_changed = bridge.on_loop(self._token_changed, first=self._show)
        link_changed = bridge.on_loop(self._link_changed, first=self._turn_away)
        self._declared: tuple[Any, ...] = (
            info.declare_link_events_listener(link_changed, history=True),
            session.liveliness().declare_subscriber(f"*/{keys.ANY_OWN}", token_changed, history=True),
        )

    def close(self) -> None:
        self._timer.cancel()
        self._forgotten.close()
        for declared in self._declared:
            declared.undeclare()

    def _show(self, _: object) -> None:
        """Show that a token was served, in Zenoh's thread: the loop itself may wait for the router's tables."""
        if (now := time.monotonic()) >= self._served_at + SHOWN:
            self._served_at = now
            self._served()

    def _turn_away(self, event: zenoh.LinkEvent) -> None:
        """End the link of one who gets none, in Zenoh's thread: Zenoh reads nothing of a link before this returns."""
        link = _link(event)
        if event.kind != zenoh.SampleKind.PUT or not self._crowd.is_banned(link, self._loop.time()):
            return
        if time.monotonic() >= self._turns_away_at:  # else the loop ends it, together with others
            pause = self._shut(lambda _, where: where == place(link.address))
            self._turns_away_at = time.monotonic() + pause

    def _token_changed(self, sample: zenoh.Sample) -> None:
        key, is_there = str(sample.key_expr), sample.kind == zenoh.SampleKind.PUT
        robot, _, token = key.partition("/")
        run = keys.run_of(token)
        match token.split("/")[4:]:
            case ["alive", _, name, _]:
                self._tell(printable(f"{robot}: {name} is {'here' if is_there else 'gone'}"))
        if is_there:
            self._keep_out(*self._crowd.shown(run, key, self._loop.time()))
        else:
            self._crowd.withdrawn(run, key)

    def _link_changed(self, event: zenoh.LinkEvent) -> None:
        self._forgotten.changed(event)
        link = _link(event)
        if event.kind == zenoh.SampleKind.PUT:
            self._links[place(link.address)] = link
            self._keep_out(*self._crowd.came(link, self._loop.time()))
        else:
            self._went(link)

    def _went(self, link: Link) -> None:
        """Take the end of a link, of which there may be news more than once."""
        if self._links.get(place(link.address)) == link:
            del self._links[place(link.address)]
        self._crowd.went(link)

    def _look(self) -> None:
        """Look at the links in the kernel: who is loud, which are not read, which Zenoh has closed without a word."""
        began = time.perf_counter()
        found, now = volumes(), self._loop.time()
        if found:  # no kernel but Linux' tells
            for link in [link for where, link in self._links.items() if where not in found]:
                if link.address.startswith(("tcp/", "tls/")):
                    self._went(link)
        for where in self._unread.look(found, now):
            if (unread := self._links.get(where)) is not None and unread not in self._ending:
                self._keep_out(*self._crowd.unread(unread, now))
        if now >= self._next:
            self._next = now + SPAN
            names = {where: link.name for where, link in self._links.items() if link.name}
            for line in self._volumes.look(found, names, now):
                self._tell(line)
        # Without keys no link is ended, and only speeds are looked at.
        pause = LOOK if any(link.name for link in self._links.values()) else SPAN
        self._timer = self._loop.call_later(max(pause, (time.perf_counter() - began) / LOOKS), self._look)

    def _keep_out(self, line: str, links: Iterable[Link]) -> None:
        if line:
            self._tell(printable(line))
        if links and not self._ending:
            self._loop.call_at(max(self._loop.time() + TOGETHER, self._ends_at), self._end)
        self._ending.update(links)

    def _end(self) -> None:
        ending = {place(link.address) for link in self._ending}
        self._ending.clear()
        self._ends_at = self._loop.time() + self._shut(lambda _, where: where in ending)

    def _shut(self, is_meant: Callable[[str, str], bool]) -> Seconds:
        """End links. Returns the time after which this may be done again: all sockets are looked at."""
        began = time.thread_time()  # on a busy machine more time passes, which is no work
        end(is_meant)
        return (time.thread_time() - began) / SHARE


def _link(event: zenoh.LinkEvent) -> Link:
    return Link(str(event.link.zid), event.link.auth_identifier or "", str(event.link.dst))

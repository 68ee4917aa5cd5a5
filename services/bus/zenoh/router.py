"""A router: a process that belongs to no robot, and passes on what the processes of all machines send one another."""

import asyncio
import os
import time
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from contextlib import ExitStack, asynccontextmanager, closing
from typing import Any

import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.access import Holder
from engage_hri.schemas.text import printable
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import LOG
from engage_hri.services.bus.keyring import Keys
from engage_hri.services.bus.zenoh.crowd import GOING, Crowd, Link
from engage_hri.services.bus.zenoh.denials import LEVELS
from engage_hri.services.bus.zenoh.expiry import Expiry
from engage_hri.services.bus.zenoh.links import Forgotten
from engage_hri.services.bus.zenoh.rules import access_control
from engage_hri.services.bus.zenoh.session import ROUTER_STALL_US, STALL, LoopBridge, encrypted, open_router
from engage_hri.services.bus.zenoh.sizes import paced
from engage_hri.services.bus.zenoh.volume import Listening, end, place

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
        listening = Listening(door.links, tell, door.unread, door.went)
        try:
            yield Routing(session, bridge)
        finally:
            listening.close()
            bridge.close()
            door.close()
            session.close()  # type: ignore[no-untyped-call]


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
        self.links: dict[str, Link] = {}
        """Each by the address at its other end."""
        self._crowd = crowd
        self._tell = tell
        self._served = served
        self._served_at = 0.0
        self._loop = asyncio.get_running_loop()
        self._ending: set[Link] = set()
        self._ends_at = self._turns_away_at = 0.0
        self._forgotten = Forgotten(session, tell)
        info: Any = session.info
        token_changed = bridge.on_loop(self._token_changed, first=self._show)
        link_changed = bridge.on_loop(self._link_changed, first=self._turn_away)
        self._declared: tuple[Any, ...] = (
            info.declare_link_events_listener(link_changed, history=True),
            session.liveliness().declare_subscriber(f"*/{keys.ANY_OWN}", token_changed, history=True),
        )

    def close(self) -> None:
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
            self.links[place(link.address)] = link
            self._keep_out(*self._crowd.came(link, self._loop.time()))
        else:
            self.went(link)

    def went(self, link: Link) -> None:
        """Take the end of a link, of which there may be news more than once."""
        if self.links.get(place(link.address)) == link:
            del self.links[place(link.address)]
        self._crowd.went(link)

    def unread(self, link: Link) -> None:
        """End a link that is full and not read, unless that is on its way."""
        if link not in self._ending:
            self._keep_out(*self._crowd.unread(link, self._loop.time()))

    def _keep_out(self, line: str, links: Iterable[Link]) -> None:
        if line:
            self._tell(printable(line))
            self._loop.call_later(GOING + TOGETHER, self._look_again)
        if links and not self._ending:
            self._loop.call_at(max(self._loop.time() + TOGETHER, self._ends_at), self._end)
        self._ending.update(links)

    def _look_again(self) -> None:
        self._keep_out(*self._crowd.still(self._loop.time()))

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

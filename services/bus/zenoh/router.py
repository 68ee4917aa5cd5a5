"""A router: a process that belongs to no robot, and passes on what the processes of all machines send one another."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from contextlib import ExitStack, asynccontextmanager, closing
from typing import Any

import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.units import Seconds
from engage_hri.schemas.utf8 import printable
from engage_hri.services.bus.interface import LOG
from engage_hri.services.bus.keyring import Keys
from engage_hri.services.bus.zenoh.denials import telling_denials
from engage_hri.services.bus.zenoh.expiry import Expiry
from engage_hri.services.bus.zenoh.rules import access_control
from engage_hri.services.bus.zenoh.session import LoopBridge, encrypted, open_router
from engage_hri.services.bus.zenoh.sizes import paced
from engage_hri.services.bus.zenoh.volume import Listening

ANSWER: Seconds = 1.0
"""Time that a question of the router itself has. There is nobody who would answer."""


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
    listen: Sequence[str], connect: Sequence[str], tell: Callable[[str], None], keys_of_router: Keys | None = None
) -> AsyncIterator[Routing]:
    """Route while the body of `async with` runs. Gives what tells whether it does.

    listen: endpoints at which others connect. connect: other routers. tell: called with a line for each participant
    that comes or goes, and for what is refused; it waits for no reader. keys_of_router: the router lets in only those
    that its keys name, and passes on only what the table of access allows them. Raises InputRefused when an endpoint
    is misspelled, RunFailed when one is taken.
    """
    with ExitStack() as stack:
        more: dict[str, object] = {}
        names: Mapping[str, str] = {}
        if keys_of_router is not None:
            holders = keys_of_router.holders()
            more = {**encrypted(keys_of_router), "access_control": access_control(holders)}
            more["downsampling"] = paced(holders)
            names = stack.enter_context(telling_denials(tell)).names
            own = keys_of_router.holder
            stack.enter_context(closing(Expiry(own.common_name, own.until, LOG.warning)))
        async with _passing_on(open_router(connect, listen, more), tell, names) as router:
            yield router


@asynccontextmanager
async def _passing_on(
    session: zenoh.Session, tell: Callable[[str], None], names: Mapping[str, str]
) -> AsyncIterator[Routing]:
    bridge = LoopBridge(lambda error, what: LOG.error("%s: %s", what, error, exc_info=error))

    def changed(sample: zenoh.Sample) -> None:
        robot, _, rest = str(sample.key_expr).partition("/")
        subject = rest.split("/")[4:]
        if len(subject) == 2 and subject[0] == "alive":
            there = "here" if sample.kind == zenoh.SampleKind.PUT else "gone"
            tell(printable(f"{robot}: {subject[1]} is {there}"))

    watching = session.liveliness().declare_subscriber(
        f"*/{keys.ANY_TOKEN}", bridge.on_loop(changed), history=True
    )  # fmt: skip
    listening = Listening(names, tell)
    try:
        yield Routing(session, bridge)
    finally:
        listening.close()
        bridge.close()
        watching.undeclare()  # type: ignore[no-untyped-call]
        session.close()  # type: ignore[no-untyped-call]

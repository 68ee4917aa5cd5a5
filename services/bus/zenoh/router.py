"""A router: a process that belongs to no robot, and passes on what the processes of all machines send one another."""

from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import ExitStack, asynccontextmanager, closing

import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.access import ROUTER
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.bus.config import is_encrypted
from engage_hri.services.bus.interface import LOG
from engage_hri.services.bus.keyring import Keys
from engage_hri.services.bus.zenoh.denials import telling_denials
from engage_hri.services.bus.zenoh.expiry import Expiry
from engage_hri.services.bus.zenoh.rules import access_control
from engage_hri.services.bus.zenoh.session import LoopBridge, encrypted, open_router


@asynccontextmanager
async def routing(
    listen: Sequence[str], connect: Sequence[str], tell: Callable[[str], None], keys_of_router: Keys | None = None
) -> AsyncIterator[None]:
    """Route while the body of `async with` runs.

    listen: endpoints at which others connect. connect: other routers. tell: called with a line for each participant
    that comes or goes, and for what is refused; it waits for no reader. keys_of_router: the router lets in only those
    that its keys name, and passes on only what the table of access allows them. Raises InputRefused when an endpoint
    is misspelled or does not go with the keys, RunFailed when one is taken.
    """
    with ExitStack() as stack:
        more: dict[str, object] = {}
        if keys_of_router is not None:
            more = _closed(keys_of_router, (*listen, *connect))
            stack.enter_context(telling_denials(tell))
            own = keys_of_router.holder
            stack.enter_context(closing(Expiry(own.common_name, own.until, LOG.warning)))
        async with _passing_on(open_router(connect, listen, more), tell):
            yield


def _closed(own: Keys, endpoints: Sequence[str]) -> dict[str, object]:
    """Zenoh's settings for a router with keys. Raises InputRefused."""
    where = str(own.folder)
    if own.holder.role != ROUTER:
        reason = f"these are the keys of {own.holder.common_name}, not of a router"
        raise InputRefused(Fault(reason=reason, where=where))
    if plain := [each for each in endpoints if not is_encrypted(each)]:
        raise InputRefused(Fault(reason=f"{plain[0]!r} with keys", where=where, advice="tls/HOST:PORT"))
    return {**encrypted(own), "access_control": access_control(own.holders())}


@asynccontextmanager
async def _passing_on(session: zenoh.Session, tell: Callable[[str], None]) -> AsyncIterator[None]:
    bridge = LoopBridge(lambda error, what: LOG.error("%s: %s", what, error, exc_info=error))

    def changed(sample: zenoh.Sample) -> None:
        robot, _, rest = str(sample.key_expr).partition("/")
        subject = rest.split("/")[4:]
        if len(subject) == 2 and subject[0] == "alive":
            there = "here" if sample.kind == zenoh.SampleKind.PUT else "gone"
            tell(f"{robot}: {subject[1]} is {there}")

    watching = session.liveliness().declare_subscriber(
        f"*/{keys.ANY_TOKEN}", bridge.on_loop(changed), history=True
    )  # fmt: skip
    try:
        yield
    finally:
        bridge.close()
        watching.undeclare()  # type: ignore[no-untyped-call]
        session.close()  # type: ignore[no-untyped-call]

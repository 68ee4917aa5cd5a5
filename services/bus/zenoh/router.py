"""A router: a process that belongs to no robot, and passes on what the processes of all machines send one another."""

from collections.abc import AsyncIterator, Callable, Sequence
from contextlib import asynccontextmanager

import zenoh

from engage_hri.schemas import keys
from engage_hri.services.bus.interface import LOG
from engage_hri.services.bus.zenoh.session import LoopBridge, open_router


@asynccontextmanager
async def routing(listen: Sequence[str], connect: Sequence[str], tell: Callable[[str], None]) -> AsyncIterator[None]:
    """Route while the body of `async with` runs.

    listen: endpoints at which others connect. connect: other routers. tell: called with a line for each participant
    that comes or goes. Raises InputRefused when an endpoint is misspelled, RunFailed when one is taken.
    """
    session = open_router(connect, listen)
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

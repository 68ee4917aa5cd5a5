"""Other robots on the bus: a hint for a client that waits for one that is not there."""

import asyncio
from collections.abc import AsyncIterator, Sequence
from typing import Any

import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import LOG, Bus
from engage_hri.services.bus.zenoh.session import RENDEZVOUS, open_session

LOOK: Seconds = 1.0
"""Time that the other robots have to answer; nothing else waits for that."""
POLL: Seconds = 0.05
AFTER: Seconds = 3.0
"""Time that a client waits before it gets the hint."""


async def tell_if_alone(bus: Bus, connect: Sequence[str], after: Seconds = AFTER) -> None:
    """Log a warning that names the robots on the bus, if none of this robot's services is there after this time."""
    await asyncio.sleep(after)
    if set(bus.health.peers) & set(keys.SERVICES):
        return
    others = [name for name in await robots(connect) if name != bus.robot]
    there = f"; there are: {', '.join(map(repr, others))}" if others else ""
    LOG.warning("no robot %r here yet%s; waiting (`engage up --robot %s` starts one)", bus.robot, there, bus.robot)


async def robots(connect: Sequence[str]) -> tuple[str, ...]:
    """Names of the robots on the bus, in order; without endpoints: on this machine's. Raises nothing."""
    try:
        session, _ = open_session(None, connect or (RENDEZVOUS,), (), None)
    except EngageError:
        return ()
    try:
        names: set[str] = set()
        until = asyncio.get_running_loop().time() + LOOK
        while not names and asyncio.get_running_loop().time() < until:  # the link itself takes a moment
            await asyncio.sleep(POLL)
            replies = session.liveliness().get(f"*/{keys.ANY_TOKEN}", timeout=LOOK)
            names.update([name async for name in _robots(replies, until)])
        return tuple(sorted(names))
    finally:
        session.close()  # type: ignore[no-untyped-call]


async def _robots(replies: Any, until: Seconds) -> AsyncIterator[str]:
    while asyncio.get_running_loop().time() < until:
        try:
            reply = replies.try_recv()
        except zenoh.ZError:  # all have answered
            return
        if reply is None:
            await asyncio.sleep(POLL)
        elif reply.ok is not None:
            yield str(reply.ok.key_expr).partition("/")[0]

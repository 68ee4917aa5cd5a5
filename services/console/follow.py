"""Listen to a running system and pass on what happens, each message with the local instant it speaks of."""

import asyncio
from collections.abc import AsyncIterator, Callable, Iterable
from contextlib import asynccontextmanager

from schemas import keys
from schemas.messages import Message
from schemas.units import Seconds, Stamp
from services.bus import Bus, Received

Sink = Callable[[Message, Seconds], None]
FOLLOWED = (
    keys.FRAGMENT,
    keys.ANY_FEEDBACK,
    keys.SYNC_POINT,
    keys.ANY_ACTION,
    keys.ANY_CONNECTION_EVENT,
    keys.ANY_STATISTICS,
    keys.HEAD_OWNER,
    keys.ANY_REQUEST_STATE,
    keys.ANY_FAULT,
    keys.ANY_ALIVE,
)
"""Everything but the streams and what only machines talk about."""


@asynccontextmanager
async def following(bus: Bus, sinks: Iterable[Sink], *, past: bool = True) -> AsyncIterator[None]:
    """Feed the sinks, in order, while the body of `async with` runs; what has arrived by its end is still fed.

    past: also with what the bus still has from before.
    """
    sinks = tuple(sinks)

    def tell(received: Received) -> None:
        if received.past and not past:
            return
        at = instant(bus, received)
        for sink in sinks:
            sink(received.message, at)

    with bus.subscribe(*FOLLOWED) as inbox:

        async def listen() -> None:
            async for received in inbox:
                tell(received)

        # In a group: a sink that fails ends the body, which might wait for ever.
        async with asyncio.TaskGroup() as group:
            listening = group.create_task(listen(), name="console")
            try:
                yield
            finally:
                listening.cancel()
                await asyncio.wait([listening])
                while listening.cancelled() and len(inbox) and (received := await inbox.next()):
                    tell(received)


def instant(bus: Bus, received: Received) -> Seconds:
    """When what the message tells happened, in local loop time; its arrival if it does not say."""
    at = getattr(received.message, "at", None)
    return bus.local(at) if isinstance(at, Stamp) else received.at

"""Listening to a running system: each message is passed on with the local instant that it tells of.

Actions are passed on as all their reporters together tell them (`heard.py`).
"""

import asyncio
from collections.abc import AsyncIterator, Callable, Collection, Iterable
from contextlib import asynccontextmanager

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import BodyHeld, Held, NetWaiting
from engage_hri.schemas.body_faults import BodyFaults
from engage_hri.schemas.fragments import HeadOwner, StudyCondition
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent, OpenEvents
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.client.event_stream import EventStream
from engage_hri.services.console.heard import Heard

Sink = Callable[[Message, Seconds], None]
FOLLOWED = (
    keys.ANY_FEEDBACK,
    keys.SYNC_POINT,
    keys.ANY_ACTION,
    keys.UTTERANCE,
    keys.ANY_CONNECTION_EVENT,
    keys.ANY_OPEN_EVENTS,
    keys.ANY_STATISTICS,
    keys.ANY_INTERJECTION,
    keys.FLOOR,
    keys.SAME_PEOPLE,
    keys.HEAD_OWNER,
    keys.HELD,
    keys.BODY_HELD,
    keys.BODY_FAULTS,
    keys.STUDY_CONDITION,
    keys.ANY_REQUEST_STATE,
    keys.ANY_FAULT,
    keys.ANY_ROBOT_ALIVE,
)
"""Expressions for all messages that people want to see. Presence ends the events of a dead recognition."""


@asynccontextmanager
async def following(
    bus: Bus,
    sinks: Iterable[Sink],
    *,
    past: bool = True,
    patterns: Collection[str] = FOLLOWED,
    kinds: Collection[str] = (),
) -> AsyncIterator[None]:
    """Feed the sinks, in order, while the body of `async with` runs; messages that have arrived by its end are still
    fed.

    past: feed also earlier messages that the bus still has; of connection events those that are open. What is held,
    switched on or set now is fed in any case.
    kinds: of connection events; empty: all.
    """
    sinks = tuple(sinks)
    events = EventStream(bus.now(), bus.stamp, kinds=kinds, opening=past)

    def tell(message: Message, at: Seconds) -> None:
        for sink in sinks:
            sink(message, at)

    heard = Heard(
        bus.robot, bus.clock, lambda stamp, came: bus.local(stamp), lambda message, came: instant(bus, message, came)
    )

    def take(received: Received) -> None:
        message, at = received.message, instant(bus, received.message, received.at)
        for event in events.feed(message, at, bus.now(), past=received.past):
            tell(event, instant(bus, event, at))
        is_now = past or not received.past or isinstance(message, Held | BodyHeld | BodyFaults | StudyCondition)
        for each, when in heard.take(received, bus.now()):
            if is_now and not isinstance(each, ConnectionEvent | OpenEvents):
                tell(each, when)

    def advance() -> None:
        for event in events.expire(bus.now()):
            tell(event, bus.now())
        for each, when in heard.advance(bus.now()):
            tell(each, when)

    def deadline() -> Seconds | None:
        return min((due for due in (events.deadline, heard.deadline) if due is not None), default=None)

    with bus.subscribe(*patterns) as inbox:

        async def listen() -> None:
            while not inbox.is_over:
                if (received := await inbox.next(deadline())) is not None:
                    take(received)
                else:
                    advance()

        # A group, so that a failing sink ends the body, which might wait for ever.
        async with asyncio.TaskGroup() as group:
            listening = group.create_task(listen(), name="console")
            try:
                yield
            finally:
                listening.cancel()
                await asyncio.wait([listening])
                while listening.cancelled() and len(inbox) and (received := await inbox.next()):
                    take(received)


def instant(bus: Bus, message: Message, arrived: Seconds) -> Seconds:
    """Instant that a message tells of, in local loop time; that of its arrival if it has none."""
    at = message.since if isinstance(message, HeadOwner | NetWaiting) else getattr(message, "at", None)
    return bus.local(at) if isinstance(at, Stamp) else arrived

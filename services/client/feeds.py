"""Feeds of a client: messages of one kind as they come, with `async for` or one by one."""

from collections import deque
from collections.abc import Callable, Iterable
from typing import TypeVar

from engage_hri.schemas import keys
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus.interface import Bus, Reading, Received, Subscription
from engage_hri.services.client.event_stream import EventStream
from engage_hri.services.runtime.action_reports import REPORT_GRACE, ActionReports, events
from engage_hri.services.runtime.ongoing_actions import ActionEvent

M = TypeVar("M")


class Feed(Reading[M]):
    """Messages of one kind from now on: `async for`, or `next` with a timeout. Ends with the client.

    Use it in a `with`, or close it: until then messages are kept even if nobody reads them.
    """

    def __init__(self, subscription: Subscription, kinds: tuple[type, ...], now: Callable[[], Seconds]) -> None:
        self._subscription = subscription
        self._kinds = kinds
        self._now = now

    async def next(self, timeout: Seconds | None = None) -> M | None:
        """Return the next message; None after `timeout` seconds without one, or at the end.

        timeout: seconds; None: for ever.
        """
        deadline = None if timeout is None else self._now() + timeout
        while (received := await self._subscription.next(deadline)) is not None:
            if self._is_wanted(received):
                return received.message  # type: ignore[return-value]
        return None

    def _is_wanted(self, received: Received) -> bool:
        return isinstance(received.message, self._kinds)

    def close(self) -> None:
        """End the feed: nothing more comes, and a task that waits in `next` gets None."""
        self._subscription.close()


class NewFeed(Feed[M]):
    """Messages of one kind that are no older than the feed, whatever the bus gives to who comes late."""

    def __init__(self, bus: Bus, kinds: tuple[type, ...], patterns: Iterable[str]) -> None:
        super().__init__(bus.subscribe(*patterns), kinds, bus.now)
        self._bus = bus
        self._began = bus.now()

    def _is_wanted(self, received: Received) -> bool:
        """True for all but the past. What is sent while the bus still looks for that may come with it."""
        at = getattr(received.message, "at", None)
        is_new = not received.past or (isinstance(at, Stamp) and self._bus.local(at) > self._began)
        return is_new and super()._is_wanted(received)


class EventFeed(Feed[ConnectionEvent]):
    """Connection events: each change exactly once, in order. Events open when recognition dies end as `lost`."""

    def __init__(self, bus: Bus, stream: EventStream, patterns: Iterable[str]) -> None:
        super().__init__(bus.subscribe(*patterns), (ConnectionEvent,), bus.now)
        self._bus = bus
        self._stream = stream
        self._told: deque[ConnectionEvent] = deque()

    @property
    def open(self) -> tuple[ConnectionEvent, ...]:
        """The events that have not ended, of those that `next` has returned or will return at once."""
        return tuple(self._stream.open.values())

    async def next(self, timeout: Seconds | None = None) -> ConnectionEvent | None:
        """Return the next change; None after `timeout` seconds without one, or at the end.

        timeout: seconds; None: for ever.
        """
        deadline = None if timeout is None else self._now() + timeout
        while not self._told:
            due = self._stream.deadline
            received = await self._subscription.next(
                min((at for at in (deadline, due) if at is not None), default=None)
            )
            if received is not None:
                message = received.message
                at = self._bus.local(message.at) if isinstance(message, ConnectionEvent) else received.at
                self._told += self._stream.feed(message, at, self._now(), past=received.past)
            elif due is not None and self._now() >= due:
                self._told += self._stream.expire(self._now())
            else:
                return None
        return self._told.popleft()


class ActionFeed(Feed[ActionEvent]):
    """Actions as all who report them together tell them: they end, also if their reporter was killed.

    It begins with the people who are there, and with the looks, points and other actions that go on.
    """

    def __init__(self, bus: Bus) -> None:
        patterns = (keys.ANY_ACTION, keys.ROBOT_ONGOING, keys.ANY_PERCEIVED_ONGOING, keys.ANY_ALIVE)
        super().__init__(bus.subscribe(*patterns), (), bus.now)
        self._bus = bus
        self._reports = ActionReports(bus.robot, REPORT_GRACE, bus.clock, self._instant)
        self._told: deque[ActionEvent] = deque()

    def _instant(self, stamp: Stamp) -> Seconds:
        """Local time of a stamp, at most now."""
        return min(self._bus.local(stamp), self._bus.now())

    async def next(self, timeout: Seconds | None = None) -> ActionEvent | None:
        """Return the next event; None after `timeout` seconds without one, or at the end.

        timeout: seconds; None: for ever.
        """
        deadline = None if timeout is None else self._now() + timeout
        while not self._told:
            due = self._reports.deadline
            until = min((at for at in (deadline, due) if at is not None), default=None)
            if (one := await self._subscription.next(until)) is not None:
                told = self._reports.take(one.message, one.key, one.source, one.life, self._now(), past=one.past)
            elif due is not None and self._now() >= due:
                told = self._reports.advance(self._now())
            else:
                return None
            self._told += (event for event, _ in events(told, self._bus.clock))
        return self._told.popleft()

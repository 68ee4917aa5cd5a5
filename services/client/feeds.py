"""Feeds of a client: messages of one kind as they come, with `async for` or one by one."""

from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterable
from typing import TypeVar

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, NoReply
from engage_hri.schemas.recognition import ConnectionEvent, Statistics
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus, Keep, Reading, Received, Subscription
from engage_hri.services.client.event_stream import EventStream
from engage_hri.services.client.inputs import taken
from engage_hri.services.reports.action_reports import REPORT_GRACE, ActionReports, events
from engage_hri.services.reports.ongoing_actions import ActionEvent, TimedReport
from engage_hri.services.reports.same_people import PeopleNames

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


async def first_of(
    feed: Feed[M], what: str, timeout: Seconds | None, is_wanted: Callable[[M], bool] = lambda message: True
) -> M:
    """Return the first message of a feed that is wanted, and close the feed.

    what: its name, for the reader. Raises NoReply if none has come in time, InputRefused if `timeout` is no number.
    """
    with feed:
        taken(timeout, Seconds | None, "timeout")
        deadline = None if timeout is None else feed._now() + timeout
        while True:
            left = None if deadline is None else max(0.0, deadline - feed._now())
            if (message := await feed.next(left)) is None:
                within = " any more: the connection is over" if timeout is None else f" within {timeout} s"
                raise NoReply(Fault(reason=f"no {what}{within}", advice="is its service running?"))
            if is_wanted(message):
                return message


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


class DerivedFeed(Feed[M]):
    """News made of messages and of time that passes: several of one message, or none."""

    def __init__(self, bus: Bus, patterns: Iterable[str], keep: Keep = Keep.EVERY) -> None:
        super().__init__(bus.subscribe(*patterns, keep=keep), (), bus.now)
        self._bus = bus
        self._told: deque[M] = deque()

    async def next(self, timeout: Seconds | None = None) -> M | None:
        """Return the next piece of news; None after `timeout` seconds without one, or at the end.

        timeout: seconds; None: for ever.
        """
        deadline = None if timeout is None else self._now() + timeout
        while not self._told:
            due = self._due
            until = min((at for at in (deadline, due) if at is not None), default=None)
            if (received := await self._subscription.next(until)) is not None:
                self._told += self._taken(received)
            elif due is not None and self._now() >= due:
                self._told += self._passed()
            else:
                return None
        return self._told.popleft()

    @property
    def _due(self) -> Seconds | None:
        """Local time at which something comes without a message; None: nothing does."""
        return None

    @abstractmethod
    def _taken(self, received: Received) -> Iterable[M]:
        """Take a message."""

    def _passed(self) -> Iterable[M]:
        """Take the news that it is due."""
        return ()


class EventFeed(DerivedFeed[ConnectionEvent]):
    """Connection events: each change exactly once, in order. Events open when recognition dies end as `lost`."""

    def __init__(self, bus: Bus, stream: EventStream, patterns: Iterable[str]) -> None:
        super().__init__(bus, patterns)
        self._stream = stream

    @property
    def open(self) -> tuple[ConnectionEvent, ...]:
        """The events that have not ended, of those that `next` has returned or will return at once."""
        return tuple(self._stream.open.values())

    @property
    def _due(self) -> Seconds | None:
        return self._stream.deadline

    def _taken(self, received: Received) -> Iterable[ConnectionEvent]:
        message = received.message
        at = self._bus.local(message.at) if isinstance(message, ConnectionEvent) else received.at
        return self._stream.feed(message, at, self._now(), past=received.past)

    def _passed(self) -> Iterable[ConnectionEvent]:
        return self._stream.expire(self._now())


class LevelFeed(DerivedFeed[Statistics]):
    """Statistics of people, each only if its level is another than that told before.

    An id that turns out to be another one's is told once more, as `unknown`: nothing comes under it any more.
    """

    def __init__(self, bus: Bus) -> None:
        super().__init__(bus, (keys.ANY_STATISTICS, keys.SAME_PEOPLE))
        self._names = PeopleNames()
        self._last: dict[str, Statistics] = {}

    def _taken(self, received: Received) -> Iterable[Statistics]:
        message = received.message
        news: list[Statistics] = []
        if isinstance(message, Statistics):
            last = self._last.get(message.actor)
            if message.actor and (last is None or last.level != message.level):
                news.append(message)
        elif self._names.take(message):
            for id, last in self._last.items():
                if (name := self._names.name(id)) != id and last.level != "unknown":
                    news.append(replace(last, engagement=None, level="unknown", reasons=(f"this is {name}",)))
        self._last |= {each.actor: each for each in news}
        return news


class StatisticsFeed(DerivedFeed[Statistics]):
    """Statistics of one person, by whatever id somebody knows them. Only the newest are kept."""

    def __init__(self, bus: Bus, actor: str) -> None:
        super().__init__(bus, (keys.ANY_STATISTICS, keys.SAME_PEOPLE), Keep.LATEST)
        self._actor = actor
        self._names = PeopleNames()
        self._last: dict[str, Statistics] = {}
        """The newest of each person: the word that two ids are one may come after them."""

    def _taken(self, received: Received) -> Iterable[Statistics]:
        message, name = received.message, self._names.name(self._actor)
        if isinstance(message, Statistics):
            self._last[message.actor] = message
            return (message,) if message.actor == name else ()
        self._names.take(message)
        now = self._names.name(self._actor)
        return (self._last[now],) if now != name and now in self._last else ()


SAME_PATIENCE: Seconds = 0.2
"""Time for which the first world waits for the news who is one person: recognition may not be there. Ours."""


class WorldFeed(DerivedFeed[World]):
    """The world with each person once, by the id by which recognition tells of them. Only the newest is kept."""

    def __init__(self, bus: Bus) -> None:
        super().__init__(bus, (keys.SAME_PEOPLE, keys.WORLD), Keep.LATEST)
        self._names = PeopleNames()
        self._is_named = False
        self._last: World | None = None
        """As it was published."""
        self._waits_until: Seconds | None = None

    @property
    def _due(self) -> Seconds | None:
        return self._waits_until

    def _taken(self, received: Received) -> Iterable[World]:
        if isinstance(received.message, World):
            self._last = received.message
            if self._is_named:
                return self._passed()
            self._waits_until = self._waits_until or self._now() + SAME_PATIENCE
            return ()
        changes = self._names.take(received.message)
        return self._passed() if changes or not self._is_named else ()

    def _passed(self) -> Iterable[World]:
        self._is_named, self._waits_until = True, None
        return () if self._last is None else (self._names.named(self._last),)


class ActionFeed(DerivedFeed[ActionEvent]):
    """Actions as all who report them together tell them: they end, also if their reporter was killed.

    It begins with the people who are there, and with the looks, points and other actions that go on.
    """

    def __init__(self, bus: Bus) -> None:
        super().__init__(bus, (keys.ANY_ACTION, keys.ROBOT_ONGOING, keys.ANY_PERCEIVED_ONGOING, keys.ANY_ROBOT_ALIVE,
                               keys.SAME_PEOPLE))  # fmt: skip
        self._reports = ActionReports(bus.robot, REPORT_GRACE, bus.clock, self._instant)

    @property
    def _due(self) -> Seconds | None:
        return self._reports.deadline

    def _taken(self, received: Received) -> Iterable[ActionEvent]:
        told = self._reports.take(
            received.message, received.key, received.source, received.life, self._now(), past=received.past
        )
        return self._events(told)

    def _passed(self) -> Iterable[ActionEvent]:
        return self._events(self._reports.advance(self._now()))

    def _events(self, told: Iterable[TimedReport]) -> Iterable[ActionEvent]:
        return (event for event, _ in events(told, self._bus.clock))

    def _instant(self, stamp: Stamp) -> Seconds:
        """Local time of a stamp, at most now."""
        return min(self._bus.local(stamp), self._bus.now())

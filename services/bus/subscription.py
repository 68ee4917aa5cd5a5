"""Queues of messages for one reader: `Subscription` of decoded ones, `Tap` of samples as they travel."""

import asyncio
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Iterable
from enum import Enum, auto
from typing import Any, Generic, Self, TypeVar

from engage_hri.schemas import keys
from engage_hri.schemas.messages import encode, encoding_of
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.samples import Received as Received
from engage_hri.services.bus.samples import Sample as Sample


class Keep(Enum):
    """Messages that a subscription keeps while its reader is busy."""

    EVERY = auto()
    LATEST = auto()
    """Keep only the newest message of each key."""


T = TypeVar("T")


class Reading(ABC, Generic[T]):
    """Items read one by one: with `next`, or with `async for` until there are no more; `with` closes the reading."""

    @abstractmethod
    async def next(self, until: Seconds | None = None, /) -> T | None:
        """Wait for the next item; None if there is none by `until`, or after the end."""

    @abstractmethod
    def close(self) -> None:
        """End the reading: no items come any more."""

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> T:
        one = await self.next()
        if one is None:
            raise StopAsyncIteration
        return one

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *raised: object) -> None:
        self.close()


KEYS_KEPT = 1024
"""Number of keys of which a subscription knows the pattern: clients come and go, each with its own."""
CAPACITY = 32 * 1024 * 1024
"""Bytes of the payloads that wait in a tap."""
Item = TypeVar("Item", Received, Sample)


class _Queue(Reading[Item]):
    """A bounded queue of messages, in order across all keys.

    Used by one task at a time. When full, the oldest message of the process that has most in it is dropped and
    counted in `overflowed`: a flood costs nobody else anything. Who comes and goes is never dropped.
    """

    def __init__(self, patterns: Iterable[str], capacity: int, on_close: Callable[[Any], None]) -> None:
        self.patterns = tuple(patterns)
        self.capacity = capacity
        self.overflowed = 0
        self.waiting = 0
        """Weight of all that waits."""
        self._queue: deque[Item] = deque()
        self._lives = Counter[str]()
        self._waiting: asyncio.Future[None] | None = None
        self._on_close, self._closed = on_close, False
        self._carriers: dict[str, str | None] = {}

    def wants(self, key: str) -> bool:
        """True if a pattern includes the key."""
        try:  # a shorter way, for this is asked for every message and subscription
            return self._carriers[key] is not None
        except KeyError:
            return self.carrier(key) is not None

    def carrier(self, key: str) -> str | None:
        """The first pattern that includes the key: each message comes once, however many patterns include it."""
        if keys.is_presence(key):  # Each who comes and goes has a key, which is hardly ever asked for again.
            return keys.first(self.patterns, key)
        if key not in self._carriers:
            if len(self._carriers) >= KEYS_KEPT:
                self._carriers.clear()
            self._carriers[key] = keys.first(self.patterns, key)
        return self._carriers[key]

    def offer(self, item: Item) -> None:
        """Put a message in the queue; called by the bus."""
        if self._closed:
            return
        weight = self._weight(item)
        self._lives[item.life] += weight
        self.waiting += weight
        while self.waiting > self.capacity and self._make_room():
            pass
        self._queue.append(item)
        self._wake()

    def _weight(self, item: Item) -> int:
        return 1

    def _make_room(self) -> bool:
        """Drop a message. Returns False if there is none that may be dropped."""
        for life, _ in self._lives.most_common():
            for index, queued in enumerate(self._queue):
                if queued.life == life and not keys.is_presence(queued.key):
                    self._remove(index)
                    self.overflowed += 1
                    return True
        return False

    def _remove(self, index: int) -> Item:
        item = self._queue[index]
        del self._queue[index]
        weight = self._weight(item)
        self._lives[item.life] -= weight
        self.waiting -= weight
        if not self._lives[item.life]:
            del self._lives[item.life]
        return item

    def _wake(self) -> None:
        if self._waiting is not None and not self._waiting.done():
            self._waiting.set_result(None)

    def __len__(self) -> int:
        return len(self._queue)

    @property
    def is_over(self) -> bool:
        """True if the subscription is closed and read to its end: `next` does not wait any more."""
        return self._closed and not self._queue

    async def next(self, deadline: Seconds | None = None) -> Item | None:
        """Wait for the next message; None if there is none by loop time `deadline`, or after `close`."""
        loop = asyncio.get_running_loop()
        while not self._queue and not self._closed:
            if deadline is not None and loop.time() >= deadline:
                return None
            self._waiting = waiting = loop.create_future()
            timer = None if deadline is None else loop.call_at(deadline, self._wake)
            try:
                await waiting
            finally:
                self._waiting = None
                if timer is not None:
                    timer.cancel()
        return self.take()

    def take(self) -> Item | None:
        """Take the next message if it is there already."""
        return self._remove(0) if self._queue else None

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._on_close(self)
            self._wake()


class Subscription(_Queue[Received]):
    """A bounded queue of received messages, in order across all its keys; read it with `async for` or `next`.

    Used by one task at a time. When full, the oldest message of the process that has most in it is dropped and
    counted in `overflowed`: a flood costs nobody else anything. Who comes and goes is never dropped.
    """

    def __init__(
        self, patterns: Iterable[str], keep: Keep, capacity: int, on_close: Callable[["Subscription"], None]
    ) -> None:
        super().__init__(patterns, capacity, on_close)
        self.keep = keep

    def offer(self, item: Received) -> None:
        if self.keep is Keep.LATEST and not self._closed:
            for index, queued in enumerate(self._queue):
                if queued.key == item.key:
                    self._remove(index)
                    break
        super().offer(item)


class Tap(_Queue[Sample]):
    """A queue of samples as they travel, in order, for programs that keep or pass on what they need not understand.

    Bounded by the bytes of the payloads; what is dropped is chosen and counted as in a `Subscription`.
    """

    def _weight(self, item: Sample) -> int:
        return len(item.payload) + len(item.key)


def offer_presence(reader: Subscription | Tap, part: keys.Part, message: PeerAlive | PeerGone, now: Seconds) -> None:
    """Offer the news that a participant is there, or is gone, to a reader that wants it. part: of its presence."""
    key = keys.alive(message.participant, part)
    if not reader.wants(key):
        return
    if isinstance(reader, Tap):
        reader.offer(Sample(key, encode(message), encoding_of(message), message.participant, now))
    else:
        reader.offer(Received(key, message, message.participant, now))

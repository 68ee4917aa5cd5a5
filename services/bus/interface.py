"""The bus, as services see it: one interface, two implementations (`memory`, `zenoh`), one contract suite.

A process opens one `Hub`; each service joins it under its own name and gets a `Bus`. Delivery is by the class of
the key (`schemas/keys.py`). Messages are frozen structs. Nothing here starts a thread.
"""

import asyncio
import logging
import platform
import time
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable, Coroutine, Iterable, Iterator
from enum import Enum, auto
from typing import Any, Generic, Self, TypeVar

from msgspec import Struct

from engage_hri.schemas import keys
from engage_hri.schemas.faults import EngageError, Fault
from engage_hri.schemas.messages import Message
from engage_hri.schemas.presence import PeerAlive, PeerGone
from engage_hri.schemas.requests import Request, kind_of, life_of
from engage_hri.schemas.status import BusHealth, ProcessFacts
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus import journal

LOG = logging.getLogger("engage")
"""Log of all that is not one participant's. A line at level ERROR is a bug, and fails a test that expects none."""


class Keep(Enum):
    """Messages that a subscription keeps while its reader is busy."""

    EVERY = auto()
    LATEST = auto()
    """Keep only the newest message of each key."""


class Received(Struct, frozen=True):
    """A message as it arrived. source: the participant that published it. at: local time of arrival.

    life: of the process or connection that it came from, where that is known. past: the message is from before the
    subscription, given to a late subscriber as the class of its key says.
    """

    key: str
    message: Message
    source: str
    at: Seconds
    past: bool = False
    life: str = ""


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


class Subscription(Reading[Received]):
    """A bounded queue of received messages, in order across all its keys; read it with `async for` or `next`.

    Used by one task at a time. When full, the oldest message of the process that has most in it is dropped and
    counted in `overflowed`: a flood costs nobody else anything. Who comes and goes is never dropped.
    """

    def __init__(
        self, patterns: Iterable[str], keep: Keep, capacity: int, on_close: Callable[["Subscription"], None]
    ) -> None:
        self.patterns = tuple(patterns)
        self.keep, self.capacity, self.overflowed = keep, capacity, 0
        self._queue: deque[Received] = deque()
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

    def offer(self, received: Received) -> None:
        """Put a message in the queue; called by the bus."""
        if self._closed:
            return
        self._lives[received.life] += 1
        if self.keep is Keep.LATEST:
            for index, queued in enumerate(self._queue):
                if queued.key == received.key:
                    self._remove(index)
                    break
        elif len(self._queue) >= self.capacity:
            self._make_room()
        self._queue.append(received)
        self._wake()

    def _make_room(self) -> None:
        for life, _ in self._lives.most_common():
            for index, queued in enumerate(self._queue):
                if queued.life == life and not isinstance(queued.message, PeerAlive | PeerGone):
                    self._remove(index)
                    self.overflowed += 1
                    return

    def _remove(self, index: int) -> Received:
        received = self._queue[index]
        del self._queue[index]
        self._lives[received.life] -= 1
        if not self._lives[received.life]:
            del self._lives[received.life]
        return received

    def _wake(self) -> None:
        if self._waiting is not None and not self._waiting.done():
            self._waiting.set_result(None)

    def __len__(self) -> int:
        return len(self._queue)

    @property
    def is_over(self) -> bool:
        """True if the subscription is closed and read to its end: `next` does not wait any more."""
        return self._closed and not self._queue

    async def next(self, deadline: Seconds | None = None) -> Received | None:
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
        return self._remove(0) if self._queue else None

    def close(self) -> None:
        if not self._closed:
            self._closed = True
            self._on_close(self)
            self._wake()


Answer = Callable[[Message], Message | Coroutine[Any, Any, Message]]


class Bus(ABC):
    """One participant's view of the bus.

    robot: the namespace. name: the participant's; appears as `Received.source` and on its liveliness token.
    role: its part among the others, one of `keys.ROLES`; stands in the keys of its commands.
    clock: the clock that `now` reads, the same for all processes that can compare their times directly.
    run: the participant's life. failures: number of errors here that were contained.
    log: the log of what happens here (`services/bus/journal.py`).
    """

    def __init__(self, robot: str, name: str, role: str, clock: str, run: str, life_numbers: Iterator[int]) -> None:
        """life_numbers: numbers that no former participant of this name in this run has used."""
        self.robot = robot
        self.name = name
        self.role = role
        self.clock = clock
        self.run = run
        self.failures = 0
        self.log = journal.logger(name, role)
        self._life_numbers = life_numbers
        self._loop = asyncio.get_running_loop()
        self._gone = False

    @property
    @abstractmethod
    def health(self) -> BusHealth:
        """Figures of the connection: peers, and messages passed, dropped and lost."""

    def now(self) -> Seconds:
        """Return the loop time."""
        return self._loop.time()

    def stamp(self, at: Seconds | None = None) -> Stamp:
        """Make a stamp of `at`, or of now, on this clock."""
        return Stamp(self.clock, self.now() if at is None else at)

    @abstractmethod
    def local(self, stamp: Stamp) -> Seconds:
        """Convert a stamp to local loop time, through the estimated offset of its clock."""

    @abstractmethod
    def error(self, clock: str) -> Seconds:
        """Greatest error of `local` for stamps of this clock; inf if nothing is known of it yet."""

    def new_life(self) -> str:
        """Make the life of a requester on this bus: two requesters may use the same ids then."""
        return life_of(self.run, next(self._life_numbers))

    # -- what goes wrong ------------------------------------------------------------------------------------------

    def containing(self, what: object, then: Callable[[Fault], None] | None = None) -> "Containing":
        """Contain an exception in the body of `with`: it is logged, counted and told as a fault, and goes no further.

        what: what is being done, for the reader of the fault: text, or the message that is being taken. then: called
        with the fault, to end the request or block that can't go on.
        """
        return Containing(self, what, then)

    def failed(self, error: BaseException, what: object) -> Fault:
        """Log, count and tell an unforeseen exception. what: see `containing`."""
        reason = error.fault.reason if isinstance(error, EngageError) else _text(error)
        fault = Fault(
            reason=reason, where=_told(what), advice="this is a bug: the log has its traceback", service=self.name
        )
        self.failures += 1
        self.log.error("%s: %s", self.name, fault, exc_info=error)
        self._complain(fault)
        return fault

    def report(self, fault: Fault) -> None:
        """Log, count and tell a mistake of this participant that raised no exception."""
        self.failures += 1
        self.log.error("%s: %s", self.name, fault)
        self._complain(fault)

    def _complain(self, fault: Fault) -> None:
        try:
            self.publish(keys.fault(self.name), fault)
        except Exception:
            self.log.exception("%s: the fault could not be told", self.name)

    def publish(self, key: str, message: Message) -> None:
        """Send to all subscribers of `key`, this process' own included. It is no error if there are none."""
        journal.note(self.log, key, message)
        self._send(key, message)

    @abstractmethod
    def _send(self, key: str, message: Message) -> None:
        """Publish the message; does nothing after the participant has left."""

    @abstractmethod
    def withdraw(self, *states: str) -> None:
        """Take back the last value of these keys of class `state`: who comes later gets nothing.

        For what has gone for good, as a person has. Who has it already keeps it.
        """

    @abstractmethod
    def is_heard(self, key: str) -> bool:
        """Tell whether anybody has subscribed to `key`, in any process. For streams that cost something."""

    @abstractmethod
    def subscribe(self, *patterns: str, keep: Keep = Keep.EVERY, capacity: int = 4096) -> Subscription:
        """Queue all messages of these key expressions. Past ones come first, as the class of each key says.

        A pattern of class `alive` delivers `PeerAlive` for all participants that are there, then every change.
        """

    @abstractmethod
    async def query(self, key: str, message: Message, timeout: Seconds = 1.0) -> Message:
        """Ask the server of an `rpc` key. Raises NoReply (absent, late) or InputRefused (it answered a Fault)."""

    @abstractmethod
    def answer(self, key: str, answer: Answer, *, empty: Message | None = None) -> None:
        """Serve an `rpc` key for the life of this bus. `answer` changes nothing; an EngageError becomes a Fault.

        answer: a coroutine if it takes long. empty: the question of a query without payload, as from plain Zenoh.
        """

    @abstractmethod
    def declare_alive(self) -> None:
        """Show this participant's liveliness token; called once its subscriptions are made."""

    @abstractmethod
    async def leave(self) -> None:
        """Withdraw subscriptions, answers and token. Idempotent."""


class Containing:
    """Context manager of `Bus.containing`. A class, for a generator would be slower: it is used for each message."""

    __slots__ = ("_bus", "_then", "_what")

    def __init__(self, bus: Bus, what: object, then: Callable[[Fault], None] | None) -> None:
        self._bus = bus
        self._what = what
        self._then = then

    def __enter__(self) -> None:
        pass

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> bool:
        if error is None or not isinstance(error, Exception | asyncio.CancelledError) or is_asked_to_stop():
            return False
        fault = self._bus.failed(error, self._what)
        if self._then is not None:
            try:
                self._then(fault)
            except Exception as worse:
                self._bus.failed(worse, "what follows from the fault before")
        return True


def _text(error: BaseException) -> str:
    try:
        return f"{type(error).__name__}: {error}"
    except Exception:  # the error's own __str__ raises
        return type(error).__name__


def is_asked_to_stop() -> bool:
    """True if this task was cancelled. Else a CancelledError in it is a mistake of a future that it awaits."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


def _told(what: object) -> str:
    match what:
        case Received(key=key, source=source):
            return f"{key} from {source or 'a stranger'}"
        case Request(id=id):
            return f"{kind_of(what)} {id}"
    return str(what)


class Hub(ABC):
    """A process' connection to the bus."""

    robot: str

    @abstractmethod
    def join(self, name: str, role: str = "manager") -> Bus:
        """Add a participant; returns its view of the bus. Names are unique on a robot's bus."""

    def called(self, name: str) -> str:
        """Name that a participant gets who asks for this one. Keys may give another."""
        return name

    @abstractmethod
    async def wait_until_free(self, *names: str) -> None:
        """Wait until no other participant has these names: one that has died may seem alive for a while.

        Raises InputRefused for names that stay taken.
        """

    def facts(self) -> ProcessFacts:
        """Tell what this process runs on."""
        loop = type(asyncio.get_running_loop()).__module__.partition(".")[0]
        return ProcessFacts(host=platform.node(), python=platform.python_version(), loop=loop, wall=time.time())

    @abstractmethod
    async def close(self) -> None: ...

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *raised: object) -> None:
        await self.close()

"""The bus, as services see it, with what becomes of faults and of messages that nobody can read.

It is one interface with two implementations (`memory`, `zenoh`) and one contract suite.

A process opens one `Hub`; each service joins it under its own name and gets a `Bus`. Delivery is by the class of
the key (`schemas/keys.py`). Messages are frozen structs. Nothing here starts a thread.
"""

import asyncio
import logging
import platform
import re
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from math import inf
from typing import Any, Self, TypeVar

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.access import role_of
from engage_hri.schemas.faults import Cause, EngageError, Fault, InputRefused, NoReply, bug
from engage_hri.schemas.messages import Message
from engage_hri.schemas.participants import BusHealth, ProcessFacts
from engage_hri.schemas.requests import Request, Unreadable, kind_of, life_of
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus import journal
from engage_hri.services.bus.deadlines import Sight
from engage_hri.services.bus.samples import Often, sender_of, unreadable
from engage_hri.services.bus.subscription import CAPACITY as CAPACITY
from engage_hri.services.bus.subscription import Keep as Keep
from engage_hri.services.bus.subscription import Reading as Reading
from engage_hri.services.bus.subscription import Received as Received
from engage_hri.services.bus.subscription import Sample as Sample
from engage_hri.services.bus.subscription import Subscription as Subscription
from engage_hri.services.bus.subscription import Tap as Tap

LOG = logging.getLogger("engage")
"""Log of all that is not one participant's. A line at level ERROR is a bug, and fails a test that expects none."""


Reader = TypeVar("Reader", Subscription, Tap)
Answer = Callable[[Message], Message | Coroutine[Any, Any, Message]]


class Bus(ABC):
    """One participant's view of the bus.

    robot: the namespace. name: the participant's; appears as `Received.source` and on its liveliness token.
    role: what it does among the others, one of `keys.ROLES`; stands in the keys of its commands. part: follows from
    it; stands in the key of its presence.
    clock: the clock that `now` reads, the same for all processes that can compare their times directly.
    sight: what it knows of itself when it misses others.
    run: the participant's life. failures: number of errors here that were contained.
    log: the log of what happens here (`services/bus/journal.py`).
    """

    def __init__(self, robot: str, name: str, role: str, clock: str, run: str, life_numbers: Iterator[int]) -> None:
        """life_numbers: numbers that no former participant of this name in this run has used."""
        self.robot = robot
        self.name = name
        self.role = role or role_of(name)
        self.part = keys.part_of(self.role)
        self.clock = clock
        self.run = run
        self.failures = 0
        self.log = journal.logger(name, self.role)
        self._life_numbers = life_numbers
        self.sight = Sight(name, lambda: self.unlinked_at)
        self._loop = asyncio.get_running_loop()
        self._gone = False
        self._readers: list[Subscription | Tap] = []
        self._overflowed = 0
        """Messages that readers have dropped which are closed."""
        self._is_told_unsent = False
        self._refused = Often()

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

    @property
    def unlinked_at(self) -> Seconds:
        """Local time at which this process last had no router, though it had had one; -inf: never."""
        return -inf

    def unanswered(self, key: str, within: Seconds) -> NoReply:
        """The error of a question that nobody has answered, with the reason as far as it can be known here."""
        server = keys.server_of(key)
        cause: Cause = "gone"
        why, advice = "it is not there", f"is {server} running?"
        if server in self.health.peers:
            cause, why, advice = "silent", "it is there, but does not answer", f"is {server} stuck?"
        what = f"no reply from {server} within {within:g} s"
        return NoReply(self.sight.fault(what, why, cause, server, key, self.now() - within, advice))

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
        fault = bug(error, _told(what), self.name)
        self.failures += 1
        self.log.error("%s: %s", self.name, fault, exc_info=error)
        self._complain(fault)
        return fault

    def report(self, fault: Fault) -> None:
        """Log, count and tell a mistake of this participant that raised no exception."""
        self.failures += 1
        self.log.error("%s: %s", self.name, fault)
        self._complain(fault)

    def tell_refused(self, fault: Fault, of: str) -> bool:
        """Tell a fault of what another program sent. False: not this time, for that has sent the like many times.

        of: that program, as far as it is known.
        """
        kind = f"{fault.where} {re.sub('[0-9]+', '0', fault.reason)}"
        times = self._refused.tell(of, kind, self.now())
        if times:
            reason = fault.reason if times == 1 else f"{fault.reason} ({times} times)"
            told = replace(fault, reason=reason, service=self.name)
            self.log.warning("refused: %s", told)
            self.publish(keys.fault(self.name), told)
        return times > 0

    def unreadable(self, error: EngageError, sample: Sample) -> Unreadable | None:
        """Tell of a bad payload as a fault. Returns the notice for the server of its key, if that is to have one.

        Somebody may wait for the end of a request or a block whose id can be read: of each there is a notice. Nobody
        waits for one without an id: of those there is a notice whenever the fault is told.
        """
        key, is_told = sample.key, False
        if not keys.matches(keys.ANY_FAULT, key):  # else two services could tell one another of it for ever
            where = f"{key} from {sample.source or 'a stranger'}"
            is_told = self.tell_refused(replace(error.fault, where=where), sender_of(sample))
        notice = unreadable(error, key, sample.payload, sample.encoding)
        return notice if notice is not None and (is_told or notice.id or notice.block) else None

    def _complain(self, fault: Fault) -> None:
        try:
            self.publish(keys.fault(self.name), fault)
        except Exception:
            self.log.exception("%s: the fault could not be told", self.name)

    def publish(self, key: str, message: Message, *, again: bool = False) -> None:
        """Send to all subscribers of `key`, this process' own included. It is no error if there are none.

        again: it was sent before, to one who may not have heard it; the log has its line.

        Raises InputRefused for a message that is larger than its key allows (schemas/access.py). One of a stream, of
        which any may be lost, is not sent then, and the first such of a participant is told in the log.
        """
        if not again:
            journal.note(self.log, key, message)
        try:
            self._send(key, message)
        except InputRefused as error:
            if keys.key_class(key) != "stream":
                raise
            if not self._is_told_unsent:
                self._is_told_unsent = True
                self.log.warning("%s: not sent: %s", self.name, error.fault)

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

    def subscribe(self, *patterns: str, keep: Keep = Keep.EVERY, capacity: int = 4096) -> Subscription:
        """Queue all messages of these key expressions. Past ones come first, as the class of each key says.

        A pattern of class `alive` delivers `PeerAlive` for all participants that are there, then every change. It is
        over at once if this participant has left the bus.
        """
        return self._attached(Subscription(patterns, keep, capacity, self._detached))

    def tap(self, *patterns: str, capacity: int = CAPACITY) -> Tap:
        """Queue all messages of these key expressions as they travel, undecoded; past ones as `subscribe` does.

        Messages that nobody can read are among them. capacity: bytes of the payloads that wait.
        """
        return self._attached(Tap(patterns, capacity, self._detached))

    def _attached(self, reader: Reader) -> Reader:
        if self._gone:
            reader.close()
        else:
            self._attach(reader)
            self._readers.append(reader)
        return reader

    def _detached(self, reader: Subscription | Tap) -> None:
        if reader in self._readers:
            self._readers.remove(reader)
            self._overflowed += reader.overflowed
            self._detach(reader)

    @abstractmethod
    def _attach(self, reader: Subscription | Tap) -> None:
        """Offer what is past to a reader, and what comes. Raises InputRefused: the keys do not allow its patterns."""

    @abstractmethod
    def _detach(self, reader: Subscription | Tap) -> None:
        """Offer a reader nothing any more."""

    @property
    def overflowed(self) -> int:
        """Number of messages that were dropped since a reader was too slow."""
        return self._overflowed + sum(reader.overflowed for reader in self._readers)

    async def query(self, key: str, message: Message, timeout: Seconds = 1.0) -> Message:
        """Ask the server of an `rpc` key. Raises NoReply (absent, late) or InputRefused (it answered a Fault).

        A process that stood still asks once more: the time is not the server's, and asking changes nothing.
        """
        for _ in range(2):
            deadline = self.now() + timeout
            if (told := await self._query(key, message, deadline)) is not None:
                return told
            if not self.sight.look(self.now(), deadline):
                break
        raise self.unanswered(key, timeout)

    @abstractmethod
    async def _query(self, key: str, message: Message, deadline: Seconds) -> Message | None:
        """Ask the server of an `rpc` key; None if nobody has answered by then. Raises InputRefused."""

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


MOST_ANSWERS = 1024
"""Answers of one participant that may be under way at once. Who asks more is refused: it is a flood."""


class Answering:
    """Answers of one participant, by key; one in steps is a task of its own. served: how it answers each key."""

    def __init__(self, bus: Bus) -> None:
        self.served: dict[str, Answer] = {}
        self.is_open = True
        self._bus = bus
        self._tasks: set[asyncio.Task[Message]] = set()

    def begin(self, answer: Coroutine[Any, Any, Message], key: str) -> "asyncio.Task[Message]":
        """Run an answer to a question on `key`, whoever still waits for it. Raises InputRefused if there are many."""
        if len(self._tasks) >= MOST_ANSWERS:
            answer.close()
            reason, advice = f"{MOST_ANSWERS} questions are being answered", "wait for answers before you ask more"
            raise InputRefused(Fault(reason=reason, where=key, advice=advice))
        task = asyncio.create_task(answer, name=f"answer on {key}")
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    @contextmanager
    def refusing(self, key: str) -> Iterator[None]:
        """Turn whatever goes wrong with a question on `key` into InputRefused, with the fault to answer."""
        try:
            yield
        except EngageError as error:
            raise InputRefused(error.fault) from error
        except (Exception, asyncio.CancelledError) as error:
            if is_asked_to_stop():
                raise
            raise InputRefused(self._bus.failed(error, f"a question on {key}")) from error

    async def ask(
        self, key: str, question: Message, deadline: Seconds, carried: Callable[[Message], Message]
    ) -> Message | None:
        """Ask this participant, from its own process. None: there is no answer by `deadline`, or it has left.

        carried: makes of an answer what its receiver gets. Raises InputRefused: it answered a fault.
        """
        with self.refusing(key):
            told = self.served[key](question)
            if not isinstance(told, Coroutine):
                return carried(told)
            task = self.begin(told, key)
            await asyncio.wait([task], timeout=max(deadline - self._bus.now(), 0.0))
            return carried(task.result()) if task.done() and self.is_open else None

    def _ended(self, task: "asyncio.Task[Message]") -> None:
        self._tasks.discard(task)
        if not task.cancelled():
            task.exception()  # told to whoever waits; nobody has to

    def end(self) -> None:
        """Answer nothing any more, and break off all answers: their server leaves."""
        self.is_open = False
        self.served.clear()
        for task in tuple(self._tasks):
            task.cancel()


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
    def join(self, name: str, role: str = "") -> Bus:
        """Add a participant; returns its view of the bus. Names are unique on a robot's bus.

        role: empty: that of the service of this name, or a manager's.
        """

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

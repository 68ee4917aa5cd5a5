"""The bus inside one process: same classes and guarantees as Zenoh, on the loop's clock."""

import asyncio
from collections import deque
from functools import partial
from itertools import count
from typing import NamedTuple

import msgspec

from engage_hri.schemas import keys
from engage_hri.schemas.blocks import PerformBlock
from engage_hri.schemas.faults import InputRefused
from engage_hri.schemas.fragments import PerformFragment
from engage_hri.schemas.messages import Message, decode, in_form, published
from engage_hri.schemas.participants import BusHealth, PeerAlive, PeerGone
from engage_hri.schemas.units import Seconds, Stamp
from engage_hri.services.bus import journal
from engage_hri.services.bus.interface import (
    Answer,
    Answering,
    Bus,
    Hub,
    Received,
    Sample,
    Subscription,
    Tap,
)
from engage_hri.services.bus.samples import LOCAL, read_payload
from engage_hri.services.bus.subscription import KEYS_KEPT, offer_presence


class Past(NamedTuple):
    """A message that late subscribers still get. number: its place among all messages, states included."""

    number: int
    received: Received
    sample: Sample


DOCUMENTS = (PerformBlock, PerformFragment)
"""Messages that are decoded in any case: a client may send one document twice, and one that is performed is known as
the object that it is. They come once a block, and so cost nothing."""


class MemoryHub(Hub):
    """The hub of a bus in memory. Messages go through their encoding, so what works here works on a wire.

    What cannot be encoded is refused at its sender in any case.
    """

    def __init__(self, robot: str = "robot", *, decodes: bool = True) -> None:
        """decodes: False: receivers get the messages of our own services as they are, which saves time."""
        self.robot = robot
        self._decodes = decodes
        self._loop = asyncio.get_running_loop()
        self._buses: dict[str, MemoryBus] = {}
        self.sent = 0
        self._lives = 0
        self._state: dict[str, Past] = {}
        self._past: deque[Past] = deque(maxlen=4096)
        self._askers: list[asyncio.Future[None]] = []
        self._cut: set[str] = set()

    def join(self, name: str, role: str = "") -> "MemoryBus":
        if name in self._buses:
            raise ValueError(f"participant {name!r} is on the bus already")
        self._lives += 1
        self._buses[name] = bus = MemoryBus(self, name, role, run=str(self._lives))
        return bus

    async def wait_until_free(self, *names: str) -> None:
        """Return at once: here a participant that has died is gone, and `join` refuses a name that is taken."""

    async def close(self) -> None:
        for bus in list(self._buses.values()):
            await bus.leave()

    def partition(self, *names: str) -> None:
        """Cut these participants off from the others, until `heal`. Liveliness stays, as in a short cut."""
        self._cut = set(names)

    def heal(self) -> None:
        self._cut = set()
        self.wake_askers()

    def kill(self, name: str) -> None:
        """End a participant as SIGKILL would: its token goes, and messages from it and to it are lost."""
        if bus := self._buses.get(name):
            bus.vanish()

    # -- for MemoryBus ------------------------------------------------------------------------------------------

    def send(self, sender: str, key: str, message: Message) -> None:
        if isinstance(message, LOCAL):
            raise TypeError(f"{type(message).__name__} is never sent")
        payload, encoding = published(key, message)
        now, life = self._loop.time(), self._buses[sender].run
        sample = Sample(key, payload, encoding, sender, now, life=life, number=self.sent + 1, clock="loop", sent=now)
        if self._decodes or isinstance(message, DOCUMENTS):
            try:
                message = decode(payload, encoding)
            except InputRefused as error:  # as on a wire: the receivers refuse it, not the sender
                self._refuse(error, sample)
                return
        self._pass_on(sender, Received(key, message, sender, now, life=life, number=self.sent + 1), sample)

    def carried(self, key: str, message: Message) -> Message:
        """The question or answer as its receiver gets it. Raises what makes it impossible to send."""
        payload, _ = in_form(key, message, "msgpack")
        return decode(payload) if self._decodes else message

    def wants(self, key: str) -> bool:
        """Tell whether any participant has subscribed to `key`."""
        return any(reader.wants(key) for bus in self._buses.values() for reader in bus.readers)

    def inject(self, key: str, payload: bytes, encoding: str, life: str = "") -> None:
        """Send a payload from outside, as another program would. A bad one is answered with a Fault.

        life: of the connection that it comes by.
        """
        sample = Sample(key, payload, encoding, "", self._loop.time(), life=life)
        try:
            message = read_payload(payload, encoding, key, "")
        except InputRefused as error:
            self._refuse(error, sample)
        else:
            self._pass_on("", Received(key, message, "", self._loop.time(), life=life), sample)

    def _refuse(self, error: InputRefused, sample: Sample) -> None:
        key = sample.key
        self.sent += 1
        for bus in tuple(self._buses.values()):
            bus.deliver(sample, self.sent)
        for bus in [bus for bus in self._buses.values() if bus.wants(key)]:
            notice = bus.unreadable(error, sample)
            if notice is not None and bus.name == keys.server_of(key):
                self.sent += 1
                bus.deliver(Received(key, notice, "", self._loop.time(), life=sample.life), self.sent)

    def _pass_on(self, sender: str, received: Received, sample: Sample) -> None:
        self.sent += 1
        past = Past(self.sent, received, sample)
        kind = keys.key_class(received.key)
        if kind == "state":
            self._state[received.key] = past
        elif kind in ("cmd", "evt"):
            self._past.append(past)
        for bus in tuple(self._buses.values()):
            if not (self._cut and self._is_cut(sender, bus.name)):
                self._carry(past, sender, bus)

    def _carry(self, past: Past, sender: str, bus: "MemoryBus") -> None:
        bus.deliver(past.received, past.number)
        bus.deliver(past.sample, past.number)

    def _is_cut(self, one: str, other: str) -> bool:
        return (one in self._cut) != (other in self._cut)

    def replay(self, name: str, reader: Subscription | Tap) -> int:
        """Offer a late subscriber the participants, then the past in order; returns its last number."""
        now = self._loop.time()
        for bus in self._buses.values():
            if bus.is_alive:
                offer_presence(reader, bus.part, PeerAlive(participant=bus.name, run=bus.run), now)
        recent = [past for past in self._past if now - past.received.at <= keys.HISTORY_MAX_AGE]
        for past in sorted((*recent, *self._state.values()), key=lambda past: past.number):
            if not reader.wants(past.received.key) or self._is_cut(name, past.received.source):
                continue
            if isinstance(reader, Tap):
                reader.offer(msgspec.structs.replace(past.sample, at=now, past=True))
            else:
                reader.offer(msgspec.structs.replace(past.received, at=now, past=True))
        return self.sent

    @property
    def alive(self) -> tuple[str, ...]:
        return tuple(sorted(bus.name for bus in self._buses.values() if bus.is_alive))

    def announce(self, message: PeerAlive | PeerGone, part: keys.Part = "robot") -> None:
        journal.note_presence(message)
        for reader in [reader for bus in self._buses.values() for reader in bus.readers]:
            offer_presence(reader, part, message, self._loop.time())

    async def answerer(self, key: str, asker: str, deadline: Seconds) -> "MemoryBus | None":
        """Wait for a participant that serves the key; None at the deadline."""
        while self._loop.time() < deadline:
            for bus in self._buses.values():
                if key in bus.answers.served and not self._is_cut(asker, bus.name):
                    return bus
            change: asyncio.Future[None] = self._loop.create_future()
            self._askers.append(change)
            timer = self._loop.call_at(deadline, self.wake_askers)
            try:
                await change
            finally:
                timer.cancel()
        return None

    def wake_askers(self) -> None:
        """Let all questions look for their server again: there is a new one, a cut has healed, or it is too late."""
        for asker in self._askers:
            if not asker.done():
                asker.set_result(None)
        self._askers.clear()

    def withdraw(self, key: str) -> None:
        """Forget a state."""
        self._state.pop(key, None)

    def forget(self, name: str) -> None:
        """Forget a participant and its states, as if its process had ended; recent events are kept."""
        self._buses.pop(name, None)
        self._state = {key: past for key, past in self._state.items() if past.received.source != name}


class MemoryBus(Bus):
    """A participant's view of the bus in memory."""

    def __init__(self, hub: MemoryHub, name: str, role: str, run: str) -> None:
        super().__init__(hub.robot, name, role, "loop", run, count(1))
        self.is_alive = False
        self.answers = Answering(self)
        self._hub = hub
        self._replayed: dict[Subscription | Tap, int] = {}
        """Readers, and the number of the last message that was replayed to each."""
        self._wanting: dict[str, tuple[tuple[Subscription | Tap, int], ...]] = {}
        """Readers that want a key, of keys seen lately: most messages are for few participants."""

    @property
    def health(self) -> BusHealth:
        peers, passed = self._hub.alive, self._hub.sent
        return BusHealth(peers=peers, passed=passed, overflowed=self.overflowed, failures=self.failures)

    @property
    def readers(self) -> tuple[Subscription | Tap, ...]:
        """Readers of this participant."""
        return tuple(self._readers)

    def local(self, stamp: Stamp) -> Seconds:
        return stamp.seconds

    def error(self, clock: str) -> Seconds:
        return 0.0

    def _send(self, key: str, message: Message) -> None:
        if not self._gone:
            self._hub.send(self.name, key, message)

    def withdraw(self, *states: str) -> None:
        for key in states:
            self._hub.withdraw(key)

    def is_heard(self, key: str) -> bool:
        return self._hub.wants(key)

    def wants(self, key: str) -> bool:
        """Tell whether a subscription of this participant wants `key`: a tap takes what nobody can read, too."""
        return any(isinstance(reader, Subscription) and reader.wants(key) for reader in self._readers)

    def deliver(self, message: Received | Sample, number: int) -> None:
        """Offer a message to the subscriptions that want it, or a sample to such taps. number: its place of all."""
        try:
            wanting = self._wanting[message.key]
        except KeyError:
            wanting = self._look_up(message.key)
        for reader, replayed in wanting:
            # A message that was on its way when the reader was attached has been replayed to it.
            if number > replayed and isinstance(reader, Tap) is isinstance(message, Sample):
                reader.offer(message)  # type: ignore[arg-type]

    def _look_up(self, key: str) -> tuple[tuple[Subscription | Tap, int], ...]:
        wanting = tuple(each for each in self._replayed.items() if each[0].wants(key))
        if not keys.is_presence(key):  # each who comes and goes has a key, which is hardly ever asked for again
            if len(self._wanting) >= KEYS_KEPT:
                self._wanting.clear()
            self._wanting[key] = wanting
        return wanting

    def _attach(self, reader: Subscription | Tap) -> None:
        self._replayed[reader] = self._hub.replay(self.name, reader)
        self._wanting.clear()

    def _detach(self, reader: Subscription | Tap) -> None:
        self._replayed.pop(reader, None)
        self._wanting.clear()

    async def _query(self, key: str, message: Message, deadline: Seconds) -> Message | None:
        asked = self._hub.carried(key, message)
        await asyncio.sleep(0)
        while not self._gone and (server := await self._hub.answerer(key, self.name, deadline)) is not None:
            answer = await server.answers.ask(key, asked, deadline, partial(self._hub.carried, key))
            if answer is not None:
                return answer
        return None

    def answer(self, key: str, answer: Answer, *, empty: Message | None = None) -> None:
        self.answers.served[key] = answer
        self._hub.wake_askers()

    def declare_alive(self) -> None:
        if not self.is_alive and not self._gone:
            self.is_alive = True
            self._hub.announce(PeerAlive(participant=self.name, run=self.run), self.part)

    async def leave(self) -> None:
        for reader in self.readers:
            reader.close()
        self.vanish()

    def vanish(self) -> None:
        if self._gone:
            return
        self._gone = True
        self.answers.end()
        self._replayed.clear()
        self._wanting.clear()
        self._readers.clear()
        self._hub.forget(self.name)
        if self.is_alive:
            self.is_alive = False
            self._hub.announce(PeerGone(participant=self.name), self.part)

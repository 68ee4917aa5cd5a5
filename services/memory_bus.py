"""The bus inside one process: same classes and guarantees as Zenoh, on the loop's clock, with faults on demand."""

import asyncio
import random
from collections import deque
from typing import NamedTuple

from msgspec import Struct

from schemas import keys
from schemas.faults import EngageError, Fault, InputRefused, NoReply
from schemas.messages import Message, decode, encode
from schemas.presence import PeerAlive, PeerGone
from schemas.units import Probability, Seconds, Stamp
from services.bus import Answer, Bus, Hub, Keep, Received, Subscription


class Faults(Struct, frozen=True, kw_only=True):
    """What goes wrong with a message between different participants. delay: longest extra latency; order holds."""

    loss: Probability = 0.0
    duplicate: Probability = 0.0
    delay: Seconds = 0.0


class _Past(NamedTuple):
    received: Received
    at: Seconds


class MemoryHub(Hub):
    """seed: of the faults. Messages go through their encoding, so what works here works on a wire."""

    def __init__(self, robot: str = "robot", *, faults: Faults | None = None, seed: int = 0) -> None:
        self.robot = robot
        self.faults = faults or Faults()
        self._chance = random.Random(seed)
        self._loop = asyncio.get_running_loop()
        self._buses: dict[str, MemoryBus] = {}
        self._state: dict[str, Received] = {}
        self._past: deque[_Past] = deque(maxlen=4096)
        self._cut: set[str] = set()
        self._last_arrival: dict[tuple[str, str], Seconds] = {}

    def join(self, name: str) -> "MemoryBus":
        if name in self._buses:
            raise ValueError(f"participant {name!r} is on the bus already")
        self._buses[name] = bus = MemoryBus(self, name)
        return bus

    async def close(self) -> None:
        for bus in list(self._buses.values()):
            await bus.leave()

    def partition(self, *names: str) -> None:
        """Cut these participants off from the others, until `heal`. Liveliness stays, as in a short cut."""
        self._cut = set(names)

    def heal(self) -> None:
        self._cut = set()

    def kill(self, name: str) -> None:
        """End a participant as SIGKILL would: its token goes, nothing it sends or should get arrives any more."""
        if bus := self._buses.get(name):
            bus.vanish()

    # -- for MemoryBus ------------------------------------------------------------------------------------------

    def send(self, sender: "MemoryBus", key: str, message: Message) -> None:
        kind = keys.key_class(key)
        received = Received(key, decode(encode(message)), sender.name, self._loop.time())
        if kind == "state":
            self._state[key] = received
        elif kind in ("cmd", "evt"):
            self._past.append(_Past(received, received.at))
        for bus in list(self._buses.values()):
            self._carry(received, sender.name, bus)

    def _carry(self, received: Received, sender: str, bus: "MemoryBus") -> None:
        if bus.name == sender or self.faults == Faults():
            if not self._is_cut(sender, bus.name):
                bus.deliver(received)
            return
        if self._is_cut(sender, bus.name) or self._chance.random() < self.faults.loss:
            return
        copies = 2 if self._chance.random() < self.faults.duplicate else 1
        for _ in range(copies):
            arrival = self._loop.time() + self._chance.uniform(0.0, self.faults.delay)
            link = (sender, bus.name)
            self._last_arrival[link] = arrival = max(arrival, self._last_arrival.get(link, 0.0))
            self._loop.call_at(arrival, bus.deliver, received)

    def _is_cut(self, one: str, other: str) -> bool:
        return (one in self._cut) != (other in self._cut)

    def replay(self, subscription: Subscription) -> None:
        """What a late subscriber still gets."""
        now = self._loop.time()
        for past in self._past:
            if now - past.at <= keys.HISTORY_MAX_AGE and subscription.wants(past.received.key):
                subscription.offer(past.received)
        for received in self._state.values():
            if subscription.wants(received.key):
                subscription.offer(received)
        for bus in self._buses.values():
            if bus.is_alive and subscription.wants(key := keys.alive(bus.name)):
                subscription.offer(Received(key, PeerAlive(participant=bus.name), bus.name, now))

    def announce(self, name: str, message: PeerAlive | PeerGone) -> None:
        for bus in list(self._buses.values()):
            bus.deliver(Received(keys.alive(name), message, name, self._loop.time()))

    def answerer(self, key: str, asker: str) -> Answer | None:
        for bus in self._buses.values():
            if key in bus.answers and not self._is_cut(asker, bus.name):
                return bus.answers[key]
        return None

    def forget(self, name: str) -> None:
        self._buses.pop(name, None)


class MemoryBus(Bus):
    clock = "loop"

    def __init__(self, hub: MemoryHub, name: str) -> None:
        self.robot = hub.robot
        self.name = name
        self.is_alive = False
        self.answers: dict[str, Answer] = {}
        self._hub = hub
        self._loop = asyncio.get_running_loop()
        self._subscriptions: list[Subscription] = []
        self._gone = False

    def now(self) -> Seconds:
        return self._loop.time()

    def local(self, stamp: Stamp) -> Seconds:
        return stamp.seconds

    def publish(self, key: str, message: Message) -> None:
        if not self._gone:
            self._hub.send(self, key, message)

    def deliver(self, received: Received) -> None:
        for subscription in self._subscriptions:
            if subscription.wants(received.key):
                subscription.offer(received)

    def subscribe(self, *patterns: str, keep: Keep = Keep.EVERY, capacity: int = 4096) -> Subscription:
        subscription = Subscription(patterns, keep, capacity, self._drop)
        self._subscriptions.append(subscription)
        self._hub.replay(subscription)
        return subscription

    def _drop(self, subscription: Subscription) -> None:
        if subscription in self._subscriptions:
            self._subscriptions.remove(subscription)

    async def query(self, key: str, message: Message, timeout: Seconds = 1.0) -> Message:
        await asyncio.sleep(0)
        answer = self._hub.answerer(key, self.name)
        if answer is None or self._gone:
            await asyncio.sleep(timeout)
            raise NoReply(Fault(reason=f"no reply within {timeout} s", where=key, advice="is its server running?"))
        try:
            return decode(encode(answer(decode(encode(message)))))
        except EngageError as error:
            raise InputRefused(error.fault) from error

    def answer(self, key: str, answer: Answer) -> None:
        self.answers[key] = answer

    def declare_alive(self) -> None:
        if not self.is_alive and not self._gone:
            self.is_alive = True
            self._hub.announce(self.name, PeerAlive(participant=self.name))

    async def leave(self) -> None:
        for subscription in list(self._subscriptions):
            subscription.close()
        self.vanish()

    def vanish(self) -> None:
        if self._gone:
            return
        self._gone = True
        self._subscriptions.clear()
        self._hub.forget(self.name)
        if self.is_alive:
            self.is_alive = False
            self._hub.announce(self.name, PeerGone(participant=self.name))

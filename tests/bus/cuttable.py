"""The memory bus with links that can be cut. After a cut it hands out what was missed, as the Zenoh bus does."""

import random
from itertools import combinations

from engage_hri.schemas import keys
from engage_hri.schemas.participants import PeerAlive, PeerGone
from engage_hri.schemas.units import Probability
from engage_hri.services.bus.interface import Received, Subscription
from engage_hri.services.bus.memory import MemoryBus, MemoryHub, Past


class CuttableHub(MemoryHub):
    """kept: number of commands and events that each participant hands out after a cut.

    tokens_first: whether presence is told before what was missed, or after it. loss: share of the events that are
    lost on the way, as those of a program that nobody can ask again.
    """

    def __init__(
        self, kept: int = 4096, *, tokens_first: bool = True, loss: Probability = 0.0, seed: int = 0
    ) -> None:
        super().__init__()
        self._kept = kept
        self._tokens_first = tokens_first
        self._loss = loss
        self._chance = random.Random(seed)
        self._apart: set[frozenset[str]] = set()
        self._missed: dict[tuple[str, str], list[Past]] = {}
        """What did not come through, by sender and receiver."""
        self._new: set[tuple[str, str]] = set()
        """Senders and receivers that have been apart since the receiver subscribed."""

    def cut(self, *names: str) -> None:
        """Cut all links between these participants; those that are not there yet, too."""
        for pair in map(frozenset, combinations(sorted(set(names)), 2)):
            if pair not in self._apart:
                self._apart.add(pair)
                for one, other in self._ways(pair):
                    if other.is_alive:
                        self._tell(one, PeerGone(participant=other.name), other.name, other.part)

    def join_up(self, *names: str) -> None:
        """Heal all links between these participants."""
        for pair in map(frozenset, combinations(sorted(set(names)), 2)):
            if pair in self._apart:
                self._apart.discard(pair)
                for one, other in self._ways(pair):
                    if not self._tokens_first:
                        self._hand_out(other, one)
                    if other.is_alive:
                        self._tell(one, PeerAlive(participant=other.name, run=other.run), other.name, other.part)
                    if self._tokens_first:
                        self._hand_out(other, one)

    def _ways(self, pair: frozenset[str]) -> list[tuple[MemoryBus, MemoryBus]]:
        one, other = (self._buses.get(name) for name in sorted(pair))
        return [] if one is None or other is None else [(one, other), (other, one)]

    def _tell(self, bus: MemoryBus, message: PeerAlive | PeerGone, name: str, part: keys.Part) -> None:
        bus.deliver(Received(keys.alive(name, part), message, name, self._loop.time()), self.sent + 1)

    def _hand_out(self, sender: MemoryBus, receiver: MemoryBus) -> None:
        way = (sender.name, receiver.name)
        missed = self._missed.pop(way, [])
        if way in self._new:
            self._new.discard(way)
            missed += [past for past in self._state.values() if past.received.source == sender.name]
        states = {past.received.key: past for past in missed if keys.key_class(past.received.key) == "state"}
        others = [past for past in missed if keys.key_class(past.received.key) in ("cmd", "evt")]
        for past in sorted((*states.values(), *others[len(others) - min(self._kept, len(others)) :])):
            receiver.deliver(past.received, self.sent + 1)  # also what is older than the receiver

    def _carry(self, past: Past, sender: str, bus: MemoryBus) -> None:
        if self._is_cut(sender, bus.name):
            self._missed.setdefault((sender, bus.name), []).append(past)
        elif keys.key_class(past.received.key) != "evt" or self._chance.random() >= self._loss:
            super()._carry(past, sender, bus)

    def _is_cut(self, one: str, other: str) -> bool:
        return frozenset((one, other)) in self._apart

    def announce(self, message: PeerAlive | PeerGone, part: keys.Part = "robot") -> None:
        name = message.participant
        for bus in list(self._buses.values()):
            if not self._is_cut(name, bus.name):
                self._tell(bus, message, name, part)

    def replay(self, name: str, subscription: Subscription) -> int:
        self._new |= {(other, name) for other in self._buses if self._is_cut(name, other)}
        there = [bus for bus in self._buses.values() if bus.is_alive and self._is_cut(name, bus.name)]
        for bus in there:
            bus.is_alive = False  # the one that subscribes cannot see it
        try:
            return super().replay(name, subscription)
        finally:
            for bus in there:
                bus.is_alive = True

    def forget(self, name: str) -> None:
        super().forget(name)
        self._missed = {way: missed for way, missed in self._missed.items() if name not in way}
        self._new = {way for way in self._new if name not in way}

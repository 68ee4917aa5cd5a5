"""The memory bus with faults on demand, drawn from a seed."""

import random

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Probability, Seconds
from engage_hri.services.bus.memory import MemoryBus, MemoryHub, Past


class Faults(Struct, frozen=True, kw_only=True):
    """What goes wrong with a message between different participants. delay: longest extra latency; order holds."""

    loss: Probability = 0.0
    duplicate: Probability = 0.0
    delay: Seconds = 0.0


class FaultyHub(MemoryHub):
    """seed: of the faults."""

    def __init__(self, faults: Faults, seed: int) -> None:
        super().__init__()
        self._faults = faults
        self._chance = random.Random(seed)
        self._last_arrival: dict[tuple[str, str], Seconds] = {}

    def _carry(self, past: Past, sender: str, bus: MemoryBus) -> None:
        """As well as the faults let it."""
        if bus.name == sender:
            bus.deliver(past.received, past.number)
            return
        if self._chance.random() < self._faults.loss:
            return
        copies = 2 if self._chance.random() < self._faults.duplicate else 1
        for _ in range(copies):
            arrival = self._loop.time() + self._chance.uniform(0.0, self._faults.delay)
            link = (sender, bus.name)
            self._last_arrival[link] = arrival = max(arrival, self._last_arrival.get(link, 0.0))
            self._loop.call_at(arrival, self._arrive, bus, past, arrival)

    def _arrive(self, bus: MemoryBus, past: Past, at: Seconds) -> None:
        bus.deliver(replace(past.received, at=at), past.number)

"""Ledgers of a service, read from its bus: its lives once more, and with a step that took something else."""

from collections.abc import Callable
from typing import Any

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.messages import decode, encode
from engage_hri.schemas.participants import Step, Taken
from engage_hri.services.bus.interface import Received
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.runtime.intake import Again, ServiceIntake, StepClock


class RecordedLives:
    """What a service took, and the messages that it took by their numbers; as they travel.

    lives: portions of the ledger of each life, by session.
    """

    def __init__(
        self, hub: MemoryHub, service: str, make: Callable[[StepClock, str], ServiceIntake], content: Any
    ) -> None:
        """make: an intake of the service, given its clocks and its session. content: type of what it takes."""
        self.lives: dict[str, list[Taken]] = {}
        self._service, self._make, self._content = service, make, content
        self._messages: dict[tuple[str, int], Received] = {}
        self._bus = hub.join("watcher", "observer")
        patterns = (f"{keys.PREFIX}/evt/**", f"{keys.PREFIX}/state/**")
        self._inbox = self._bus.subscribe(*patterns, capacity=10**6)

    async def read(self) -> None:
        """Read all that has come, and leave."""
        while (received := self._inbox.take()) is not None:
            if received.key == keys.taken(self._service):
                told = decode(encode(received.message))
                assert isinstance(told, Taken)
                self.lives.setdefault(told.session, []).append(told)
            self._messages[received.life, received.number] = received
        self._inbox.close()
        await self._bus.leave()

    def again(self, session: str, ledger: list[Taken] | None = None) -> Again:
        """The life of this session, done once more. ledger: in place of its own."""
        clock = StepClock(self.lives[session][0].at.clock)
        life = Again(self._make(clock, session), clock, self._content)
        for taken in ledger or self.lives[session]:
            life.take(taken, lambda life, number: self._messages.get((life, number)))
        return life


def changed_step(ledger: list[Taken], tag: str, **other: object) -> tuple[list[Taken], int]:
    """The ledger with another first step that took an input of this type and led to something, and its number."""

    def is_meant(step: Step) -> bool:
        return bool(step.content and step.content["type"] == tag and step.led_to)

    place = next(place for place, taken in enumerate(ledger) if any(map(is_meant, taken.steps)))
    steps = list(ledger[place].steps)
    number = next(number for number, step in enumerate(steps) if is_meant(step))
    steps[number] = replace(steps[number], content=steps[number].content | other)
    taken = replace(ledger[place], steps=tuple(steps))
    return [*ledger[:place], taken, *ledger[place + 1 :]], taken.first + number

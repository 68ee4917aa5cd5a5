"""A memory bus that notes who publishes, subscribes to, serves and asks what."""

from typing import NamedTuple

from engage_hri.schemas.access import PARTICIPANTS, Does
from engage_hri.schemas.messages import Message
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Answer, Keep, Subscription
from engage_hri.services.bus.memory import MemoryBus, MemoryHub


class Flow(NamedTuple):
    role: str
    name: str
    does: Does
    key: str


class SpyHub(MemoryHub):
    """roles: of participants that are no service. Those that are not named are the test's own and are not noted."""

    def __init__(self, flows: set[Flow], roles: dict[str, str], robot: str = "robot") -> None:
        super().__init__(robot)
        self.flows = flows
        self.roles = {**PARTICIPANTS, **roles}

    def join(self, name: str, role: str = "") -> MemoryBus:
        bus = super().join(name, self.roles.get(name, role))
        if (known := self.roles.get(name)) is None:
            return bus
        note, flows = Flow, self.flows
        send, subscribe, query, answer = bus._send, bus.subscribe, bus.query, bus.answer

        def sent(key: str, message: Message) -> None:
            flows.add(note(known, name, "publishes", key))
            send(key, message)

        def subscribed(*patterns: str, keep: Keep = Keep.EVERY, capacity: int = 4096) -> Subscription:
            flows.update(note(known, name, "subscribes", pattern) for pattern in patterns)
            return subscribe(*patterns, keep=keep, capacity=capacity)

        async def asked(key: str, message: Message, timeout: Seconds = 1.0) -> Message:
            flows.add(note(known, name, "asks", key))
            return await query(key, message, timeout)

        def served(key: str, answering: Answer, *, empty: Message | None = None) -> None:
            flows.add(note(known, name, "serves", key))
            answer(key, answering, empty=empty)

        bus._send, bus.subscribe, bus.query, bus.answer = sent, subscribed, asked, served  # type: ignore[method-assign]
        return bus

"""A realizer's end of the bus, by hand: requests out, and everything heard that control says."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

from engage_hri.schemas import keys
from engage_hri.schemas.body import BehaviorOutcome, PerformBehavior, RobotState, SyncPointReached
from engage_hri.schemas.messages import Message
from engage_hri.schemas.perception import ActionBegan, ActionEnded
from engage_hri.schemas.world import World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.service import embody
from engage_hri.services.control.testing import WORLD
from engage_hri.services.requests.ends import Pending, Requester
from engage_hri.services.runtime.service import running


class Client:
    """A realizer's end of the bus."""

    def __init__(self, bus: Bus, requests: Requester) -> None:
        self.bus = bus
        self.requests = requests
        self.heard: list[Message] = []

    def perform(
        self, behavior: object, through: str = "end", block: str = "block-1", *, held: bool = False
    ) -> Pending:
        id = f"{block}/{behavior.id}"  # type: ignore[attr-defined]
        request = PerformBehavior(
            id=id, requester=self.bus.name, block=block, behavior=behavior, through=through, held=held  # type: ignore[arg-type]
        )  # fmt: skip
        return self.requests.send(keys.BEHAVIOR, request)

    async def outcome(self, pending: Pending) -> BehaviorOutcome:
        outcome = await pending.outcome
        assert isinstance(outcome, BehaviorOutcome)
        return outcome

    def of(self, kind: type) -> list[Message]:
        return [message for message in self.heard if isinstance(message, kind)]

    def reached(self, behavior: str) -> dict[str, float]:
        return {item.sync: item.at.seconds for item in self.of(SyncPointReached) if item.behavior == behavior}  # type: ignore[attr-defined]

    def actions(self) -> list[tuple[str, str, tuple[str, ...], float]]:
        return [
            ("began" if isinstance(item, ActionBegan) else "ended", item.action, item.targets, item.at.seconds)
            for item in self.heard
            if isinstance(item, ActionBegan | ActionEnded)
        ]


@asynccontextmanager
async def robot(
    hub: MemoryHub,
    world: World = WORLD,
    hears: tuple[str, ...] = (keys.ROBOT_MOTION,),
    body: Body | None = None,
    **settings: object,
) -> AsyncIterator[Client]:
    """Control, and a client called realizer that hears everything it says; of its state on the keys `hears`.

    body: the simulated one unless given.
    """
    config = ControlConfig(**settings)  # type: ignore[arg-type]
    eyes, bus = hub.join("simulation"), hub.join("realizer")
    bus.declare_alive()
    eyes.publish(keys.WORLD, world)
    async with running(hub, {"control": partial(embody, config=config, body=body)}):
        inbox = bus.subscribe(keys.SYNC_POINT, keys.ROBOT_ACTION, *hears, keys.fault("control"), *Requester.PATTERNS)
        client = Client(bus, Requester(bus))

        async def listen() -> None:
            async for received in inbox:
                client.requests.feed(received)
                client.heard.append(received.message)

        listening = asyncio.create_task(listen())
        try:
            yield client
        finally:
            client.requests.close()
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)
            inbox.close()
    await bus.leave()
    await eyes.leave()


def tip(client: Client) -> tuple[float, float, float]:
    state = client.of(RobotState)[-1]
    assert isinstance(state, RobotState)
    assert state.right_arm.tip is not None
    return state.right_arm.tip

"""A whole robot around the generation service: real realizer, body, recognition; the test is manager and person."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from functools import partial

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Action, FragmentBehavior, Reference, Speech, SpeechOption
from engage_hri.schemas.blocks import BlockProgress, PerformBlock, SyncPointProgress, WarningFeedback
from engage_hri.schemas.fragments import FragmentOutcome, HeadOwner, PerformFragment, TurnClosed, TurnFragment
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound
from engage_hri.schemas.recognition import ConnectionEvent, SignalTurn
from engage_hri.schemas.world import World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig, Variability
from engage_hri.services.control.contract.body import Body
from engage_hri.services.control.service import embody
from engage_hri.services.generation.config import GenerationConfig
from engage_hri.services.generation.service import generate
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.service import recognize
from engage_hri.services.requests.ends import Pending, Requester
from engage_hri.services.runtime.service import Service, running
from tests.generation.emitted import lines
from tests.generation.partners import TABLE


class Robot:
    """Sends fragments and plays the person; keeps what the robot did, in seconds from the start of the stage."""

    def __init__(self, hub: MemoryHub) -> None:
        self.bus = hub.join("perception")
        self.manager = hub.join("manager")
        self.requests = Requester(self.manager)
        self.began = self.bus.now()
        self._told = asyncio.Event()
        self.reached: dict[str, float] = {}
        """`block:behavior:sync` -> when; `block:start` and `block:end`."""
        self.blocks: dict[str, PerformBlock] = {}
        self.sent: dict[str, float] = {}
        """When each block was."""
        self.events: list[ConnectionEvent] = []
        self.signals: list[SignalTurn] = []
        self.closed: list[tuple[float, TurnClosed]] = []
        self.outcomes: dict[str, tuple[float, FragmentOutcome]] = {}
        """By fragment, in the order in which they came."""
        self.warnings: list[WarningFeedback] = []
        self.owners: list[tuple[float, HeadOwner]] = []

    @property
    def now(self) -> float:
        return round(self.bus.now() - self.began, 6)

    async def listen(self) -> None:
        with self.bus.subscribe(f"{keys.PREFIX}/cmd/**", f"{keys.PREFIX}/evt/**", keys.HEAD_OWNER) as inbox:
            async for received in inbox:
                self.requests.feed(received)
                match received.message:
                    case SyncPointProgress(block=block, behavior=behavior, sync=sync, at=at):
                        self.reached[f"{block}:{behavior}:{sync}"] = round(self.bus.local(at) - self.began, 6)
                    case BlockProgress(block=block, progress=progress):
                        self.reached[f"{block}:{progress}"] = self.now
                    case PerformBlock(block=block) as request:
                        self.blocks[block.id] = request
                        self.sent.setdefault(block.id, self.now)
                    case ConnectionEvent() as event:
                        self.events.append(event)
                    case SignalTurn() as signal:
                        self.signals.append(signal)
                    case TurnClosed() as closed:
                        self.closed.append((self.now, closed))
                    case FragmentOutcome(fragment=fragment) as outcome:
                        self.outcomes[fragment] = (self.now, outcome)
                    case WarningFeedback() as warning:
                        self.warnings.append(warning)
                    case HeadOwner() as owner:
                        self.owners.append((self.now, owner))
                self._told.set()

    def send(self, fragment: TurnFragment) -> Pending:
        request = PerformFragment(id=f"ask-{fragment.id}", requester=self.manager.name, fragment=fragment)
        return self.requests.send(keys.FRAGMENT, request)

    def cancel(self, fragment: str) -> None:
        self.requests.cancel(f"ask-{fragment}", "changed my mind")

    def does(self, action: Action, *targets: str, actor: str = "human") -> None:
        began = ActionBegan(actor=actor, action=action, targets=targets, at=self.bus.stamp())
        self.bus.publish(keys.PERCEIVED_ACTION, began)

    def stops(self, action: Action, actor: str = "human") -> None:
        self.bus.publish(keys.PERCEIVED_ACTION, ActionEnded(actor=actor, action=action, at=self.bus.stamp()))

    async def until(self, point: str) -> float:
        """When the robot gets there."""
        while point not in self.reached:
            self._told.clear()
            await self._told.wait()
        return self.reached[point]

    def words(self) -> list[tuple[str, float, float]]:
        """Each utterance with its start and end, in the order in which they were begun."""
        started = {name.removesuffix(":start"): at for name, at in self.reached.items() if name.endswith(":start")}
        spoken = [
            (f"{id}:{behavior.id}", started[f"{id}:{behavior.id}"], self.reached.get(f"{id}:{behavior.id}:end", -1.0))
            for id, request in self.blocks.items()
            for behavior in request.block.behaviors
            if isinstance(behavior, Speech) and f"{id}:{behavior.id}" in started
        ]
        return sorted(spoken, key=lambda each: each[1])

    def constraints(self, block: str) -> list[str]:
        return lines(self.blocks[block].block)


@asynccontextmanager
async def robot(
    hub: MemoryHub,
    config: GenerationConfig | None = None,
    world: World = TABLE,
    body: Body | None = None,
) -> AsyncIterator[Robot]:
    stage = Robot(hub)
    stage.bus.publish(keys.WORLD, world)
    services: dict[str, Service] = {
        "control": partial(embody, config=ControlConfig(variability=Variability(seed=0, noise=0.0)), body=body),
        "realizer": partial(realize, config=RealizerConfig()),
        "recognition": partial(recognize, config=RecognitionConfig()),
        "generation": partial(generate, config=config or GenerationConfig()),
    }
    async with running(hub, services):
        listening = asyncio.create_task(stage.listen())
        stage.bus.declare_alive()
        stage.manager.declare_alive()
        for person in world.people:
            stage.bus.publish(keys.PERCEIVED_ACTION, ActorFound(actor=person.id, at=stage.bus.stamp()))
        await asyncio.sleep(2.0)  # the head goes to the face
        stage.began = stage.bus.now()
        try:
            yield stage
        finally:
            stage.requests.close()
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)


def says(
    id: str, status: str, text: str = "one two three", *more: FragmentBehavior, **fields: object
) -> TurnFragment:
    behaviors = (*((Speech(id="s", text=text),) if text else ()), *more)
    return TurnFragment(id=id, turn_status=status, behaviors=behaviors, **fields)  # type: ignore[arg-type]


def shows(id: str, status: str, target: str = "middle", *more: FragmentBehavior, **fields: object) -> TurnFragment:
    """It cannot be made but with a point, which is held until the person has looked, or failed to."""
    this = SpeechOption(text="this one here", cost=1, deictic=True)
    reference = Reference(id="ref", target=target, minimum_reliability=0.9, options=(this,))
    return TurnFragment(id=id, turn_status=status, behaviors=(*more, reference), **fields)  # type: ignore[arg-type]

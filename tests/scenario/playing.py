"""Play the whole system in virtual time and keep what happened."""

import asyncio
from collections.abc import Mapping
from functools import partial
from typing import Any

from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.fragments import FragmentOutcome
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.services.bus.interface import Bus, Received
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.control.config import ControlConfig, Variability
from engage_hri.services.control.service import embody
from engage_hri.services.generation.config import Condition, GenerationConfig
from engage_hri.services.generation.service import generate
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.service import recognize
from engage_hri.services.runtime.service import Ready, Service, running
from engage_hri.services.tangram.collaboration.config import CollaborationConfig
from engage_hri.services.tangram.collaboration.service import collaborate
from engage_hri.services.tangram.people.config import SimulationConfig
from engage_hri.services.tangram.people.service import simulate
from engage_hri.services.tangram.people.stochastic import Habits
from tests.bus.faulty import Faults, FaultyHub

LIMIT = 900.0
"""Seconds of virtual time: nothing in the scenario takes so long."""
LAST_ANSWER = 5.0
"""Seconds after the goodbye in which the last events end: an answer may come for 4 s, who has left is gone in 2."""


class Record:
    """Everything that was on the bus, in order."""

    def __init__(self, received: list[Received]) -> None:
        self.received = received

    def messages(self, kind: type) -> list[Any]:
        return [it.message for it in self.received if isinstance(it.message, kind)]

    @property
    def events(self) -> dict[str, list[ConnectionEvent]]:
        """The life of every connection event, by id, in the order of their starts."""
        lives: dict[str, list[ConnectionEvent]] = {}
        for event in self.messages(ConnectionEvent):
            life = lives.setdefault(event.id, [])
            if event not in life:  # a bus may deliver twice
                life.append(event)
        return dict(sorted(lives.items(), key=lambda it: it[1][0].started.seconds))

    def robot_initiated(self) -> list[ConnectionEvent]:
        """For each event that the robot's turns and references asked for, by request, the change that decided it.

        A request may have adopted an event of the person's: it names the block from the time of the request on.
        """
        asked = [
            [change for change in life if change.block and change.cause in ("turn", "reference", "human")]
            for life in self.events.values()
        ]
        asked = sorted(filter(None, asked), key=lambda life: life[0].at.seconds)
        return [life[min(1 if life[0].state == "started" else 0, len(life) - 1)] for life in asked]

    @property
    def outcomes(self) -> dict[str, FragmentOutcome]:
        return {it.fragment: it for it in self.messages(FragmentOutcome)}


async def play(
    human: str = "appendix-b",
    resolution: str = "table",
    seed: int = 0,
    faults: Faults | None = None,
    noise: float = 0.0,
    condition: Condition = "operational",
    habits: Habits | None = None,
    sensors: SimulationConfig | None = None,
    control: ControlConfig | None = None,
    people: Mapping[str, Service] | None = None,
    **manager: Any,
) -> Record:
    """Until the manager has said goodbye. faults: of the bus. noise: of the body. habits: of the stochastic person.
    sensors: how person and table are perceived; exactly, by default. control: in place of the torso with `noise`.
    people: services in the place of the simulated person. manager: its configuration. The robot does not look away:
    that of the transcript does not.
    """
    received: list[Received] = []
    finished = asyncio.Event()
    person = replace(sensors or SimulationConfig(), human=human, seed=seed)

    async def collaboration(bus: Bus, ready: Ready) -> None:
        await collaborate(bus, ready, CollaborationConfig(**manager))
        finished.set()

    services: dict[str, Service] = {
        "control": partial(embody, config=control or ControlConfig(variability=Variability(seed=seed, noise=noise))),
        "realizer": partial(realize, config=RealizerConfig()),
        "recognition": partial(recognize, config=RecognitionConfig(gaze_resolution=resolution)),  # type: ignore[arg-type]
        "generation": partial(generate, config=GenerationConfig(condition=condition, policies_off=("aversion",))),
        **(people or {"simulation": partial(simulate, config=person, habits=habits or Habits())}),
        "collaboration": collaboration,
    }
    async with MemoryHub() if faults is None else FaultyHub(faults, seed) as hub:
        with hub.join("record").subscribe(
            f"{keys.PREFIX}/cmd/**", f"{keys.PREFIX}/evt/**", f"{keys.PREFIX}/state/**", capacity=10**6
        ) as inbox:
            async with running(hub, services):
                async with asyncio.timeout(LIMIT):
                    await finished.wait()
                await asyncio.sleep(LAST_ANSWER)
            while len(inbox) and (it := await inbox.next()):
                received.append(it)
    return Record(received)

"""A person does not hear what a voice without sound says, whatever the robot believes that it has said."""

import asyncio
from functools import partial

import pytest

from engage_hri.schemas import keys
from engage_hri.schemas.behaviors import Speech
from engage_hri.schemas.body_faults import BodyFault
from engage_hri.schemas.perception import ActionBegan
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.robot import Robot
from engage_hri.services.control.config import ControlConfig
from engage_hri.services.control.service import embody
from engage_hri.services.realizer.config import RealizerConfig
from engage_hri.services.realizer.service import realize
from engage_hri.services.runtime.service import Service, running
from engage_hri.services.simulation.still import show_world, table_world
from engage_hri.services.tangram.people.config import SimulationConfig
from engage_hri.services.tangram.people.service import simulate

PEOPLE: dict[str, Service] = {
    "at the table": partial(simulate, config=SimulationConfig(human="attentive"), awaited=()),
    "who just sits": partial(show_world, world=table_world(), is_attentive=True),
}


@pytest.mark.parametrize("person", PEOPLE)
async def test_they_answer_what_they_hear_and_nothing_else(person: str) -> None:
    nods: list[str] = []

    async def follow(hub: MemoryHub) -> None:
        with hub.join("viewer").subscribe(keys.PERCEIVED_ACTION) as inbox:
            async for received in inbox:
                match received.message:
                    case ActionBegan(action="nod", actor=actor):
                        nods.append(actor)

    async with MemoryHub() as hub:
        services = {
            "simulation": PEOPLE[person],
            "control": partial(embody, config=ControlConfig()),
            "realizer": partial(realize, config=RealizerConfig()),
        }
        following = asyncio.create_task(follow(hub))
        async with running(hub, services), Robot.on(hub.join("alice")) as robot:
            await robot.person(20.0)
            await asyncio.sleep(5.0)
            told = []
            for number, faults in enumerate(([BodyFault(kind="mute")], [], [BodyFault(kind="lost", amount=0.0)])):
                await robot.switch_faults(faults)
                await robot.realize(f"b{number}", [Speech(id="s", text="Good morning to you")])
                await asyncio.sleep(3.0)
                told.append(len(nods))
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)

    assert told == [0, 1, 2]

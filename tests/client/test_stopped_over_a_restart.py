"""A "stop" stops the robot although recognition was killed between the voice and its words."""

import asyncio
from pathlib import Path

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound, Utterance
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call
from engage_hri.services.client.robot import connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

STORY = {"turn_status": "full", "parts": [{"say": "one two three four five six seven eight nine ten " * 4}]}


async def says(eyes: Bus, words: str, known: float) -> None:
    """Have ann say this for 0.6 s. known: seconds from its beginning to its words."""
    began = eyes.stamp()
    eyes.publish(keys.PERCEIVED_ACTION, ActionBegan(actor="ann", action="speak", at=began))
    await asyncio.sleep(0.6)
    ended = eyes.stamp()
    eyes.publish(keys.PERCEIVED_ACTION, ActionEnded(actor="ann", action="speak", at=ended))
    await asyncio.sleep(known - 0.6)
    heard = Utterance(
        actor="ann", id=f"u{began.seconds}", text=words, began=began, ended=ended, at=eyes.stamp(), final=True
    )
    eyes.publish(keys.UTTERANCE, heard)


async def stopped(memory: str, down: float, known: float, words: str, *, talks: bool) -> Summary:
    """What came of a story into which ann says something. down: time for which recognition is away.

    talks: she has said something before, so that it is known that words are told.
    """
    config = load()
    config = replace(config, recognition=replace(config.recognition, memory=memory))
    services = {name: roster.service(name, config) for name in roster.ROBOT}
    recognition = {"recognition": services.pop("recognition")}
    async with MemoryHub(config.robot) as hub, running(hub, services), connect(hub=hub) as robot:
        eyes = hub.join("eyes")
        table = Entity(id="table", kind="surface", position=(0.6, 0.0, 0.72))
        async with running(hub, recognition):
            ann = Entity(id="ann", kind="person", position=(1.2, 0.5, 1.2))
            eyes.publish(keys.WORLD, World(entities=(table, ann), at=eyes.stamp()))
            eyes.publish(keys.PERCEIVED_ACTION, ActorFound(actor="ann", at=eyes.stamp()))
            await asyncio.sleep(1.0)
            if talks:
                await says(eyes, "good morning", 0.9)
            await asyncio.sleep(3.0)
            telling = asyncio.create_task(perform_call(robot, STORY, timeout=60))
            await asyncio.sleep(4.0)
            saying = asyncio.create_task(says(eyes, words, known))
            await asyncio.sleep(0.3)
            hub.kill("recognition")
        await asyncio.sleep(down)
        async with running(hub, recognition):
            await saying
            return await telling


def play(memory: str, down: float, known: float, words: str, *, talks: bool = True) -> Summary:
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(stopped(memory, down, known, words, talks=talks))


@pytest.mark.parametrize("talks", [True, False])
@pytest.mark.parametrize(("down", "known"), [(0.1, 0.7), (1.5, 0.7), (1.5, 2.0), (2.5, 1.0), (4.0, 0.7)])
def test_stop_stops_the_robot_although_recognition_is_away(
    tmp_path: Path, down: float, known: float, talks: bool
) -> None:
    """After 2 s the words are not in the history of the bus, so that the next life knows nothing of them."""
    told = play(str(tmp_path / "file"), down, known, "stop please", talks=talks)

    assert told.status == "interrupted"
    assert len(told.said.split()) < 40
    (said,) = told.interjections
    assert (said.who, said.reading, said.text, said.went_on) == ("ann", "interruption", "stop please", False)


@pytest.mark.parametrize("down", [1.5, 4.0])
def test_a_listeners_words_do_not(tmp_path: Path, down: float) -> None:
    told = play(str(tmp_path / "file"), down, 0.7, "uh-huh")

    assert (told.status, len(told.said.split())) == ("done", 40)

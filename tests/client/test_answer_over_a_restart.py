"""A question that is answered after a restart of recognition has its answer: `await_answer` returns it."""

import asyncio
from pathlib import Path

import pytest
from msgspec.structs import replace

from engage_hri.schemas import keys
from engage_hri.schemas.perception import ActionBegan, ActionEnded, ActorFound
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.world import Entity, World
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import perform_call
from engage_hri.services.client.robot import connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

QUESTION = {"turn_status": "full", "parts": [{"say": "Do you like tea?"}], "addressee": "ann"}


async def asked(memory: str, down: float, answers: float | None) -> tuple[Summary, float]:
    """What came of a question, and how long after it. down: time for which recognition is away.

    answers: time after the return of recognition at which ann speaks; None: she does not.
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
            asking = asyncio.create_task(perform_call(robot, QUESTION, await_answer=True, timeout=5))
            await asyncio.sleep(3.0)
            assert not asking.done()
            hub.kill("recognition")
        await asyncio.sleep(down)
        since = robot.now()
        async with running(hub, recognition):
            if answers is not None:
                await asyncio.sleep(answers)
                for kind in (ActionBegan, ActionEnded):
                    eyes.publish(keys.PERCEIVED_ACTION, kind(actor="ann", action="speak", at=eyes.stamp()))
                    await asyncio.sleep(1.0)
            return await asking, robot.now() - since


def play(memory: str, down: float, answers: float | None) -> tuple[Summary, float]:
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(asked(memory, down, answers))


@pytest.mark.parametrize("down", [0.1, 1.0, 1.8])
def test_an_answer_after_the_restart_is_the_answer(tmp_path: Path, down: float) -> None:
    told, _ = play(str(tmp_path / "file"), down, 1.5)

    assert (told.answer, told.answered_by, told.problems) == ("speak", "ann", ())


def test_a_question_that_nobody_answers_in_the_next_life_has_none(tmp_path: Path) -> None:
    told, _ = play(str(tmp_path / "file"), 1.0, None)

    assert told.answer == "none"


def test_without_a_file_the_answer_is_unknown_and_soon() -> None:
    told, after = play("", 1.0, None)

    assert told.answer is None
    assert after <= 1.5

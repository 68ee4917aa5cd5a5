"""A robot among people who talk with each other: it asks one after the other something, when nobody speaks, and then
all of them; it answers who asks it."""

import asyncio
from contextlib import suppress
from itertools import cycle
from typing import Literal

from msgspec.structs import replace

from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.fragments import EVERYBODY
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.robot import Robot
from engage_hri.services.tangram.collaboration.fragments import fragment

QUESTIONS = (
    "are you comfortable?", "do you like the blue square?", "which piece is yours?", "shall I show you something?",
    "did you see the white trapezoid?", "do you know each other?", "is it warm enough?", "was that fun?",
)  # fmt: skip
BETWEEN: Seconds = 12.0
"""Time from one question, and its answer, to the next."""
SILENCE: Seconds = 0.3
"""Time for which nobody has to speak before it asks."""
PATIENCE: Seconds = 8.0
"""Time after which it asks in any gap, however short."""


async def host(robot: Robot) -> None:
    """Ask the people who are there, one after the other and then all, and say goodbye."""
    await robot.person()
    names = {each.id: (each.name or each.id).title() for each in (await robot.world()).people}
    speaking = asyncio.Lock()  # who is asked answers before anybody else is spoken to
    answering = asyncio.create_task(_answer(robot, names, speaking))
    asked = cycle((names | {EVERYBODY: "Everybody"}).items())
    for number, (question, (who, name)) in enumerate(zip(QUESTIONS, asked, strict=False), start=1):
        await asyncio.sleep(BETWEEN)
        await _silence(robot)
        async with speaking:
            await _say(robot, f"question-{number}", who, f"{name}, {question}", turn_index=1)
    await _silence(robot)
    answering.cancel()
    await _say(robot, "goodbye", EVERYBODY, "It was nice to listen to you. Goodbye.", turn_index=3)


async def _answer(robot: Robot, names: dict[str, str], speaking: asyncio.Lock) -> None:
    """Answer what people ask the robot."""
    answered = ""
    with robot.connection_events(kind="adjacency_pair") as pairs:
        async for pair in pairs:
            is_question = pair.initiator in names and pair.state == "started" and pair.words.endswith("?")
            if is_question and pair.id != answered:
                answered, name = pair.id, names[pair.initiator]
                async with speaking:
                    await _say(robot, f"answer-{pair.id}", pair.initiator, f"I do not know, {name}.", turn_index=2)


async def _silence(robot: Robot) -> None:
    """Wait until nobody speaks."""
    until = robot.now() + PATIENCE
    with robot.floor() as floor:
        told = await floor.next(SILENCE)
        while told is not None:
            told = await floor.next(None if told.speeches else SILENCE if robot.now() < until else 0.0)


async def _say(robot: Robot, id: str, addressee: str, words: str, turn_index: Literal[1, 2, 3]) -> None:
    said = fragment(id, (words,), addressee=addressee, universe=(), look=addressee != EVERYBODY)
    with suppress(EngageError):  # those who wait are told of its outcome
        interruptible = False if turn_index == 3 else None  # nobody talks into a goodbye
        await robot.perform(
            replace(said, turn_index=turn_index), interruptible=interruptible, await_answer=turn_index == 1
        )

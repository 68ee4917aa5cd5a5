"""A robot among people who talk with each other: it asks one after the other something, when nobody speaks."""

import asyncio
from contextlib import suppress

from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.recognition import Floor
from engage_hri.schemas.units import Seconds
from engage_hri.services.client.feeds import Feed
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
"""Time after which it asks though somebody speaks."""


async def host(robot: Robot) -> None:
    """Ask the people who are there, one after the other, and say goodbye."""
    await robot.person()
    people = (await robot.world()).people
    for number, question in enumerate(QUESTIONS):
        await asyncio.sleep(BETWEEN)
        with robot.floor() as floor:
            await _silence(floor)
        person = people[number % len(people)]
        await _say(robot, f"question-{number + 1}", person.id, f"{(person.name or person.id).title()}, {question}")
    await _say(robot, "goodbye", people[0].id, "It was nice to listen to you. Goodbye.")


async def _silence(floor: Feed[Floor]) -> None:
    """Wait until nobody speaks, for as long as the robot has patience."""
    with suppress(TimeoutError):
        async with asyncio.timeout(PATIENCE):
            told = await floor.next(SILENCE)
            while told is not None:
                told = await floor.next(None if told.speeches else SILENCE)


async def _say(robot: Robot, id: str, person: str, words: str) -> None:
    with suppress(EngageError):  # those who wait are told of its outcome
        await robot.perform(fragment(id, (words,), addressee=person, universe=()), await_answer=True)

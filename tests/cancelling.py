"""Callers that change their mind at any moment: `python -m tests.cancelling --times 1000 [--endpoint tcp/HOST:PORT]`.

Without an endpoint a robot in this process on virtual time, else the one that runs there. Each time the next request
must come to its end.
"""

import argparse
import asyncio
import random
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from engage_hri.schemas.behaviors import Gaze, Speech, Wait
from engage_hri.schemas.fragments import TurnFragment
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.client.language_models import stream
from engage_hri.services.client.robot import Robot, connect
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import load
from engage_hri.services.runtime.service import running
from engage_hri.services.runtime.virtual_time import run_virtual

PATIENCE = 30.0
"""Seconds for one request, at the most."""
WAYS = ("perform", "realize", "stream", "timeout", "inhibit", "interrupt", "twice")


@asynccontextmanager
async def whole_robot(hub: MemoryHub | None = None, *settings: str) -> AsyncIterator[Robot]:
    """All services and a person who listens, on this bus or one of their own; a client of theirs."""
    if hub is None:
        async with MemoryHub() as hub, whole_robot(hub, *settings) as robot:
            yield robot
        return
    config = load(settings=["simulation.human=listening", *settings])
    services = {name: roster.service(name, config) for name in (*roster.ROBOT, "simulation")}
    async with running(hub, services), connect(hub=hub) as robot:
        await robot.person()
        yield robot


async def change_mind(robot: Robot, chance: random.Random, number: int) -> str:
    """Ask for something and cancel it at a random moment; which way."""
    way, moment = chance.choice(WAYS), chance.choice([0.0, 0.001, 0.01, chance.uniform(0.0, 1.5)])
    text = "one two three four five six seven"
    fragment = TurnFragment(id=f"f{number}", turn_status="full", behaviors=(Speech(id="s", text=text),))
    behaviors = (Gaze(id="g", target="human"), Speech(id="s", text=text))

    async def pieces() -> AsyncIterator[str]:
        for word in text.split():
            yield f"{word}. "
            await asyncio.sleep(0.02)

    async def hold() -> None:
        async with robot.inhibit_gaze(ttl=1.0):
            await asyncio.sleep(1.0)

    async def interrupt() -> None:
        asking = asyncio.create_task(robot.realize(f"b{number}", behaviors))
        try:
            await asyncio.sleep(0.05)
            await robot.interrupt(f"b{number}", "s")
        finally:
            asking.cancel()
            await asyncio.gather(asking, return_exceptions=True)

    work = {
        "perform": lambda: robot.perform(fragment, await_answer=chance.random() < 0.5),
        "realize": lambda: robot.realize(f"b{number}", behaviors),
        "stream": lambda: stream(robot, pieces(), id=f"t{number}"),
        "timeout": lambda: robot.perform(fragment, timeout=moment or 0.001),
        "inhibit": hold,
        "interrupt": interrupt,
        "twice": lambda: robot.perform(fragment),
    }[way]
    task = asyncio.ensure_future(work())
    await asyncio.sleep(moment)
    task.cancel()
    if way == "twice":
        await asyncio.sleep(0)
        task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    return way


async def change_mind_often(robot: Robot, times: int, seed: int = 0) -> None:
    """Raises TimeoutError when a request after a cancellation does not end."""
    chance = random.Random(seed)
    for number in range(times):
        way = await change_mind(robot, chance, number)
        try:
            async with asyncio.timeout(PATIENCE):
                outcome = await robot.realize(f"next{number}", [Wait(id="w", duration=0.01)])
                assert outcome.status == "done"
                if number % 5 == 0:
                    said = TurnFragment(id=f"hi{number}", turn_status="full", behaviors=(Speech(id="s", text="hi"),))
                    assert (await robot.perform(said)).status == "done"
        except Exception as error:
            error.add_note(f"after cancellation {number} of seed {seed}: {way}")
            raise


async def main(times: int, seed: int, endpoint: str, name: str) -> None:
    if endpoint:
        async with connect(name, connect=[endpoint]) as robot:
            await robot.person()
            await change_mind_often(robot, times, seed)
    else:
        async with whole_robot() as robot:
            await change_mind_often(robot, times, seed)
    print(f"{times} cancellations, seed {seed}: every next request came to its end")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--endpoint", default="")
    parser.add_argument("--robot", default="robot")
    options = parser.parse_args()
    work = main(options.times, options.seed, options.endpoint, options.robot)
    if options.endpoint:
        asyncio.run(work)
    else:
        run_virtual(work)

"""A language model hears what people say, and acts on it. A few rules stand in for the model.

    .venv/bin/python examples/listening_model.py --embedded [--virtual-time]  # with a person of our own
    .venv/bin/engage up --set simulation.human=none                           # or, beside it or with its ENDPOINT:
    .venv/bin/python examples/listening_model.py --type [ENDPOINT]            # you are the person: type your answers

The robot asks which piece to begin with. The model gets the person's words in the result of its own call of the tool,
`heard`, and who answered, `answered_by`. It waits six seconds for an answer, for a choice takes longer than a nod.
"""

import argparse
import asyncio
import sys
from collections.abc import AsyncIterator, Sequence
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager, suppress
from typing import Any

from engage_hri import PerceivedPerson, Robot, Summary, World, connect, embedded, perceive, perform_call
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

Call = dict[str, Any]
PERSON = "ann"
ANSWERS = ("Hm, let me see. I like the red square.", "No, the blue one.", "Yes!")
"""What the person of our own says, one after the other."""
LINES = 10


def call(*parts: dict[str, str], within: int = 6, **more: Any) -> Call:
    return {"turn_status": "full", "addressee": PERSON, "within": within, "parts": list(parts), **more}


def reply(results: Sequence[Summary], world: World) -> Call:
    """What a model might make of the results of its calls so far."""
    if not results:
        return call({"say": "Which piece shall we begin with?"}, within=10)
    words = " ".join(said.text for said in results[-1].heard if said.who == PERSON).lower()
    pointed = [each.object for result in results for each in result.references]
    if "yes" in words and pointed:
        return call({"say": "Then we take"}, {"refer": pointed[-1]}, {"say": "Thank you!"}, within=0, turn_index=3)
    meant = [each.id for each in world.objects if each.color in words and each.id not in pointed]
    if meant:
        return call({"say": "Do you mean"}, {"refer": meant[0], "certainty": "high"}, {"say": "?"})
    return call({"say": "I did not get that. Which color has it?"}, within=10)


async def converse(robot: Robot, at_most: int = LINES) -> list[Summary]:
    """Until the piece is found; the result of each call."""
    world = await robot.world()
    results: list[Summary] = []
    while len(results) < at_most and (not results or "Thank you!" not in results[-1].said):
        made = reply(results, world)
        print(f"model:  {made['parts']}")
        results.append(await perform_call(robot, made, await_answer=made.get("turn_index", 1) == 1))
        print(f"result: {results[-1].json}\n")
    return results


async def answer(robot: Robot, person: PerceivedPerson) -> None:
    """Answer, a second after the robot has looked up at the end of its turn."""
    await person.look_at(person.robot)
    answers, turn = iter(ANSWERS), ""
    with robot.connection_events(person.id, "mutual_facial_gaze") as contacts:
        async for contact in contacts:
            # Her own look at the robot may be the one that its turn asks for: then that event names the turn, too.
            if contact.turn not in ("", turn) and (words := next(answers, "")):
                turn = contact.turn
                await asyncio.sleep(1.0)
                await person.say(words)


async def typed(person: PerceivedPerson) -> None:
    """Say what somebody types, line by line, until the end of input."""
    lines = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
    while line := await lines.readline():
        if text := line.decode(errors="replace").strip():
            await person.type(text)


@asynccontextmanager
async def of_our_own() -> AsyncIterator[Robot]:
    """A robot, a table and a person of our own."""
    async with embedded(human="none") as robot, perceive(PERSON, hub=robot.hub) as person:
        answering = asyncio.create_task(answer(robot, person))
        yield robot
        answering.cancel()
        await asyncio.wait([answering])


@asynccontextmanager
async def joined(endpoints: Sequence[str], *, types: bool) -> AsyncIterator[Robot]:
    """A robot that is there already. types: the person is who sits at this terminal."""
    async with AsyncExitStack() as stack:
        robot = await stack.enter_async_context(connect(connect=endpoints))
        if types:
            person = await stack.enter_async_context(perceive(PERSON, connect=endpoints))
            typing = asyncio.create_task(typed(person))
            stack.callback(typing.cancel)
        yield robot


async def main(joining: AbstractAsyncContextManager[Robot]) -> None:
    async with joining as robot:
        await converse(robot)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="A stand-in for a language model that listens to people.")
    parser.add_argument("endpoint", nargs="*", help="of a running system, if it is not on this machine")
    parser.add_argument("--type", action="store_true", help="be the person: what you type is what she says")
    parser.add_argument("--embedded", action="store_true", help="with a simulated robot and person of our own")
    parser.add_argument("--virtual-time", action="store_true", help="without waiting (with --embedded)")
    options = parser.parse_args()
    if options.virtual_time and not options.embedded:
        parser.error("--virtual-time needs --embedded")
    with (
        suppress(KeyboardInterrupt),
        asyncio.Runner(loop_factory=VirtualTimeLoop if options.virtual_time else None) as runner,
    ):
        runner.run(main(of_our_own() if options.embedded else joined(options.endpoint, types=options.type)))

"""A language model speaks through the robot, and is told what became of it. A generator stands in for the model.

    .venv/bin/engage up --human listening                         # then, beside it or with its ENDPOINT anywhere:
    .venv/bin/python examples/stream_from_generator.py [ENDPOINT]
    .venv/bin/python examples/stream_from_generator.py --embedded [--virtual-time]  # or everything in this process

The words are spoken while the rest is still being written. `[red-square]` refers to an object; how it is called, and
whether the robot looks or points at it, is not the model's business. The simulated person does not notice a mere
look at a thing: the model reads that nobody looked, and refers to it with certainty.
"""

import argparse
import asyncio
import re
from collections.abc import AsyncIterator, Sequence
from contextlib import AbstractAsyncContextManager

from engage_hri import Robot, connect, embedded, stream
from engage_hri.schemas.summary import Summary, summary
from engage_hri.schemas.tool import ToolInput
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

GREETING = (
    "Hello! I could use your help with this puzzle, if you have a moment. First of all: do you see [red-square]?"
)
REQUEST = "Good. Please move [blue-square!] so that it is touching the top of [rectangle]."
GOODBYE = "Wonderful, thank you! Goodbye."
SECONDS_PER_WORD = 0.1
"""How fast it writes. The robot speaks more slowly."""


def reply(results: Sequence[Summary]) -> str:
    """What a model might make of the results of its turns so far."""
    if not results:
        return GREETING
    if results[-1].answer == "act":
        return GOODBYE
    missed = [each.object for each in results[-1].references if each.looked is False]
    if missed:
        return f"Sorry, that was not clear. I mean [{missed[0]}!]."
    return REQUEST


async def written(text: str) -> AsyncIterator[str]:
    """The text as a model gives it: in bits, while time passes."""
    for bit in re.findall(r"\s*\S+", text):
        await asyncio.sleep(SECONDS_PER_WORD)
        yield bit


async def converse(robot: Robot, at_most: int = 8) -> list[Summary]:
    """Until goodbye is said; the result of each turn."""
    await robot.person()
    results: list[Summary] = []
    while len(results) < at_most:
        text = reply(results)
        turn = ToolInput(turn_status="full", parts=(), expects="action" if text == REQUEST else "reply")
        print(f"model:  {text}")
        outcomes = await stream(robot, written(text), id=f"turn-{len(results)}", turn=turn, await_answer=True)
        results.append(summary(*outcomes))
        print(f"result: {results[-1].json}")
        print(f"        {results[-1].text}\n")
        if text == GOODBYE:
            break
    return results


async def main(joining: AbstractAsyncContextManager[Robot]) -> None:
    async with joining as robot:
        await converse(robot)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Stream a stand-in for a language model into an engaged robot.")
    parser.add_argument("endpoint", nargs="*", help="of a running system, if it is not on this machine")
    parser.add_argument("--embedded", action="store_true", help="with a simulated robot and person of our own")
    parser.add_argument("--virtual-time", action="store_true", help="without waiting (with --embedded)")
    options = parser.parse_args()
    if options.virtual_time and not options.embedded:
        parser.error("--virtual-time needs --embedded")
    with asyncio.Runner(loop_factory=VirtualTimeLoop if options.virtual_time else None) as runner:
        runner.run(main(embedded(human="listening") if options.embedded else connect(connect=options.endpoint)))

"""A collaboration manager: `.venv/bin/python examples/collaboration_manager.py [ENDPOINT] [--robot NAME]`.

Run it beside `.venv/bin/engage up` (before or after), or on another machine with the endpoint of one of its services.
It waits for the robot and for a person, says one thing, and tells how it went.
"""

import argparse
import asyncio

from engage_hri import Reference, Speech, SpeechOption, TurnFragment, connect

PUZZLE = TurnFragment(
    id="puzzle",
    behaviors=(
        Speech(id="speech-1", text="Hello! Do you see"),
        Reference(
            id="ref-1",
            target="trapezoid",
            minimum_reliability=0.85,
            options=(SpeechOption(text="the trapezoid", cost=2),),
        ),
    ),
)


async def main(name: str, endpoints: list[str]) -> None:
    async with connect(name, connect=endpoints) as robot:
        await robot.person()
        outcome = await robot.perform(PUZZLE)
        for choice in outcome.choices:
            print(f"{choice.target}: {choice.gesture}, {choice.phrase!r}, R = {choice.reliability:.2f}")
        for event in outcome.events:
            print(f"{event.kind}: {event.state}, delay {event.delay}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("endpoints", nargs="*", metavar="ENDPOINT")
    parser.add_argument("--robot", default="robot", metavar="NAME")
    options = parser.parse_args()
    asyncio.run(main(options.robot, options.endpoints))

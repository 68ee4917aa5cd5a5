"""A collaboration manager of one's own: `.venv/bin/python examples/collaboration_manager.py [ENDPOINT]`.

Run it beside `.venv/bin/engage up` (before or after), or on another machine with the endpoint of one of its services.
It waits for the robot and for a person, says one thing, and tells how it went.
"""

import asyncio
import sys

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


async def main(endpoints: list[str]) -> None:
    async with connect(connect=endpoints) as robot:
        await robot.person()
        outcome = await robot.perform(PUZZLE)
        for choice in outcome.choices:
            print(f"{choice.target}: {choice.gesture}, {choice.phrase!r}, R = {choice.reliability:.2f}")
        for event in outcome.events:
            print(f"{event.kind}: {event.state}, delay {event.delay}")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1:]))

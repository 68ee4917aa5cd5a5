"""A process that says numbers and writes down those of others: `python -m tests.rigs.deaf.speaker ENDPOINT NAME ALL`.

Each second it prints, as JSON, the number that it has said last and, of each other, the one that it has heard last.
"""

import asyncio
import json
import sys
from collections import Counter

from engage_hri.schemas import keys
from engage_hri.schemas.requests import Accepted
from engage_hri.services.bus.interface import Subscription
from engage_hri.services.bus.zenoh.hub import open_hub
from tests.bus.places import state

PAUSE = 0.01
"""Seconds between two numbers."""


async def speak(endpoint: str, name: str, others: list[str]) -> None:
    hub = await open_hub("robot", connect=[endpoint], mode="client")
    bus = hub.join(name)
    heard: dict[str, int] = dict.fromkeys(others, 0)
    wrong: Counter[str] = Counter()

    async def listen(other: str, inbox: Subscription) -> None:
        async for received in inbox:
            assert isinstance(received.message, Accepted)
            number = int(received.message.id)
            wrong[other] += number != heard[other] + 1 and heard[other] != 0
            heard[other] = number

    listening = [asyncio.create_task(listen(each, bus.subscribe(keys.request_state(each)))) for each in others]
    number = 0
    while True:
        for _ in range(100):
            number += 1
            bus.publish(keys.request_state(name), state(number))
            await asyncio.sleep(PAUSE)
        print(
            json.dumps({"said": number, "heard": heard, "wrong": wrong.total(), "refused": bus.health.refused}),
            flush=True,
        )
        assert not any(each.done() for each in listening)


if __name__ == "__main__":
    asyncio.run(speak(sys.argv[1], sys.argv[2], sys.argv[3].split(",")))

"""Somebody who asks services for their status, again and again: `python -m tests.lab.asker ENDPOINT SERVICE...`.

A line for each question: the service, and `answers`, or `is silent` if there is no answer in `PATIENCE`.
"""

import asyncio
import sys
from collections.abc import Sequence

from engage_hri.schemas import keys
from engage_hri.schemas.faults import NoReply
from engage_hri.schemas.participants import AskStatus
from engage_hri.services.bus.zenoh.hub import open_hub

PATIENCE = 2.5
"""Seconds: a router that hears nobody while it closes dead links did so for six and more."""
PAUSE = 0.25


async def main(endpoint: str, services: Sequence[str]) -> None:
    async with await open_hub("robot", connect=[endpoint]) as hub:
        bus = hub.join("asker")

        async def ask(service: str) -> None:
            while True:
                try:
                    await bus.query(keys.status(service), AskStatus(), PATIENCE)
                except NoReply:
                    print(service, "is silent", flush=True)
                else:
                    print(service, "answers", flush=True)
                await asyncio.sleep(PAUSE)

        await asyncio.gather(*map(ask, services))


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], sys.argv[2:]))

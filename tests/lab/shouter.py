"""Somebody who says much, so that links fill up: `python -m tests.lab.shouter ENDPOINT`. 20 times 40 kB a second."""

import asyncio
import sys

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault
from engage_hri.services.bus.zenoh.hub import open_hub


async def main(endpoint: str) -> None:
    async with await open_hub("robot", connect=[endpoint]) as hub:
        bus = hub.join("shouter")
        print("ready", flush=True)
        while True:
            bus.publish(keys.fault("shouter"), Fault(reason="x" * 40_000))
            await asyncio.sleep(0.05)


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))

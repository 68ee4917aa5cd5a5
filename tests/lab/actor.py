"""Somebody who looks when told to: `python -m tests.lab.actor NAME KEY ACTOR ENDPOINT`.

For each line on standard input, some seconds and the ids of what ACTOR looks at when they are over, it tells that on
the bus, and prints the instant, as its machine's clock has it.
"""

import asyncio
import sys

from engage_hri.schemas.perception import ActionBegan
from engage_hri.services.bus.zenoh.hub import open_hub


async def main(name: str, key: str, actor: str, endpoint: str) -> None:
    loop = asyncio.get_running_loop()
    reader = asyncio.StreamReader()
    await loop.connect_read_pipe(lambda: asyncio.StreamReaderProtocol(reader), sys.stdin)
    async with await open_hub("robot", connect=[endpoint]) as hub:
        bus = hub.join(name)
        bus.declare_alive()
        print("ready", flush=True)
        while line := await reader.readline():
            pause, *targets = line.decode().split()
            await asyncio.sleep(float(pause))
            at = bus.stamp()
            bus.publish(key, ActionBegan(actor=actor, action="look", at=at, targets=tuple(targets)))
            print(repr(at.seconds), flush=True)


if __name__ == "__main__":
    asyncio.run(main(*sys.argv[1:]))

"""Random messages into a robot of its own that `engage up` has started, over Zenoh: its bodies are simulated ones.

As a script: `python -m tests.hostile.live 2500`.
"""

import asyncio
import sys
import uuid
from collections import Counter
from random import Random
from typing import NamedTuple

import zenoh

from engage_hri.schemas import keys
from engage_hri.schemas.participants import AskStatus, Status
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.commandline.shell.roster import ROBOT
from tests.bus.places import free_endpoint
from tests.cli.command import start
from tests.rigs.hostile.payloads import Payloads
from tests.rigs.hostile.typed import RandomMessages, Words

ENTITIES = ("human", "rectangle", "blue-square")
AT_A_TIME = 25
"""Messages; then everybody is asked how they are, so that no more is sent than is taken."""
PATIENCE = 60.0


class Result(NamedTuple):
    """restarted: services that are not what they were before. failures: by service, from its status."""

    sent: int
    kinds: Counter[str]
    restarted: list[str]
    failures: dict[str, int]
    refused: int
    log: list[str]


async def attack_live(messages: int, seed: int = 0) -> Result:
    robot, endpoint = f"hostile-{uuid.uuid4().hex[:8]}", free_endpoint()
    process = await start("up", "--robot", robot, "--listen", endpoint)
    assert process.stdout is not None
    log: list[str] = []
    try:
        async with asyncio.timeout(PATIENCE):
            while "all services are up" not in (log[-1] if log else ""):
                line = await process.stdout.readline()
                assert line, "\n".join(log)
                log.append(line.decode(errors="replace").rstrip())
        reading = asyncio.create_task(_read(process.stdout, log))
        async with await open_hub(robot, connect=[endpoint]) as hub:
            bus = hub.join(f"witness-{uuid.uuid4().hex[:8]}", role="observer")
            before = {name: await _status(bus, name) for name in ROBOT}
            sent, kinds = await _send(bus, robot, endpoint, messages, seed)
            after = {name: await _status(bus, name) for name in ROBOT}
            await bus.leave()
    finally:
        process.terminate()
        await process.wait()
    await reading
    restarted = [name for name in ROBOT if before[name].run != after[name].run]
    failures = {name: status.bus.failures for name, status in after.items() if status.bus.failures}
    return Result(sent, kinds, restarted, failures, sum(status.bus.refused for status in after.values()), log)


async def _read(stream: asyncio.StreamReader, log: list[str]) -> None:
    async for line in stream:
        log.append(line.decode(errors="replace").rstrip())


async def _status(bus: Bus, name: str) -> Status:
    status = await bus.query(keys.status(name), AskStatus(), timeout=PATIENCE)
    assert isinstance(status, Status)
    return status


async def _send(bus: Bus, robot: str, endpoint: str, messages: int, seed: int) -> tuple[int, Counter[str]]:
    """From a plain Zenoh session, as another program would."""
    words, kinds, sent = Words(), Counter[str](), 0
    payloads = Payloads(Random(seed), RandomMessages(Random(seed + 1), words), ENTITIES)
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    with zenoh.open(config) as session, bus.subscribe(keys.EVERYTHING) as inbox:
        while sent < messages:
            payload = payloads.next(bus.now())
            try:
                session.put(f"{robot}/{payload.key}", payload.data, encoding=payload.encoding)
            except zenoh.ZError:  # what is no key of Zenoh goes nowhere
                continue
            sent += 1
            kinds[payload.kind] += 1
            if sent % AT_A_TIME == 0:
                for name in ROBOT:
                    await _status(bus, name)
                while len(inbox):
                    received = await inbox.next()
                    words.hear(received.message if received is not None else None)
    return sent, kinds


def main() -> None:
    result = asyncio.run(attack_live(int(sys.argv[1]) if len(sys.argv) > 1 else 2500))
    print(f"{result.sent} messages of {len(result.kinds)} kinds, {result.refused} refused by those who got them")
    print(f"restarted: {result.restarted or 'nobody'}; failures: {result.failures or 'none'}")
    print("\n".join(line for line in result.log if "again" in line or "Traceback" in line or "Error" in line))


if __name__ == "__main__":
    main()

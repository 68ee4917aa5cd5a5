"""A robot whose processes are started as units start them, one of which is killed at random instants.

A manager has blocks performed all the time, each with words of its own; a watcher of its own notes which words the
body has begun. The judge knows only these two lists and the kills:

- hung: a block without an end long after everything is there again;
- lost: a block that is told as done, and some words of it were not begun;
- doubled: words that were begun twice.
"""

import asyncio
import random
import signal
from asyncio.subprocess import Process
from collections import Counter
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass, field

from engage_hri.schemas import keys
from engage_hri.schemas.body import SyncPointReached
from engage_hri.schemas.faults import EngageError
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Bus
from engage_hri.services.bus.zenoh.hub import open_hub
from engage_hri.services.client.robot import Robot
from engage_hri.services.commandline.shell.roster import ROBOT
from tests.bus.places import free_endpoint
from tests.cli.command import start

HUNG: Seconds = 60.0
"""Time after which a block counts as hung. The longest patience of a requester is 30 s."""
WORDS = ("s0", "s1", "s2")
BLOCK = """<bml id="{id}"><speech id="s0"><text>Well.</text></speech>
<speech id="s1" start="s0:end"><text>Well.</text></speech>
<speech id="s2" start="s1:end"><text>Well.</text></speech></bml>"""


@dataclass
class Verdict:
    """What became of the blocks. ends: number of blocks by how they ended."""

    kills: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    statuses: dict[str, str] = field(default_factory=dict)
    begun: Counter[tuple[str, str]] = field(default_factory=Counter)

    @property
    def mistakes(self) -> dict[str, list[str]]:
        done = [block for block, status in self.statuses.items() if status == "done"]
        found = {
            "hung": [block for block, status in self.statuses.items() if status == "hung"],
            "lost": [f"{block}:{each}" for block in done for each in WORDS if not self.begun[block, each]],
            "doubled": [f"{block}:{each}" for (block, each), times in self.begun.items() if times > 1],
        }
        return {kind: which for kind, which in found.items() if which}

    @property
    def told(self) -> dict[str, object]:
        return {"kills": self.kills, "blocks": len(self.statuses), **self.ends, "mistakes": self.mistakes}


async def trial(together: str, kills: int, chance: random.Random) -> Verdict:
    """Kill the process of these services so often. Each time the next kill waits until it serves again."""
    endpoint, robot, verdict = free_endpoint(), "killed", Verdict()
    where = ("--robot", robot, "--connect", endpoint, "--mode", "client")
    others = ",".join(name for name in (*ROBOT, "simulation") if name not in together.split(","))
    router = await start("router", "--listen", endpoint)
    rest = await start("run", others, *where)
    try:
        async with (
            await open_hub(robot, connect=[endpoint], mode="client") as hub,
            await open_hub(robot, connect=[endpoint], mode="client") as own,
        ):
            watcher = hub.join("watcher")
            watching = asyncio.create_task(_watch(watcher, verdict))
            talking = asyncio.create_task(_talk(own.join("manager"), verdict))
            for _ in range(kills):
                async with _serving(watcher, together, *where) as victim:
                    await asyncio.sleep(chance.uniform(0.0, 3.0))
                    victim.send_signal(signal.SIGKILL)
                verdict.kills += 1
            async with _serving(watcher, together, *where):
                talking.cancel("enough")  # the last block is waited for
                await asyncio.wait([talking])
                talking.result()
            watching.cancel()
            await asyncio.wait([watching])
    finally:
        for process in (rest, router):
            process.terminate()
            await process.communicate()
    return verdict


@asynccontextmanager
async def _serving(watcher: Bus, names: str, *where: str) -> AsyncIterator[Process]:
    """Run the services in one process, from when all of them stand."""
    with watcher.subscribe(keys.ANY_ALIVE) as presence:
        process = await start("run", names, *where)
        try:
            assert process.stderr is not None
            missing = {f"{name} is ready" for name in names.split(",")}
            while missing and (line := await process.stderr.readline()):
                missing.discard(line.decode().strip())
            assert not missing, f"ended before {missing}"
            yield process
        finally:
            if process.returncode is None:
                process.send_signal(signal.SIGTERM)
            await process.communicate()
        presence.close()


async def _watch(bus: Bus, verdict: Verdict) -> None:
    with bus.subscribe(keys.SYNC_POINT) as points:
        async for received in points:
            point = received.message
            if isinstance(point, SyncPointReached) and point.sync == "start":
                verdict.begun[point.block, point.behavior] += 1


async def _talk(bus: Bus, verdict: Verdict) -> None:
    """Have one block after the other performed until cancelled; then come to the end of the last."""
    async with Robot.on(bus) as robot:
        number = 0
        while True:
            number += 1
            id = f"block-{number}"
            performing = asyncio.ensure_future(_end(robot, id))
            try:
                verdict.statuses[id] = await asyncio.shield(performing)
            except asyncio.CancelledError:
                verdict.statuses[id] = await performing
                return
            finally:
                verdict.ends[verdict.statuses[id]] += 1


async def _end(robot: Robot, id: str) -> str:
    try:
        async with asyncio.timeout(HUNG):
            return (await robot.realize(BLOCK.format(id=id))).status
    except TimeoutError:
        return "hung"
    except EngageError as error:
        return type(error).__name__

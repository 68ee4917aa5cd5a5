"""Whole runs in memory and virtual time, with a recorder on the bus."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from pathlib import Path
from types import MappingProxyType

from engage_hri.schemas import keys
from engage_hri.services.bus.interface import Received
from engage_hri.services.bus.memory import MemoryHub
from engage_hri.services.commandline.shell import roster
from engage_hri.services.commandline.shell.config import Config
from engage_hri.services.console.follow import Sink, following
from engage_hri.services.recording.service import Recorder, opened, record
from engage_hri.services.runtime.service import Service, running
from tests.recording.files import WALL


@asynccontextmanager
async def recording_to(path: Path, hub: MemoryHub, **facts: str) -> AsyncIterator[Recorder]:
    """Record into a file while the body of `async with` runs."""
    bus = hub.join("recorder", "observer")
    recorder, file, tap = opened(bus, path, WALL, (keys.EVERYTHING,), facts)
    task = asyncio.create_task(record(bus, tap, recorder, file), name="recorder")
    await asyncio.sleep(0)
    try:
        yield recorder
    finally:
        task.cancel()
        await asyncio.wait([task])
        recorder.close()
        await bus.leave()


async def tangram(
    path: Path, config: Config, *sinks: Sink, more: Mapping[str, Service] = MappingProxyType({})
) -> list[Received]:
    """The whole task, recorded. more: further participants. Returns what a subscription got of it."""
    live: list[Received] = []
    async with MemoryHub(config.robot) as hub:
        services = {name: roster.service(name, config) for name in roster.PLAY}
        services |= more
        inbox = hub.join("viewer").subscribe(keys.EVERYTHING, capacity=10**6)
        async with recording_to(path, hub), following(hub.join("console"), sinks), running(hub, services) as over:
            await over.wait()
            while len(inbox):
                received = await inbox.next()
                assert received is not None
                live.append(received)
        inbox.close()
    return live

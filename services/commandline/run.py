"""`engage run SERVICE`: one service as one process on the real bus."""

import asyncio
import sys
import uuid
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from msgspec import json

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.schemas.utf8 import is_utf8
from engage_hri.services.bus.interface import Hub
from engage_hri.services.commandline import roster
from engage_hri.services.commandline.config import Config, load
from engage_hri.services.commandline.process import DONE, run_until_signal
from engage_hri.services.runtime.service import serve


class Where(NamedTuple):
    """Which bus, and configured how. connect, listen: Zenoh endpoints; without any, this machine's own.

    settings: `section.key=value`, stronger than the file.
    """

    config: Path | None = None
    robot: str | None = None
    connect: tuple[str, ...] = ()
    listen: tuple[str, ...] = ()

    settings: tuple[str, ...] = ()

    def load(self, *, defaults: Iterable[str] = ()) -> Config:
        """The file's configuration with the command line's settings before it. Raises InputRefused."""
        if self.robot is not None and not is_utf8(self.robot):
            raise InputRefused(Fault(reason=f"robot {self.robot!r} is not UTF-8"))
        named = () if self.robot is None else (f"robot={json.encode(self.robot).decode()}",)
        return load(self.config, settings=(*self.settings, *named), defaults=defaults)

    async def open(self, robot: str) -> Hub:
        """The Zenoh hub. Raises EngageError when an endpoint is bad or taken."""
        from engage_hri.services.bus.zenoh.hub import open_hub

        return await open_hub(robot, connect=self.connect, listen=self.listen)


def unique(name: str) -> str:
    """A participant name that no other process on the bus has."""
    return f"{name}-{uuid.uuid4().hex[:8]}"


def is_ready(name: str) -> str:
    """What a service says on standard error when it serves. `engage up` waits for it."""
    return f"{name} is ready"


async def forever() -> None:
    """Until cancelled."""
    await asyncio.get_running_loop().create_future()


def main(name: str, where: Where, attended: bool) -> int:
    """Serve until a signal. attended: also until standard input closes, which is how a child sees its parent die."""
    config = where.load()
    run_until_signal(_serve(name, where, config, attended))
    return DONE


async def _serve(name: str, where: Where, config: Config, attended: bool) -> None:
    service = roster.service(name, config)

    def stands() -> None:
        print(is_ready(name), file=sys.stderr, flush=True)

    async with await where.open(config.robot) as hub:
        serving = asyncio.create_task(serve(hub, name, service, stands), name=f"service {name}")
        waiting = {serving}
        if attended:
            waiting.add(asyncio.create_task(_until_closed(), name="parent"))
        try:
            await asyncio.wait(waiting, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in waiting:
                task.cancel()
            await asyncio.wait(waiting)
    if not serving.cancelled():
        serving.result()


async def _until_closed() -> None:
    """Return when whoever holds the other end of standard input is gone."""
    reader = asyncio.StreamReader()
    transport, _ = await asyncio.get_running_loop().connect_read_pipe(
        lambda: asyncio.StreamReaderProtocol(reader), sys.stdin
    )
    try:
        while await reader.read(1024):
            pass
    finally:
        transport.close()

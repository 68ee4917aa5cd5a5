"""A window beside a system that runs in this process: a child process shows it in the browser."""

import asyncio
import os
import socket
import sys
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from importlib.util import find_spec

from engage_hri.services.bus.interface import Hub
from engage_hri.services.commandline.supervisor import ended_in_order, spawned, without_threads

NEEDED = "nicegui"
"""Package without which there is no window."""


def can_open(terminal: bool) -> bool:
    """Tell whether somebody would see a window: there is a terminal and a display, and what it needs is installed."""
    shows = sys.platform in ("darwin", "win32") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    return terminal and shows and find_spec(NEEDED) is not None


@asynccontextmanager
async def windowed(robot: str, tell: Callable[[str], None]) -> AsyncIterator[Hub]:
    """A hub that the window of a child process follows, while the body of `async with` runs.

    tell: gets the address of the window, and what else the child says.
    """
    from engage_hri.services.bus.zenoh.hub import open_hub

    endpoint = f"tcp/127.0.0.1:{_free_port()}"
    # The child first: until it has loaded the web stack, the hub is there.
    with without_threads():
        async with (
            spawned(_end, *_command(robot, endpoint)) as process,
            await open_hub(robot, listen=(endpoint,), mode="peer") as hub,
        ):
            telling = asyncio.create_task(_pass_on(process, tell), name="window")
            try:
                yield hub
            finally:
                telling.cancel()
                await asyncio.wait([telling])


def _command(robot: str, endpoint: str) -> list[str]:
    return [
        sys.executable, "-P", "-m", "engage_hri", "console", "--attended", "--robot", robot, "--connect", endpoint,
        "--role", "wizard", "--port", "0", "--open",
    ]  # fmt: skip


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as free:
        port: int = free.getsockname()[1]
        return port


async def _pass_on(process: Process, tell: Callable[[str], None]) -> None:
    assert process.stdout is not None
    while line := await process.stdout.readline():
        tell(f"the window: {line.decode(errors='replace').rstrip()}")


async def _end(process: Process) -> None:
    await ended_in_order(process, _drained)


async def _drained(process: Process) -> None:
    assert process.stdout is not None
    while await process.stdout.read(2**16):
        pass

"""A window beside a system that runs in this process: a child process shows it in the browser."""

import asyncio
import errno
import os
import socket
import sys
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from importlib.util import find_spec
from typing import NamedTuple

from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.interface import Hub
from engage_hri.services.commandline.shell.options import Shown
from engage_hri.services.commandline.shell.supervisor import each_line, ended_in_order, spawned, without_threads
from engage_hri.services.runtime.installation import extra_command

NEEDED = ("starlette", "uvicorn", "nicegui")
"""Packages without which there is no window."""


def lacking() -> str:
    """A package that the window needs and that is not installed; empty: there is none."""
    return next((name for name in NEEDED if find_spec(name) is None), "")


def not_installed(package: str) -> Fault:
    """Fault of a package that the window needs and that is not installed."""
    return Fault(reason=f"{package} is not installed", where="console", advice=extra_command("console"))


def cannot_listen(error: OSError, host: str, port: int) -> Fault:
    """Fault of a window that cannot listen there."""
    is_taken = error.errno == errno.EADDRINUSE
    advice = (
        "is another window there? --port 0 takes any that is free"
        if is_taken
        else "--host takes an address of this machine"
    )
    reason = os.strerror(error.errno) if error.errno else str(error)
    return Fault(reason=reason, where=f"{host}:{port}", advice=advice)


def can_open(terminal: bool) -> bool:
    """Tell whether somebody would see a window: there is a terminal and a display, and what it needs is installed."""
    shows = sys.platform in ("darwin", "win32") or any(map(os.environ.get, ("DISPLAY", "WAYLAND_DISPLAY")))
    return terminal and shows and not lacking()


class Beside(NamedTuple):
    """The two sides of a window of this process. hub: the window follows it. ended: its exit code, at its end."""

    hub: Hub
    ended: "asyncio.Task[int]"


@asynccontextmanager
async def windowed(robot: str, shown: Shown, began: Seconds, tell: Callable[[str], None]) -> AsyncIterator[Beside]:
    """A hub that the window of a child process follows, while the body of `async with` runs.

    began: the instant from which the page counts its seconds. tell: gets the address of the window, and what else the
    child says.
    """
    from engage_hri.services.bus.zenoh.hub import open_hub

    try:
        _free_port(shown.host)  # else the child would be refused, with everything running
    except OSError as error:
        raise RunFailed(cannot_listen(error, shown.host, 0)) from error
    endpoint = f"tcp/127.0.0.1:{_free_port()}"
    # The child first: until it has loaded the web stack, the hub is there.
    with without_threads():
        async with (
            spawned(ended_in_order, *_command(robot, endpoint, shown, began)) as process,
            await open_hub(robot, listen=(endpoint,), mode="peer") as hub,
        ):
            telling = asyncio.create_task(_pass_on(process, tell), name="window")
            try:
                yield Beside(hub, telling)
            finally:
                telling.cancel()
                await asyncio.wait([telling])


def _command(robot: str, endpoint: str, shown: Shown, began: Seconds) -> list[str]:
    called = [part for name in shown.called or () for part in ("--called", name)]
    return [
        sys.executable, "-P", "-m", "engage_hri", "console", "--attended", "--robot", robot, "--connect", endpoint,
        "--role", "wizard", "--port", "0", "--host", shown.host, *called, "--open", "--began", repr(began),
    ]  # fmt: skip


def _free_port(host: str = "127.0.0.1") -> int:
    with socket.create_server((host, 0), family=socket.AF_INET6 if ":" in host else socket.AF_INET) as free:
        port: int = free.getsockname()[1]
        return port


async def _pass_on(process: Process, tell: Callable[[str], None]) -> int:
    """Tell what it says until it has ended. Returns its exit code."""
    assert process.stdout is not None
    await each_line(process.stdout, lambda line: tell(f"the window: {line.decode(errors='replace').rstrip()}"))
    return await process.wait()

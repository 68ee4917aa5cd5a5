"""Windows as processes of their own, for tests in real time."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from tests.bus.places import free_endpoint
from tests.console import browser

URL = rb"(http://[^\s]+)"
"""The address that a window prints."""


@contextmanager
def engage(told: Path, *arguments: str, **settings: str) -> Iterator["subprocess.Popen[bytes]"]:
    """`engage` as a process that writes what it says to a file."""
    with told.open("wb") as log:
        process = subprocess.Popen(
            (sys.executable, "-m", "engage_hri", *arguments), stdin=subprocess.DEVNULL, stdout=log, stderr=log,
            env={**os.environ, "PYTHONUNBUFFERED": "1", **settings},
        )  # fmt: skip
    try:
        yield process
    finally:
        process.terminate()
        process.wait(30)


class HeardPlace(NamedTuple):
    """A window, and a browser whose microphone hears a file. process: id of the window's. profile: the browser's."""

    endpoint: str
    url: str
    port: int
    process: int
    profile: Path


def hears(file: Path, *, once: bool = False) -> tuple[str, ...]:
    """Flags with which the microphone of a browser hears a file, again and again or once, and nobody is asked."""
    return (
        "--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream",
        f"--use-file-for-fake-audio-capture={file}{'%noloop' if once else ''}",
    )  # fmt: skip


@contextmanager
def heard_place(folder: Path, file: Path, *robot: str) -> Iterator[HeardPlace]:
    """A robot without people, its window, and a browser whose microphone hears `file`. robot: options of `up`."""
    endpoint = free_endpoint()
    (folder / "browser").mkdir()
    services = ("up", "--in-one", "--listen", endpoint, "--set", "simulation.human=none", *robot)
    window = ("console", "--connect", endpoint, "--port", "0", "--role", "wizard")
    with (
        engage(folder / "up", *services) as up,
        engage(folder / "console", *window) as console,
        browser.running(folder / "browser", *hears(file)) as port,
    ):
        browser.waited(up, folder / "up", rb"(all services are up)")
        url, profile = browser.waited(console, folder / "console", URL), folder / "browser" / "profile"
        yield HeardPlace(endpoint, url, port, console.pid, profile)

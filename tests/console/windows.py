"""Windows as processes of their own, for tests in real time."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
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
    """A window, and a browser that has devices. process: id of the window's. profile: the browser's."""

    endpoint: str
    url: str
    port: int
    process: int
    profile: Path


HAS_DEVICES = ("--use-fake-ui-for-media-stream", "--use-fake-device-for-media-stream")
"""Flags with which a browser has a microphone and a camera, and nobody is asked."""


def hears(file: Path, *, once: bool = False) -> tuple[str, ...]:
    """Flags with which the microphone of a browser hears a file, again and again or once."""
    return *HAS_DEVICES, f"--use-file-for-fake-audio-capture={file}{'%noloop' if once else ''}"


def sees(film: Path) -> tuple[str, ...]:
    """Flags with which the camera of a browser sees a film, again and again."""
    return *HAS_DEVICES, f"--use-file-for-fake-video-capture={film}"


@contextmanager
def place(folder: Path, flags: tuple[str, ...], *robot: str, **settings: str) -> Iterator[HeardPlace]:
    """A robot without people, its window, and a browser. flags: the browser's. robot: options of `up`."""
    endpoint = free_endpoint()
    (folder / "browser").mkdir()
    services = ("up", "--in-one", "--listen", endpoint, "--set", "simulation.human=none", *robot)
    window = ("console", "--connect", endpoint, "--port", "0", "--role", "wizard")
    with (
        engage(folder / "up", *services, **settings) as up,
        engage(folder / "console", *window, **settings) as console,
        browser.running(folder / "browser", *flags) as port,
    ):
        browser.waited(up, folder / "up", rb"(all services are up)")
        url, profile = browser.waited(console, folder / "console", URL), folder / "browser" / "profile"
        yield HeardPlace(endpoint, url, port, console.pid, profile)


def heard_place(folder: Path, file: Path, *robot: str) -> AbstractContextManager[HeardPlace]:
    """A robot without people, its window, and a browser whose microphone hears `file`. robot: options of `up`."""
    return place(folder, hears(file), *robot)

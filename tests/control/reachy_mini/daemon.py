"""The real daemon with its mock-up of the robot, as a process: without a screen, sound, telemetry, or a network.

It lives in an environment of its own: `make reachy-mini` makes one under build/, or REACHY_MINI_DAEMON names the
program of another one.
"""

import os
import shutil
import signal
import socket
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
BUILT = ROOT / "build" / "reachy-mini"
OPTIONS = (
    "--mockup-sim", "--headless", "--no-media", "--no-wake-up-on-start", "--no-goto-sleep-on-stop",
    "--dataset-update-interval", "0",
)  # fmt: skip
PATIENCE = 180.0
"""Seconds in which it answers; it takes 2 to 12, and 45 on a machine with ten times too much work."""


def program() -> str:
    """The daemon's program. Skips the test where there is none."""
    # `make reachy-mini` leaves .ready when it has started the daemon.
    built = str(BUILT / "bin" / "reachy-mini-daemon") if (BUILT / ".ready").exists() else ""
    found = os.environ.get("REACHY_MINI_DAEMON") or built
    if not found or shutil.which(found) is None:
        pytest.skip("no daemon of a Reachy Mini: `make reachy-mini`, or set REACHY_MINI_DAEMON to its program")
    return found


class Mockup:
    """A daemon that can be killed, frozen and started again at the same address."""

    def __init__(self, folder: Path) -> None:
        self._program = program()
        self._folder = folder
        self.port = _free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Start it, and wait until it answers."""
        self.begin()
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                urllib.request.urlopen(f"{self.url}/api/daemon/status", timeout=2.0).close()
                return
            except OSError:
                assert self._process is not None
                assert time.monotonic() < deadline, "the daemon does not answer"
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(0.1)
                raise AssertionError((self._folder / "daemon.log").read_text()[-2000:])

    def begin(self) -> None:
        """Start it, and do not wait."""
        quiet = {"HOME": str(self._folder), "REACHY_MINI_TELEMETRY": "0", "HF_HUB_OFFLINE": "1"}
        with (self._folder / "daemon.log").open("ab") as log:
            self._process = subprocess.Popen(
                [self._program, *OPTIONS, "--fastapi-port", str(self.port)], env={**os.environ, **quiet},
                cwd=self._folder, stdout=log, stderr=log,
            )  # fmt: skip

    def send(self, number: int) -> None:
        assert self._process is not None
        self._process.send_signal(number)

    def revive(self) -> None:
        """Let it go on if it is frozen, and start it if it is gone."""
        if self._process is not None and self._process.poll() is None:
            self.send(signal.SIGCONT)
        else:
            self.start()

    def stop(self) -> None:
        if self._process is not None:
            self._process.send_signal(signal.SIGCONT)
            self._process.kill()
            self._process.wait()
            self._process = None

    def ask(self, method: str, path: str) -> bytes:
        request = urllib.request.Request(f"{self.url}{path}", method=method)
        with urllib.request.urlopen(request, timeout=30.0) as answer:
            return bytes(answer.read())


@contextmanager
def running(folder: Path) -> Iterator[Mockup]:
    mockup = Mockup(folder)
    try:
        mockup.start()
        yield mockup
    finally:
        mockup.stop()


def _free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])

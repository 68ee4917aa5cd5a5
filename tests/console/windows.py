"""Windows as processes of their own, for tests in real time."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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

"""How a command becomes a process: which loop it runs on, how it is stopped, what its exit code says."""

import asyncio
import os
import signal
import sys
from collections.abc import Coroutine
from importlib import import_module
from typing import Any, TypeVar

from services.virtual_time import VirtualTimeLoop

T = TypeVar("T")
DONE, REFUSED, FAILED, INTERRUPTED = 0, 2, 3, 130
"""Exit codes: all done; input refused, nothing moved; failed while running; stopped by Ctrl-C or SIGTERM."""


def run(main: Coroutine[Any, Any, T], *, virtual_time: bool = False) -> T:
    """Run to the end, on uvloop where it is installed (it measured a fifth faster on Zenoh), or in virtual time.

    Ctrl-C and SIGTERM cancel `main`; when it has ended KeyboardInterrupt is raised. The second Ctrl-C doesn't wait.
    """
    # asyncio.Runner cancels `main` only if it finds this handler. A shell that starts us in the background has had
    # Ctrl-C ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGTERM, lambda number, frame: signal.raise_signal(signal.SIGINT))
    with asyncio.Runner(loop_factory=VirtualTimeLoop if virtual_time else _fastest_loop()) as runner:
        return runner.run(main)


def run_until_signal(main: Coroutine[Any, Any, None]) -> None:
    """Run what never ends by itself, or need not: Ctrl-C, SIGTERM and a reader who has had enough are good ends."""
    try:
        run(main)
    except* KeyboardInterrupt:
        pass
    except* BrokenPipeError:
        silence()


def silence() -> None:
    """Nobody reads on: Python's own flush of standard output at the end must not complain of it."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _fastest_loop() -> Any:
    try:
        return import_module("uvloop").new_event_loop
    except ImportError:
        return asyncio.SelectorEventLoop

"""How a command becomes a process: which loop it runs on, how it is stopped, what its exit code says."""

import asyncio
import os
import signal
import sys
import uuid
from collections.abc import Coroutine
from importlib import import_module
from typing import Any, TypeVar

from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

T = TypeVar("T")
DONE, REFUSED, FAILED, UNREAD = 0, 2, 3, 128 + signal.SIGPIPE
"""Exit codes: all done; input refused, nothing moved; failed while running; nobody reads the output any more."""
_stopping = [signal.SIGINT]
"""The signal that stops us, if one does, is the last of these."""


def run(main: Coroutine[Any, Any, T], *, virtual_time: bool = False) -> T:
    """Run to the end, on uvloop where it is installed (it measured a fifth faster on Zenoh), or in virtual time.

    Ctrl-C and SIGTERM cancel `main`; when it has ended KeyboardInterrupt is raised. The second Ctrl-C doesn't wait;
    a second SIGTERM says nothing new.
    """
    # asyncio.Runner cancels `main` only if it finds this handler. A shell that starts us in the background has had
    # Ctrl-C ignored.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    del _stopping[1:]
    signal.signal(signal.SIGTERM, _terminate)
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


def unique(name: str) -> str:
    """A participant name that no other process on the bus has."""
    return f"{name}-{uuid.uuid4().hex[:8]}"


async def forever() -> None:
    """Until cancelled."""
    await asyncio.get_running_loop().create_future()


def _terminate(number: int, frame: object) -> None:
    if _stopping[-1] != signal.SIGTERM:  # `timeout` sends it twice, to the process and to its group
        _stopping.append(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)


def interrupted() -> int:
    """The exit code after a KeyboardInterrupt: 130 after Ctrl-C, 143 after SIGTERM, as shells count."""
    return 128 + _stopping[-1]


def silence() -> None:
    """Nothing can be written any more: Python's own flush at its end must not complain of it."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None:
                stream.flush()
        except OSError:
            os.dup2(nowhere, stream.fileno())
    if sys.stdout is not None:
        os.dup2(nowhere, sys.stdout.fileno())


def _fastest_loop() -> Any:
    try:
        return import_module("uvloop").new_event_loop
    except ImportError:
        return asyncio.SelectorEventLoop

"""Process of a command: its event loop, the signals that stop it, its exit codes."""

import asyncio
import os
import signal
import sys
import time
import uuid
from collections.abc import Coroutine
from contextlib import suppress
from importlib import import_module
from types import FrameType
from typing import Any, TypeVar

from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell import forced_exit
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop

T = TypeVar("T")
DONE, REFUSED, FAILED, UNREADY, UNREAD = 0, 2, 3, 75, 128 + signal.SIGPIPE
"""Exit codes: all done; input refused, nothing moved; failed while running; refused as things stand now, so that the
same may be tried again (EX_TEMPFAIL of sysexits.h); reader of the output gone."""
SHOW_CURSOR = b"\x1b[?25h"
AT_ONCE: Seconds = 1.0
"""Time within which two SIGTERM are one: `timeout` tells a process and its group, systemd and `up` tell services."""
left: set[str] = set()
"""Names of our child processes that run."""
_terminated: Seconds | None = None
"""When SIGTERM came last, by time.monotonic."""
_stopping = [signal.SIGINT]
"""Signals received; the last one is the reason to stop."""


def run(main: Coroutine[Any, Any, T], *, virtual_time: bool = False) -> T:
    """Run to the end, on uvloop if it is installed (measured a fifth faster on Zenoh), or in virtual time.

    Ctrl-C and SIGTERM cancel `main`; when it has ended, KeyboardInterrupt is raised. A second one does not wait for
    that: it ends the process. The first SIGTERM after a Ctrl-C is none: `up` sends it to services that both reach.
    """
    # asyncio.Runner cancels `main` only if it finds Python's handler. A shell that starts us in the background has
    # had Ctrl-C ignored.
    end_like_ctrl_c()
    try:
        with asyncio.Runner(loop_factory=VirtualTimeLoop if virtual_time else _fastest_loop()) as runner:
            return runner.run(_interruptible(main))
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def end_like_ctrl_c() -> None:
    """Let a SIGTERM end what runs loops of its own as Ctrl-C does, with KeyboardInterrupt."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    global _terminated
    _terminated = None
    del _stopping[1:]
    signal.signal(signal.SIGTERM, _terminate)


async def _interruptible(main: Coroutine[Any, Any, T]) -> T:
    """Run `main`, so that a second Ctrl-C ends the process.

    The handler of asyncio.Runner raises KeyboardInterrupt then, wherever the program is. The error may be lost in a
    callback, or break off the end of a task that others wait for: then the process would never end.
    """
    cancel = signal.getsignal(signal.SIGINT)
    assert callable(cancel)

    def interrupt(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGINT, _leave)
        forced_exit.end_at_the_second(signal.SIGINT)  # what blocks from now on ends at the one after the next
        cancel(number, frame)

    signal.signal(signal.SIGINT, interrupt)
    forced_exit.end_at_the_second(signal.SIGINT)
    return await main


def _leave(number: int, frame: FrameType | None) -> None:
    """End the process at once, and show the cursor that a live view has hidden.

    Said is where, if that is in a driver's call that does not come back.
    """
    guarded = sys.modules.get("engage_hri.services.control.bases.driver_guard")
    if guarded is not None and sys.stderr is not None and (told := guarded.held_up(frame)):
        os.write(sys.stderr.fileno(), f"{told}\n".encode(errors="backslashreplace"))
    if left and sys.stderr is not None:
        told = f"not waited for: {', '.join(sorted(left))}; what does not end by itself is killed"
        os.write(sys.stderr.fileno(), f"{told}\n".encode(errors="backslashreplace"))
    if sys.stdout is not None and sys.stdout.isatty():
        os.write(sys.stdout.fileno(), SHOW_CURSOR)
    os._exit(interrupted())


def run_until_signal(main: Coroutine[Any, Any, int | None]) -> int:
    """Run until Ctrl-C, SIGTERM, or the loss of the output's reader, all of which are good ends.

    Returns the exit code: that of `main` if it ends with one by itself.
    """
    code: int | None = DONE
    try:
        code = run(main)
    except* KeyboardInterrupt:
        pass
    except* BrokenPipeError:
        silence()
    return DONE if code is None else code


def unique_name(name: str) -> str:
    """Make a participant name that no other process on the bus has."""
    return f"{name}-{uuid.uuid4().hex[:8]}"


async def forever() -> None:
    """Wait until cancelled."""
    await asyncio.get_running_loop().create_future()


async def until_closed() -> None:
    """Wait until the other end of standard input is closed."""
    while await typed():
        pass


async def typed() -> bytes:
    """Wait for standard input, and return the next of it; empty at its end.

    No loop can wait for a file or /dev/null (uvloop ends the process as it tries to), and they never let wait.
    """
    if sys.stdin is None:  # it was closed before we were started
        return b""
    loop, descriptor = asyncio.get_running_loop(), sys.stdin.fileno()
    ready = asyncio.Event()
    with suppress(PermissionError):
        loop.add_reader(descriptor, ready.set)
        try:
            await ready.wait()
        finally:
            loop.remove_reader(descriptor)
    return os.read(descriptor, 4096)


def _terminate(number: int, frame: FrameType | None) -> None:
    global _terminated
    before, _terminated = _terminated, time.monotonic()
    is_stopping = signal.getsignal(signal.SIGINT) is _leave
    if before is None and not is_stopping:
        _stopping.append(signal.SIGTERM)
        signal.raise_signal(signal.SIGINT)
    elif before is not None and _terminated - before > AT_ONCE:
        _leave(number, frame)


def interrupted() -> int:
    """Exit code after a KeyboardInterrupt: 130 after Ctrl-C, 143 after SIGTERM, as shells count."""
    return 128 + _stopping[-1]


def silence() -> None:
    """Send the output to nowhere, once it can't be written, so that Python's flush at the end does not complain."""
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

"""Process of a command: its event loop, the signals that stop it, its errors in words, its exit codes.

Ctrl-C has to end a command whatever it is in, and the body has to come home first. So the first signal cancels, and
what was begun is ended in order; a second one does not wait for that. A handler of Python's runs between two steps of
Python, to which a driver that blocks in C does not come back: there the system itself is told, before anything
blocks, what to do then. On other systems than Linux with glibc nothing is told, and only SIGKILL (or Ctrl-\\) ends
such a process.
"""

import asyncio
import ctypes
import errno
import os
import signal
import sys
import time
import uuid
from collections.abc import Coroutine, Sequence
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any, TypeVar

import typer

from engage_hri.schemas.faults import EngageError, Fault, InputRefused, NotReady, RunFailed
from engage_hri.schemas.units import Seconds
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
        end_at_the_second(signal.SIGINT)  # what blocks from now on ends at the one after the next
        cancel(number, frame)

    signal.signal(signal.SIGINT, interrupt)
    end_at_the_second(signal.SIGINT)
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


async def first_of(*work: Coroutine[Any, Any, T]) -> T:
    """Run several until the first is over, and end the others. Returns its result, or raises the error of any."""
    tasks = [asyncio.create_task(each) for each in work]
    try:
        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)
    results = [task.result() for task in tasks if not task.cancelled()]
    if not results:
        raise asyncio.CancelledError
    return results[0]


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


_PARENT_DIED = signal.SIGUSR2 if sys.platform == "linux" else 0
ORPHAN_PATIENCE: Seconds = float(_PARENT_DIED)
"""Time in which a process whose parent has died is to end by itself: the number of the signal that tells of it, for
the handler of that signal is the system's `alarm`, which takes a number of seconds."""
_PR_SET_PDEATHSIG = 1
_DEFAULT = 0


def end_at_the_second(number: signal.Signals) -> None:
    """Let the system end the process at a second signal, if Python has not taken up the first by then.

    number: of a signal that has a handler of Python's. Whoever handles it sets the handler anew.
    """
    with suppress(OSError, AttributeError, TypeError):
        library = _library()
        handler = library.signal(number, _DEFAULT)
        library.sysv_signal(number, handler)


def end_after_the_parent() -> None:
    """Let the system end the process `ORPHAN_PATIENCE` after its parent has died, if it has not ended by itself."""
    with suppress(OSError, AttributeError, TypeError):
        library = _library()
        library.signal(_PARENT_DIED, ctypes.cast(library.alarm, ctypes.c_void_p))
        library.prctl(_PR_SET_PDEATHSIG, _PARENT_DIED)


def _library() -> Any:
    """The library of C. Raises OSError, AttributeError or TypeError: it is another one."""
    if sys.platform != "linux":
        raise OSError
    library = ctypes.CDLL(None)
    for function in (library.signal, library.sysv_signal):
        function.restype, function.argtypes = ctypes.c_void_p, (ctypes.c_int, ctypes.c_void_p)
    return library


UsageError: type[Exception] = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "UsageError")
"""Class of Typer's errors of usage, which it does not export."""
TYPERS_OWN = 130
"""Exit code that Typer gives after a KeyboardInterrupt, by whatever signal."""
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def exit_code(app: typer.Typer, arguments: Sequence[str] | None) -> int:
    """Run a command and print its errors on standard error. An exception that is a bug of ours is raised."""
    try:
        code = _run(app, arguments)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        silence()  # the reader of our output (`| head`) has had enough
        code = UNREAD
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        silence()
        code = _ended([RunFailed(Fault(reason=f"cannot write the output: {error.strerror}"))])
    return code


def _run(app: typer.Typer, arguments: Sequence[str] | None) -> int:
    """Run a command to its exit code. Raises BrokenPipeError if the reader of the output is gone."""
    try:
        code = int(app(arguments, standalone_mode=False) or DONE)
        return interrupted() if code == TYPERS_OWN else code
    except SystemExit as exit:
        if isinstance(exit.__context__, BrokenPipeError):
            raise exit.__context__ from None  # Typer makes exit code 1 of it
        raise
    except UsageError as error:
        return _misused(error)
    except EngageError as error:
        return _ended([error])
    except BaseExceptionGroup as group:
        expected, bugs = group.split((EngageError, BrokenPipeError))
        if expected is None or bugs is not None:
            raise
        return _ended(_leaves(expected))
    except KeyboardInterrupt:
        return interrupted()


def _misused(error: Any) -> int:
    """Print an error of usage in one line. The message is empty if Typer has printed the help."""
    if message := error.format_message().replace("\n", " ").replace("Value error, ", ""):
        command = error.ctx.command_path if error.ctx else "engage"
        print(f"{command}: {message} (see {command} --help)", file=sys.stderr)
    return REFUSED


def readable(fault: Fault, source: Path | str = "") -> str:
    """Write a fault as `turn.xml:14: block-1: gaze-9: reason (advice)`.

    source: the file that it is about, if known.
    """
    file, rest = _split(fault.where, str(source))
    place = f"{file}:{fault.line}" if fault.line else file
    text = ": ".join(part for part in (place, rest, fault.reason) if part)
    text = f"{text} ({fault.advice})" if fault.advice else text
    return " ".join(text.split()).encode(errors="backslashreplace").decode()  # a file name need not be UTF-8


def _split(where: str, source: str) -> tuple[str, str]:
    """Split the place of a fault into the file and the rest; the line number goes between the two."""
    if source:
        return source, where.removeprefix(source).removeprefix(": ")
    file, _, rest = where.partition(": ")
    return file, rest


def _leaves(group: BaseExceptionGroup[Any]) -> list[BaseException]:
    found: list[BaseException] = []
    for error in group.exceptions:
        found += _leaves(error) if isinstance(error, BaseExceptionGroup) else [error]
    return found


def _ended(errors: Sequence[BaseException]) -> int:
    """Print the faults of expected errors. Returns the exit code; raises a BrokenPipeError that comes alone."""
    expected = [error for error in errors if isinstance(error, EngageError)]
    for error in expected:
        print(readable(error.fault), file=sys.stderr)
    if not expected:
        raise errors[0]
    if any(not isinstance(error, InputRefused) for error in expected):
        return FAILED
    return UNREADY if all(isinstance(error, NotReady) for error in expected) else REFUSED

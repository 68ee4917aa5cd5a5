"""End of a command: errors as one line on standard error, and the exit code."""

import errno
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from engage_hri.schemas.faults import EngageError, Fault, InputRefused, NotReady, RunFailed
from engage_hri.services.commandline.shell.process import DONE, FAILED, REFUSED, UNREAD, UNREADY, interrupted, silence

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

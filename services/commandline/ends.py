"""How a command ends: what went wrong in one line on standard error, and the exit code that says so."""

import errno
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer

from engage_hri.schemas.faults import EngageError, Fault, InputRefused, RunFailed
from engage_hri.services.commandline.process import DONE, FAILED, REFUSED, UNREAD, interrupted, silence

UsageError: type[Exception] = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "UsageError")
"""Typer carries its own copy of click and does not show this class."""


TYPERS_OWN = 130
"""What Typer makes of a KeyboardInterrupt, by whatever signal."""
NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


def exit_code(app: typer.Typer, arguments: Sequence[str] | None) -> int:
    """Run a command to its end, and tell on standard error what is wrong. Raises what is a bug of ours."""
    try:
        code = _run(app, arguments)
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        silence()  # whoever read our output (`| head`) has had enough
        code = UNREAD
    except OSError as error:
        if error.errno not in NO_ROOM:
            raise
        silence()
        code = _ended([RunFailed(Fault(reason=f"cannot write the output: {error.strerror}"))])
    return code


def _run(app: typer.Typer, arguments: Sequence[str] | None) -> int:
    """The exit code. Raises BrokenPipeError when nobody reads on, while it tells of something else, too."""
    try:
        code = int(app(arguments, standalone_mode=False) or DONE)
        return interrupted() if code == TYPERS_OWN else code
    except SystemExit as exit:
        if isinstance(exit.__context__, BrokenPipeError):
            raise exit.__context__ from None  # which Typer makes exit code 1
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
    """One line instead of Typer's box. Without any argument the help has been printed and there is nothing to add."""
    if message := error.format_message().replace("\n", " ").replace("Value error, ", ""):
        command = error.ctx.command_path if error.ctx else "engage"
        print(f"{command}: {message} (see {command} --help)", file=sys.stderr)
    return REFUSED


def readable(fault: Fault, source: Path | str = "") -> str:
    """`turn.xml:14: block-1: gaze-9: reason (advice)`. source: the file it is about, if known."""
    file, rest = _split(fault.where, str(source))
    place = f"{file}:{fault.line}" if fault.line else file
    text = ": ".join(part for part in (place, rest, fault.reason) if part)
    text = f"{text} ({fault.advice})" if fault.advice else text
    return " ".join(text.split()).encode(errors="backslashreplace").decode()  # a file name need not be UTF-8


def _split(where: str, source: str) -> tuple[str, str]:
    """The file and what stands behind it. The line number goes between the two."""
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
    """The exit code for what somebody else is to blame for, told if there is anything to tell."""
    told = [error for error in errors if isinstance(error, EngageError)]
    for error in told:
        print(readable(error.fault), file=sys.stderr)
    if not told:
        raise errors[0]
    return FAILED if any(not isinstance(error, InputRefused) for error in told) else REFUSED

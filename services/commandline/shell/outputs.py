"""Files of `--events`, `--feedback` and `--outcomes`: JSON lines. `-` is standard output."""

from collections.abc import Callable
from contextlib import ExitStack
from io import FileIO
from pathlib import Path
from typing import Any, Self

import msgspec
from rich.console import Console

from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress, WarningFeedback
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.messages import Message, line
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.units import Seconds
from engage_hri.services.commandline.shell.failing_output import (
    FORMAT,
    LOG,
    Patient,
    as_file,
    settle,
    standard_error,
    standard_output,
)

STDOUT = Path("-")


class Terminal(Console):
    """Rich's console, without its end of the process on a broken pipe.

    Text is printed as it is: ids like `b:x:start` are no emoji, and what stands in brackets is no style, as in
    `tcp/[fd00::1]:7447`.
    """

    def __init__(self, **settings: Any) -> None:
        super().__init__(emoji=False, markup=False, **settings)

    def on_broken_pipe(self) -> None:
        raise  # the BrokenPipeError, for services/commandline/shell/process.py


class Outputs:
    """Sink that writes the public messages. A bad path is refused before anything starts.

    A disk that is full ends nothing: the end of `with` raises RunFailed with the number of lines that are lost.
    """

    def __init__(self, events: Path | None, feedback: Path | None, outcomes: Path | None = None) -> None:
        self._paths = (events, feedback, outcomes)
        self.wanted: Callable[[Message], bool] = lambda message: True
        """Filter: True for the messages to write."""
        self._files = ExitStack()
        self._events: Patient | None = None
        self._feedback: Patient | None = None
        self._outcomes: Patient | None = None
        self._patients: list[Patient] = []

    def console(self, *, quiet: bool) -> Console:
        """Console for all other output: standard error if lines go to standard output."""
        stream = standard_error() if STDOUT in self._paths else standard_output()
        self._patients.append(stream)
        return Terminal(file=as_file(stream), quiet=quiet)

    def __enter__(self) -> Self:
        events, feedback, outcomes = self._paths
        files = {path: self._open(path) for path in dict.fromkeys(self._paths)}
        self._events, self._feedback, self._outcomes = files[events], files[feedback], files[outcomes]
        self._patients += [file for file in files.values() if file is not None]
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        try:
            with self._files:
                settle(*self._patients)
        except (OSError, RunFailed, ExceptionGroup):
            if error is None:  # otherwise it is the same trouble once more
                raise

    def _open(self, path: Path | None) -> Patient | None:
        if path is None:
            return None
        if path == STDOUT:
            return standard_output(FORMAT)
        try:
            # Unbuffered, so that a reader that follows the file sees each line at once.
            file = self._files.enter_context(FileIO(path, "w"))
        except OSError as error:
            raise InputRefused(Fault(reason=f"cannot write: {error.strerror}", where=str(path))) from error
        return Patient(str(path), file.write, LOG.warning)

    def __call__(self, message: Message, at: Seconds) -> None:
        match message:
            case ConnectionEvent():
                self._write(self._events, message)
            case BlockProgress() | SyncPointProgress() | WarningFeedback():
                self._write(self._feedback, message)

    def outcome(self, fragment: str, outcome: Summary) -> None:
        if self._outcomes is not None:
            line = {"fragment": fragment, **msgspec.to_builtins(outcome)}
            self._outcomes.write(msgspec.json.encode(line).decode() + "\n")

    def _write(self, file: Patient | None, message: Message) -> None:
        if file is not None and self.wanted(message):
            file.write(f"{line(message)}\n")

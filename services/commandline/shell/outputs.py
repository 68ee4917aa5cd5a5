"""Output of commands: what they print, and the files of JSON lines of `--events`, `--feedback` and `--outcomes`.

`-` is standard output. What must go on on a full disk does so: what finds no room there is counted, and told once.
"""

import logging
import os
import select
import sys
from collections.abc import Callable
from contextlib import ExitStack, suppress
from io import FileIO
from pathlib import Path
from typing import IO, Any, BinaryIO, Self, TextIO, cast

import msgspec
from rich.console import Console

from engage_hri.schemas.blocks import BlockProgress, SyncPointProgress, WarningFeedback
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed, raised_as
from engage_hri.schemas.messages import Message, line
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.units import Seconds

LOG = logging.getLogger("engage")
Put = Callable[[bytes], int | None]
"""Writer of as many bytes as there is room for; returns their number, None for none, or raises OSError."""


class Patient:
    """Text file that takes what there is room for, and drops the rest line by line.

    A line that is begun is finished before the next, so that none is torn. Once it tells that lines are lost, and
    how many when there is room again; `settle` tells the number of all. Only a reader that has gone
    (BrokenPipeError) is raised.
    """

    def __init__(
        self, name: str, put: Put, tell: Callable[[str], None], encoding: str = "utf-8", stream: TextIO | None = None
    ) -> None:
        """name: of the file, for people. stream: the one of Python for which this stands, which may be a terminal."""
        self.name = name
        self.encoding = encoding
        self.lost = 0
        """Number of lines that were dropped."""
        self._put = put
        self._tell = tell
        self._unwritten = b""
        self._stream = stream
        self._told = 0
        """What was told: 1: that lines are lost, 2: that they are written again."""
        self._reason = ""

    def write(self, text: str) -> int:
        """Write whole lines, or drop them. Returns the length of the text, as files do."""
        data = text.encode(self.encoding, errors="backslashreplace")
        self._unwritten = self._push(self._unwritten)
        left = data if self._unwritten else self._push(data)
        if len(left) == len(data) > 0:
            self.lost += data.count(b"\n") or 1
            if self._told == 0:
                self._told = 1
                self._tell(f"{self.name}: cannot write: {self._reason}; lines are lost until there is room")
        elif left:
            self._unwritten = left
        elif self._told == 1 and not self._unwritten:
            self._told = 2
            self._tell(f"{self.name} is written again; {_lines(self.lost)} lost")
        return len(text)

    def flush(self) -> None:
        """Nothing: all is written at once."""

    def isatty(self) -> bool:
        return self._stream is not None and self._stream.isatty()

    def settle(self) -> Fault | None:
        """Write what is left of the last line. Returns what to tell if anything was lost."""
        self._unwritten = self._push(self._unwritten)
        if self._unwritten:
            self.lost += 1
            self._unwritten = b""
        if not self.lost:
            return None
        return Fault(reason=f"{_lines(self.lost)} lost: cannot write: {self._reason}", where=self.name)

    def _push(self, data: bytes) -> bytes:
        """Write as much as there is room for. Returns what is left."""
        while data:
            try:
                written = self._put(data)
            except BrokenPipeError:
                raise
            except OSError as error:
                self._reason = error.strerror or str(error)
                return data
            if not written:
                self._reason = "nobody reads"
                return data
            data = data[written:]
        return data


def without_waiting(number: int, data: bytes) -> int | None:
    """Write to a file by its number if there is room, else nothing: one who stops reading must stop nobody."""
    try:
        has_room = bool(select.select([], [number], [], 0)[1])
    except (OSError, ValueError):  # Windows can ask sockets alone
        has_room = True
    return os.write(number, data[: getattr(select, "PIPE_BUF", 512)]) if has_room else None


FORMAT = "utf-8"
"""Encoding of a format, such as JSON and XML: its readers are programs, which know nothing of our terminal."""


def standard_output(encoding: str = "") -> Patient:
    """Standard output for lines as they come. encoding: `FORMAT` for lines of a format; empty: the terminal's."""
    return _standing_for("standard output", sys.stdout, encoding)


def standard_error() -> Patient:
    return _standing_for("standard error", sys.stderr)


def _standing_for(name: str, stream: TextIO | None, encoding: str = "") -> Patient:
    """File that writes where a stream of Python does. stream: None: a closed one; nothing is written, nor lost."""
    if stream is None:
        return Patient(name, len, LOG.warning)
    with suppress(OSError):
        stream.flush()
    return Patient(name, beneath(stream).write, LOG.warning, encoding or stream.encoding or "utf-8", stream)


def print_format(text: str) -> None:
    """Print a text of a format on standard output: as UTF-8, with line feeds, whatever the terminal's encoding is."""
    if sys.stdout is not None:
        sys.stdout.flush()
        sys.stdout.buffer.write(f"{text}\n".encode(FORMAT, errors="backslashreplace"))
        sys.stdout.buffer.flush()


def beneath(stream: TextIO) -> BinaryIO:
    """Find what a stream of Python writes to, without its buffer, which keeps what could not be written."""
    return cast(BinaryIO, getattr(stream.buffer, "raw", stream.buffer))


def as_file(patient: Patient) -> IO[str]:
    """Give it the type of a file, for Rich: it has what Rich uses."""
    return cast(IO[str], patient)


def settle(*patients: Patient) -> None:
    """End the writing. Raises RunFailed with what was lost, or a group of them."""
    errors = [RunFailed(fault) for each in patients if (fault := each.settle()) is not None]
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise ExceptionGroup("output is lost", errors)


def complain(line: str) -> None:
    """Print a line on standard error, if there is room. A reader that has gone is raised (BrokenPipeError)."""
    try:
        print(line, file=sys.stderr, flush=True)
    except BrokenPipeError:
        raise
    except OSError:
        pass


def _lines(count: int) -> str:
    return "1 line is" if count == 1 else f"{count} lines are"


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
        with raised_as(InputRefused, OSError, path, "cannot write"):
            # Unbuffered, so that a reader that follows the file sees each line at once.
            file = self._files.enter_context(FileIO(path, "w"))
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


class ResultFile:
    """File for a result. Raises InputRefused if it cannot be written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        folder, reason = path.parent, ""
        if path.is_dir():
            reason = "is a folder"
        elif not folder.is_dir():
            reason = f"there is no folder {folder}"
        elif not os.access(path if path.exists() else folder, os.W_OK):
            reason = "cannot be written"
        if reason:
            raise InputRefused(Fault(reason=reason, where=str(path)))

    def write(self, content: bytes) -> None:
        """Write the whole. Raises RunFailed."""
        with raised_as(RunFailed, OSError, self.path, "cannot write"):
            self.path.write_bytes(content)

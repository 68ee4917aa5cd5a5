"""Output of what must go on on a full disk, too: what finds no room there is counted, and told once."""

import logging
import os
import select
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import IO, BinaryIO, TextIO, cast

from engage_hri.schemas.faults import Fault, RunFailed
from engage_hri.services.bus.often import is_told

LOG = logging.getLogger("engage")
Put = Callable[[bytes], int | None]
"""Writer of as many bytes as there is room for; returns their number, None for none, or raises OSError."""


class Patient:
    """Text file that takes what there is room for, and drops the rest line by line.

    A line that is begun is finished before the next, so that none is torn. Told are the first interruption, the 10th,
    the 100th, and how each of these ended. Only a reader that has gone (BrokenPipeError) is raised.
    """

    def __init__(self, name: str, put: Put, tell: Callable[[str], None], encoding: str = "utf-8") -> None:
        """name: of the file, for people."""
        self.name = name
        self.encoding = encoding
        self.lost = 0
        """Number of lines that were dropped."""
        self._put = put
        self._tell = tell
        self._unwritten = b""
        self._lost_before = 0
        """Number of lines that were lost before the present interruption."""
        self._interruptions = 0
        self._interrupted = False
        self._reason = ""

    def write(self, text: str) -> int:
        """Write whole lines, or drop them. Returns the length of the text, as files do."""
        data, lost_before = text.encode(self.encoding, errors="backslashreplace"), self.lost
        self._unwritten = self._push(self._unwritten)
        left = data if self._unwritten else self._push(data)
        if len(left) == len(data) > 0:
            self.lost += data.count(b"\n") or 1
        elif left:
            self._unwritten = left
        self._note(bool(left or self._unwritten), lost_before)
        return len(text)

    def flush(self) -> None:
        """Nothing: all is written at once."""

    def isatty(self) -> bool:
        return False

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

    def _note(self, is_interrupted: bool, lost_before: int) -> None:
        if is_interrupted == self._interrupted:
            return
        self._interrupted = is_interrupted
        if is_interrupted:
            self._interruptions += 1
            self._lost_before = lost_before
        if is_told(self._interruptions):
            often = f" (for the {self._interruptions}th time)" if self._interruptions > 1 else ""
            if is_interrupted:
                self._tell(f"{self.name}: cannot write: {self._reason}{often}; lines are lost until there is room")
            else:
                self._tell(f"{self.name} is written again; {_lines(self.lost - self._lost_before)} lost")


class PatientStream(Patient):
    """Patient standard output or error: the stream that Python has there when this is made."""

    def __init__(self, name: str, stream: TextIO | None, encoding: str = "") -> None:
        """stream: None stands for one that is closed; nothing is written then, and nothing lost.

        encoding: empty: the stream's own.
        """
        self._stream = stream
        if stream is None:
            super().__init__(name, len, LOG.warning)
            return
        with suppress(OSError):
            stream.flush()
        super().__init__(name, beneath(stream).write, LOG.warning, encoding or stream.encoding or "utf-8")

    def isatty(self) -> bool:
        return self._stream is not None and self._stream.isatty()


def without_waiting(number: int, data: bytes) -> int | None:
    """Write to a file by its number if there is room, else nothing: one who stops reading must stop nobody."""
    try:
        has_room = bool(select.select([], [number], [], 0)[1])
    except (OSError, ValueError):  # Windows can ask sockets alone
        has_room = True
    return os.write(number, data[: getattr(select, "PIPE_BUF", 512)]) if has_room else None


FORMAT = "utf-8"
"""Encoding of a format, such as JSON: its readers are programs, which know nothing of our terminal."""


def standard_output(encoding: str = "") -> PatientStream:
    """Standard output for lines as they come. encoding: `FORMAT` for lines of a format; empty: the terminal's."""
    return PatientStream("standard output", sys.stdout, encoding)


def print_format(text: str) -> None:
    """Print a text of a format on standard output: as UTF-8, with line feeds, whatever the terminal's encoding is."""
    if sys.stdout is not None:
        sys.stdout.flush()
        sys.stdout.buffer.write(f"{text}\n".encode(FORMAT, errors="backslashreplace"))
        sys.stdout.buffer.flush()


def standard_error() -> PatientStream:
    return PatientStream("standard error", sys.stderr)


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

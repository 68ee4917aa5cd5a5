"""The JSON lines of `--events` and `--feedback`, as they come. `-` is standard output."""

import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self, TextIO

from schemas import lines
from schemas.faults import Fault, InputRefused
from schemas.feedback import BlockProgress, SyncPointProgress, WarningFeedback
from schemas.messages import Message
from schemas.recognition import ConnectionEvent
from schemas.units import Seconds

STDOUT = Path("-")


class Outputs:
    """A sink that writes public JSON lines. A bad path is refused before anything starts.

    wanted: which messages to write; all by default.
    """

    def __init__(
        self, events: Path | None, feedback: Path | None, wanted: Callable[[Message], bool] = lambda message: True
    ) -> None:
        self._paths = (events, feedback)
        self.wanted = wanted
        self._files = ExitStack()
        self._events: TextIO | None = None
        self._feedback: TextIO | None = None

    @property
    def own_stdout(self) -> bool:
        """Do the lines go to standard output, so that nothing else may?"""
        return STDOUT in self._paths

    def __enter__(self) -> Self:
        self._events, self._feedback = (self._open(path) for path in self._paths)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._files.close()

    def _open(self, path: Path | None) -> TextIO | None:
        if path is None:
            return None
        if path == STDOUT:
            return sys.stdout
        try:
            # Line by line: whoever follows the file sees each line at once.
            return self._files.enter_context(path.open("w", buffering=1, encoding="utf-8"))
        except OSError as error:
            raise InputRefused(Fault(reason=f"cannot write: {error.strerror}", where=str(path))) from error

    def __call__(self, message: Message, at: Seconds) -> None:
        match message:
            case ConnectionEvent():
                file = self._events
            case BlockProgress() | SyncPointProgress() | WarningFeedback():
                file = self._feedback
            case _:
                return
        if file is not None and self.wanted(message):
            print(lines.line(message), file=file, flush=True)

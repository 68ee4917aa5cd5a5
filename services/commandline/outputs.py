"""Files of `--events`, `--feedback` and `--outcomes`: JSON lines, or feedback as XML. `-` is standard output."""

import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Literal, Self, TextIO

import msgspec
from rich.console import Console

from engage_hri.schemas import lines
from engage_hri.schemas.documents.xml_feedback import HEAD, TAIL, encode_feedback
from engage_hri.schemas.faults import Fault, InputRefused, RunFailed
from engage_hri.schemas.feedback import BlockProgress, PredictionFeedback, SyncPointProgress, WarningFeedback
from engage_hri.schemas.messages import Message
from engage_hri.schemas.recognition import ConnectionEvent
from engage_hri.schemas.summary import Summary
from engage_hri.schemas.units import Seconds

STDOUT = Path("-")
FeedbackFormat = Literal["json", "xml"]


class Terminal(Console):
    """Rich's console, without its end of the process on a broken pipe, and without emoji in ids like `b:x:start`."""

    def __init__(self, **settings: Any) -> None:
        super().__init__(emoji=False, **settings)

    def on_broken_pipe(self) -> None:
        raise  # the BrokenPipeError, for services/commandline/ends.py


class Outputs:
    """Sink that writes the public messages. A bad path is refused before anything starts.

    format: of the feedback; None: that of its file's ending.
    """

    def __init__(
        self,
        events: Path | None,
        feedback: Path | None,
        format: FeedbackFormat | None = None,
        outcomes: Path | None = None,
    ) -> None:
        self._paths = (events, feedback, outcomes)
        self.wanted: Callable[[Message], bool] = lambda message: True
        """Filter: True for the messages to write."""
        named_xml = feedback is not None and feedback.suffix.lower() == ".xml"
        self._is_xml = format == "xml" or (format is None and named_xml)
        self._files = ExitStack()
        self._events: TextIO | None = None
        self._feedback: TextIO | None = None
        self._outcomes: TextIO | None = None

    def console(self, *, quiet: bool) -> Console:
        """Console for all other output: standard error if lines go to standard output."""
        return Terminal(stderr=STDOUT in self._paths, quiet=quiet)

    def __enter__(self) -> Self:
        events, feedback, outcomes = self._paths
        if feedback is not None and feedback in (events, outcomes) and self._is_xml:
            raise InputRefused(Fault(reason="JSON lines and XML cannot share a file", where=str(feedback)))
        files = {path: self._open(path) for path in dict.fromkeys(self._paths)}
        self._events, self._feedback, self._outcomes = files[events], files[feedback], files[outcomes]
        if self._is_xml and self._feedback is not None:
            self._feedback.write(HEAD)
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        try:
            if self._is_xml and self._feedback is not None:
                self._feedback.write(TAIL)
                self._feedback.flush()
            self._files.close()
        except OSError:
            if error is None:  # otherwise it is the same trouble once more
                raise

    def _open(self, path: Path | None) -> TextIO | None:
        if path is None:
            return None
        if path == STDOUT:
            return sys.stdout
        try:
            # Line by line, so that a reader that follows the file sees each line at once.
            return self._files.enter_context(path.open("w", buffering=1, encoding="utf-8"))
        except OSError as error:
            raise InputRefused(Fault(reason=f"cannot write: {error.strerror}", where=str(path))) from error

    def __call__(self, message: Message, at: Seconds) -> None:
        match message:
            case ConnectionEvent():
                self._write(self._events, message, str(lines.line(message)))
            case BlockProgress() | SyncPointProgress() | WarningFeedback():
                text = encode_feedback(message, in_stream=True) if self._is_xml else str(lines.line(message))
                self._write(self._feedback, message, text)
            case PredictionFeedback() if self._is_xml:
                self._write(self._feedback, message, encode_feedback(message, in_stream=True))

    def outcome(self, fragment: str, outcome: Summary) -> None:
        if self._outcomes is not None:
            line = {"fragment": fragment, **msgspec.to_builtins(outcome)}
            self._print(self._outcomes, msgspec.json.encode(line).decode())

    def _write(self, file: TextIO | None, message: Message, text: str) -> None:
        if file is not None and self.wanted(message):
            self._print(file, text)

    def _print(self, file: TextIO, text: str) -> None:
        try:
            print(text, file=file, flush=True)
        except BrokenPipeError:
            raise
        except OSError as error:
            raise RunFailed(Fault(reason=f"cannot write: {error.strerror}", where=file.name)) from error

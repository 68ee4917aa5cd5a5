"""What `--events` and `--feedback` write, as it comes: JSON lines, or feedback as XML. `-` is standard output."""

import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Literal, Self, TextIO

from schemas import lines
from schemas.faults import Fault, InputRefused
from schemas.feedback import BlockProgress, PredictionFeedback, SyncPointProgress, WarningFeedback
from schemas.feedback_xml import HEAD, TAIL, encode_feedback
from schemas.messages import Message
from schemas.recognition import ConnectionEvent
from schemas.units import Seconds

STDOUT = Path("-")
FeedbackFormat = Literal["json", "xml"]


class Outputs:
    """A sink that writes what is public. A bad path is refused before anything starts.

    wanted: which messages to write; all by default. format: of the feedback; None: as its file's name ends.
    """

    def __init__(
        self,
        events: Path | None,
        feedback: Path | None,
        wanted: Callable[[Message], bool] = lambda message: True,
        format: FeedbackFormat | None = None,
    ) -> None:
        self._paths = (events, feedback)
        self.wanted = wanted
        named_xml = feedback is not None and feedback.suffix.lower() == ".xml"
        self._is_xml = format == "xml" or (format is None and named_xml)
        self._files = ExitStack()
        self._events: TextIO | None = None
        self._feedback: TextIO | None = None

    @property
    def own_stdout(self) -> bool:
        """Do the lines go to standard output, so that nothing else may?"""
        return STDOUT in self._paths

    def __enter__(self) -> Self:
        self._events, self._feedback = (self._open(path) for path in self._paths)
        if self._is_xml and self._feedback is not None:
            self._feedback.write(HEAD)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._is_xml and self._feedback is not None:
            self._feedback.write(TAIL)
            self._feedback.flush()
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
                self._write(self._events, message, str(lines.line(message)))
            case BlockProgress() | SyncPointProgress() | WarningFeedback():
                text = encode_feedback(message, in_stream=True) if self._is_xml else str(lines.line(message))
                self._write(self._feedback, message, text)
            case PredictionFeedback() if self._is_xml:
                self._write(self._feedback, message, encode_feedback(message, in_stream=True))

    def _write(self, file: TextIO | None, message: Message, text: str) -> None:
        if file is not None and self.wanted(message):
            print(text, file=file, flush=True)

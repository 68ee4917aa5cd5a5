"""Setup of the log: bugs, and what a person has to see to, go to standard error.

With `--log FILE` each event is a line of a file. It is appended whole, so that the services of one machine may share
a file.
"""

import logging
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import datetime
from io import FileIO
from pathlib import Path
from typing import Any

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused, raised_as
from engage_hri.schemas.text import printable
from engage_hri.schemas.units import Seconds
from engage_hri.services.bus import journal
from engage_hri.services.bus.samples import Often
from engage_hri.services.commandline.shell.outputs import Patient, without_waiting

LEVELS = {name.lower(): getattr(logging, name) for name in ("DEBUG", "INFO", "WARNING", "ERROR")}
SOURCES = tuple(dict.fromkeys((*journal.NAMED, *keys.ROLES, "peers", "up")))
"""Sources with a level of their own: services, the roles of others, `peers` (who comes and goes), and `engage up`."""

CALM: Seconds = 60.0
"""Time without a line of an alert after which it counts as a new one, as of a device that is lost and found."""
HANDLER = "engage"
"""Name of the handlers made here."""


class Escaped(logging.Formatter):
    """Form of a record without unprintable letters. Each line of a traceback is escaped by itself, and indented."""

    def format(self, record: logging.LogRecord) -> str:
        trace = self.formatException(record.exc_info).split("\n") if record.exc_info else ()
        return "\n  ".join(map(printable, (self.head(record) + record.getMessage(), *trace)))

    def head(self, record: logging.LogRecord) -> str:
        """Return the text before the message."""
        return ""


class LogLine(Escaped):
    """Form of a line: `2026-11-22T13:09:35.123+01:00 INFO realizer: block ask: done after 3.20 s`."""

    def head(self, record: logging.LogRecord) -> str:
        at = datetime.fromtimestamp(record.created).astimezone().isoformat(timespec="milliseconds")
        return f"{at} {record.levelname} {record.name.removeprefix('engage.')}: "


class StandardError(logging.Handler):
    """Handler that prints bugs, and warnings without a service's name, on the present standard error.

    What cannot be printed there ends nobody, and nobody waits for its reader, as of a terminal that is paused: all
    that speaks to the robot would stand still. Such lines are lost, and their number is told when there is room.
    """

    def __init__(self, *, alerts: bool = False) -> None:
        """alerts: print also what of services a person has to see to (`journal.alert`)."""
        super().__init__()
        self._alerts = alerts
        self._repeats = Often(CALM)
        encoding = getattr(sys.stderr, "encoding", None) or "utf-8"
        self._lines = Patient("standard error", self._put, self.tell, encoding)

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= (logging.WARNING if record.name == "engage" else logging.ERROR):
            self.tell(self.format(record))
        elif self._alerts and getattr(record, journal.ALERT, False):
            text = self.format(record)
            if times := self._repeats.tell(text, "", record.created):
                self.tell(text if times == 1 else f"{text} (for the {times}th time)")

    def tell(self, text: str) -> None:
        """Print a line, if there is room."""
        with suppress(OSError):
            self._lines.write(f"{text}\n")

    def _put(self, data: bytes) -> int | None:
        if (stream := sys.stderr) is None:
            return len(data)
        try:
            number = stream.fileno()
        except (OSError, ValueError):  # somebody has put another in its place, which is not the system's
            return len(data) if stream.write(data.decode(self._lines.encoding)) else 0
        stream.flush()
        return without_waiting(number, data)


class LogFile(logging.StreamHandler[Any]):
    """Handler that appends to a file. What cannot be written is lost, and told on standard error."""

    def __init__(self, path: Path, tell: Callable[[str], None]) -> None:
        """tell: prints on standard error. Raises OSError if the file cannot be opened."""
        self._file = FileIO(path, "a")
        super().__init__(Patient(f"--log {path}", self._file.write, tell))

    def close(self) -> None:
        with suppress(OSError):
            self._file.close()
        super().close()


def configure(path: Path | None = None, levels: Sequence[str] = (), *, alerts: bool = False) -> None:
    """Set up the log of this process. path: file to append to; None: no file. alerts: see `StandardError`.

    levels: `debug` for all, or `realizer=debug` for one source. Raises InputRefused for an unknown level or source,
    levels without a file, and a file that cannot be written.
    """
    if levels and path is None:
        raise InputRefused(
            Fault(reason="there is no log whose level it could be", where="--log-level", advice="add --log FILE")
        )
    chosen = {}
    for source, equals, name in (level.lower().rpartition("=") for level in levels):
        chosen[source] = name
        if name not in LEVELS or source not in (SOURCES if equals else ("",)):
            advice = f"LEVEL or SOURCE=LEVEL; levels: {', '.join(LEVELS)}; sources: {', '.join(SOURCES)}"
            bad = name if name not in LEVELS else source
            raise InputRefused(Fault(reason=f"unknown {bad!r}", where="--log-level", advice=advice))
    errors = StandardError(alerts=alerts)
    errors.setFormatter(Escaped())
    handlers: list[logging.Handler] = [errors]
    if path is not None:
        with raised_as(InputRefused, OSError, f"--log {path}", "cannot be written"):
            if path.is_fifo() or str(path) == "-":
                raise OSError(0, "it is no file")
            handlers.append(LogFile(path, errors.tell))
        handlers[-1].setFormatter(LogLine())
    root = logging.getLogger()
    for handler in [handler for handler in root.handlers if handler.name == HANDLER]:
        root.removeHandler(handler)
        handler.close()
    for handler in handlers:
        handler.name = HANDLER
        root.addHandler(handler)
    logging.getLogger("engage").setLevel(LEVELS[chosen.get("", "info" if path else "warning")])
    for source in SOURCES:
        logging.getLogger(f"engage.{source}").setLevel(LEVELS.get(chosen.get(source, ""), logging.NOTSET))

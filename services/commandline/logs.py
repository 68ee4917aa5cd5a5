"""Setup of the log: bugs go to standard error; with `--log FILE` each event is a line of a file.

Each line is appended whole, so that the services of one machine may share a file.
"""

import logging
import sys
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from engage_hri.schemas import keys
from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.bus import journal

LEVELS = {name.lower(): getattr(logging, name) for name in ("DEBUG", "INFO", "WARNING", "ERROR")}
SOURCES = tuple(dict.fromkeys((*journal.NAMED, *keys.ROLES, "bus", "up")))
"""Sources with a level of their own: services, the roles of others, the bus in memory, and `engage up`."""

HANDLER = "engage"
"""Name of the handlers made here."""


class LogLine(logging.Formatter):
    """Form of a line:

    `2026-11-22T13:09:35.123+01:00 INFO realizer: block ask: done after 3.20 s`, with unprintable letters escaped.
    """

    def format(self, record: logging.LogRecord) -> str:
        at = datetime.fromtimestamp(record.created).astimezone().isoformat(timespec="milliseconds")
        source = record.name.removeprefix("engage.")
        text = record.getMessage()
        line = f"{at} {record.levelname} {source}: " + "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)
        if record.exc_info:
            line += "\n  " + self.formatException(record.exc_info).replace("\n", "\n  ")
        return line


class StandardError(logging.Handler):
    """Handler that prints bugs, and warnings without a service's name, on the present standard error."""

    def emit(self, record: logging.LogRecord) -> None:
        if record.levelno >= (logging.WARNING if record.name == "engage" else logging.ERROR):
            print(self.format(record), file=sys.stderr)


def configure(path: Path | None = None, levels: Sequence[str] = ()) -> None:
    """Set up the log of this process. path: file to append to; None: no file.

    levels: `debug` for all, or `realizer=debug` for one source. Raises InputRefused for an unknown level or source,
    and for a file that cannot be written.
    """
    chosen = {source: name for source, _, name in (level.rpartition("=") for level in levels)}
    for source, name in chosen.items():
        if name not in LEVELS or source not in ("", *SOURCES):
            advice = f"LEVEL or SOURCE=LEVEL; levels: {', '.join(LEVELS)}; sources: {', '.join(SOURCES)}"
            bad = name if name not in LEVELS else source
            raise InputRefused(Fault(reason=f"unknown {bad!r}", where="--log-level", advice=advice))
    handlers: list[logging.Handler] = [StandardError()]
    if path is not None:
        try:
            handlers.append(logging.FileHandler(path, encoding="utf-8", errors="backslashreplace"))
        except OSError as error:
            raise InputRefused(Fault(reason=f"cannot be written: {error.strerror}", where=f"--log {path}")) from error
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

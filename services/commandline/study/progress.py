"""Progress of a study: a bar on a terminal, a line for each session anywhere else."""

from contextlib import ExitStack
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from engage_hri.services.study.records import SessionRecord


class ProgressReport:
    """Reporter that is called with each ended session. Rich's own refresh thread stays off."""

    def __init__(self, console: Console, total: int) -> None:
        self._console = console
        self._open = ExitStack()
        self._bar: Progress | None = None
        if console.is_terminal and not console.quiet:
            columns = (TextColumn("sessions"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._bar = Progress(*columns, console=console, auto_refresh=False, transient=True)
            self._task = self._bar.add_task("sessions", total=total)

    def __enter__(self) -> Self:
        if self._bar is not None:
            self._open.enter_context(self._bar)
        return self

    def __exit__(self, *raised: object) -> None:
        self._open.close()

    def __call__(self, record: SessionRecord) -> None:
        if self._bar is not None:
            self._bar.update(self._task, advance=1, refresh=True)
        if self._bar is None or not record.finished:
            self._console.print(session_line(record), markup=False, highlight=False, soft_wrap=True)


def session_line(record: SessionRecord) -> str:
    """Result of a session: `operational 3: 155 s, 97 connection events`."""
    came_to = f"{record.duration:.0f} s, {record.statistics.events} connection events"
    name = f"{record.condition} {record.session}"
    return f"{name}: {came_to}" if record.finished else f"{name}: not finished: {record.reason} ({came_to})"

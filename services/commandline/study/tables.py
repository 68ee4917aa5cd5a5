"""Tables and plots of a study, for a terminal and for files."""

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

from rich import box
from rich.console import Console, Group, RenderableType
from rich.table import Table as RichTable
from rich.text import Text

from engage_hri.schemas.faults import Fault, InputRefused, RunFailed, raised_as
from engage_hri.services.runtime.installation import extra_command
from engage_hri.services.study import summary
from engage_hri.services.study.hypotheses import HypothesisResult
from engage_hri.services.study.records import EventRecord, SessionRecord
from engage_hri.services.study.summary import NumberTable

PLOTS = ("events.png", "delays.png", "failure_rates.png", "mtbce.png", "completion_time.png")
FILES = ("events.csv", "sessions.csv", "hypotheses.csv", "summary.md", *PLOTS)
Draw = Callable[[Sequence[SessionRecord], Sequence[EventRecord]], dict[str, bytes]]


class Folder:
    """Directory for results. names: of all files that may be written. overwrite: old ones are replaced or removed.

    Raises InputRefused if the directory cannot be written to, or, without `overwrite`, holds one of the files.
    """

    def __init__(self, path: Path, names: Collection[str], *, overwrite: bool) -> None:
        self.path = path
        self._names = names
        with raised_as(InputRefused, OSError, path, "cannot be made"):
            path.mkdir(parents=True, exist_ok=True)
        if not os.access(path, os.W_OK | os.X_OK):
            raise InputRefused(Fault(reason="cannot be written to", where=str(path)))
        present = [name for name in names if (path / name).exists()]
        if present and not overwrite:
            raise InputRefused(
                Fault(reason=f"has results already: {', '.join(present)}", where=str(path), advice="add --overwrite")
            )

    def write(self, files: dict[str, bytes]) -> None:
        """Write these files, and remove the others of `names`. Raises RunFailed."""
        for name in self._names:
            with raised_as(RunFailed, OSError, self.path / name, "cannot write"):
                if name in files:
                    part = self.path / f".{name}.part"
                    part.write_bytes(files[name])
                    part.replace(self.path / name)
                else:
                    (self.path / name).unlink(missing_ok=True)


class StudyReport:
    """End of a study: its tables on the terminal, and in a folder the same tables, all numbers, and plots.

    out: the folder; None: the tables are only printed. more: names of further files in it. Raises InputRefused if the
    folder cannot be had, or there is no matplotlib for the plots: before anything is played.
    """

    def __init__(self, console: Console, out: Path | None, more: Collection[str], *, overwrite: bool) -> None:
        self._console = console
        self._folder = None
        if out is not None:
            self._draw = _plotting()
            self._folder = Folder(out, (*FILES, *more), overwrite=overwrite)

    def end(
        self,
        records: Sequence[SessionRecord],
        events: Sequence[EventRecord],
        found: Sequence[HypothesisResult],
        tables: Sequence[NumberTable],
        more: Mapping[str, str],
    ) -> None:
        """Print and write all of it. more: texts of the further files, as far as there are some."""
        for table in tables:
            self._console.print("", rendered(table), sep="\n")
        if self._folder is None:
            return
        texts = {
            **more, "events.csv": summary.events_csv(events), "sessions.csv": summary.sessions_csv(records),
            "summary.md": "\n".join(table.markdown() for table in tables),
            **({"hypotheses.csv": summary.findings_csv(found)} if found else {}),
        }  # fmt: skip
        written = {name: text.encode() for name, text in texts.items()}
        self._folder.write(written | self._draw(records, events))
        self._console.print(f"\nresults in {self._folder.path}", markup=False, highlight=False, soft_wrap=True)


def _plotting() -> Draw:
    """Import the function that draws. Raises InputRefused without matplotlib."""
    with raised_as(InputRefused, ImportError, "", "plots need matplotlib", extra_command("study")):
        from engage_hri.services.study.plots import draw
    return draw


def rendered(table: NumberTable) -> RenderableType:
    """Draw a table with its notes, for a terminal."""
    return Group(grid(table), *(Text(note, style="dim") for note in table.notes))


def grid(table: NumberTable) -> RichTable:
    """Draw a table without its notes."""
    made = RichTable(title=table.title, title_justify="left", box=box.HORIZONTALS, show_edge=False, padding=0)
    for index, column in enumerate(table.columns):
        made.add_column(column, justify="right" if index else "left", overflow="fold")
    for row in table.rows:
        made.add_row(*map(Text, row))
    return made


def session_line(record: SessionRecord) -> str:
    """Result of a session: `operational 3: 155 s, 97 connection events`."""
    came_to = f"{record.duration:.0f} s, {record.statistics.events} connection events"
    name = f"{record.condition} {record.session}"
    return f"{name}: {came_to}" if record.finished else f"{name}: not finished: {record.reason} ({came_to})"

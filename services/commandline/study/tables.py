"""Tables and plots of a study, for a terminal and for files."""

from collections.abc import Callable, Sequence

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table as RichTable
from rich.text import Text

from engage_hri.schemas.faults import Fault, InputRefused
from engage_hri.services.runtime.installation import extra_command
from engage_hri.services.study.records import EventRecord, SessionRecord
from engage_hri.services.study.summary import NumberTable

PLOTS = ("events.png", "delays.png", "failure_rates.png", "mtbce.png", "completion_time.png")
Draw = Callable[[Sequence[SessionRecord], Sequence[EventRecord]], dict[str, bytes]]


def plotting() -> Draw:
    """Import the function that draws. Raises InputRefused without matplotlib, before any session is played."""
    try:
        from engage_hri.services.study.plots import draw
    except ImportError as error:
        fault = Fault(reason=f"plots need matplotlib: {error}", advice=extra_command("study"))
        raise InputRefused(fault) from error
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

"""Drawing of the net of a plan, with its initial marking, as lines of text. Pure.

Each instant is a column, each behavior a line: its sync points as letters, a circle for each phase between them, the
token as a filled one. Below stand the places between instants of different behaviors.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from rich.cells import cell_len, set_cell_size

from engage_hri.schemas.nets import NetTransition
from engage_hri.schemas.utf8 import printable
from engage_hri.services.console import net_rows
from engage_hri.services.console.net_rows import (
    BLOCK,
    LETTERS,
    MARK,
    Row,
    behaviors,
    ordered,
    without_number,
)
from engage_hri.services.console.nets import NetInView
from engage_hri.services.console.wording import number

TOKEN, EMPTY = "●", "○"
NARROWEST, WIDEST = 3, 9
"""Cells of a column."""
LABEL = 20
"""Most cells of a name."""
REST = 2
"""Cells between names and columns, with the tokens at rest."""
WAITING, AHEAD = "┄", "─"
CROSSED = {" ": "┊", WAITING: "┊", AHEAD: "┼"}
"""Line of an instant through the lines of behaviors that have no part in it."""


class _Columns(NamedTuple):
    """The instants that are shown: the cell where each begins, the width of one, and what is cut off."""

    at: Mapping[int, int]
    """For each transition, its cell; behind the last for those that are cut off."""
    width: int
    size: int
    is_cut: bool


def drawing(net: NetInView, width: int = 80, height: int = 40) -> list[str]:
    """The lines of a net. width, height: most cells and lines."""
    rows, ties = behaviors(net), net_rows.ties(net)
    left = min(LABEL, max(cell_len(printable(row.name)) for row in (*rows, *ties))) if rows else 0
    left = max(7, min(left, width // 3)) + 1
    columns = _columns(net, max(NARROWEST + 2, width - left - REST - 1))
    title = f"block {printable(net.block)}: {len(net.transitions)} instants, {len(net.marked)} {TOKEN}"
    head = [title, _times(net, columns, left)]
    known = [*rows, *(row for row in ties if min(columns.at[each] for each in row.points) < columns.size)]
    shown = known[: max(1, height - len(head) - 1)]  # the last line says how many are left out
    cells = [_cells(net, row, columns) for row in shown]
    _connect(shown, cells, columns)
    lines = head + [
        _assembled(printable(row.name), _at_rest(net, row), "".join(line), columns, left)
        for row, line in zip(shown, cells, strict=True)
    ]
    if hidden := len(rows) + len(ties) - len(shown):
        lines.append(f"… {hidden} more lines")
    return [_cut(line, width) for line in lines]


def legend(net: NetInView) -> str:
    """The letters that stand in the drawing of a net, with what they mean."""
    points = {each.sync for instant in net.transitions for each in instant.points}
    used = {name if (name := without_number(sync)) in LETTERS else "mark" for sync in points}
    words = [f"{letter}={name}" for name, letter in (*LETTERS.items(), ("mark", MARK)) if name in used]
    return " ".join((f"{TOKEN}=token", *words))


def _columns(net: NetInView, space: int) -> _Columns:
    """Columns for as many instants as there is space for, from the first on."""
    order = ordered(net)
    shown = min(len(order), max(1, space // NARROWEST))
    width = max(NARROWEST, min(WIDEST, space // shown))
    at = {each: place * width for place, each in enumerate(order)}
    return _Columns(at, width, shown * width, shown < len(order))


def _times(net: NetInView, columns: _Columns, left: int) -> str:
    """The line of the planned times, as many as there is room for: those of instants that are shared first."""
    cells = [" "] * columns.size
    transitions = sorted(range(len(net.transitions)), key=lambda each: -_sharing(net.transitions[each]))
    for each in transitions:
        text, at = number(net.transitions[each].time), columns.at[each]
        free = cells[max(0, at - 1) : at + len(text) + 1]
        if at + len(text) <= columns.size and not "".join(free).strip():
            cells[at : at + len(text)] = text
    for each in transitions:
        at = columns.at[each]
        if at < columns.size and cells[at] == " " and (not at or cells[at - 1] in " ·"):
            cells[at] = "·"
    return _assembled("planned", " ", "".join(cells), columns, left)


def _sharing(instant: NetTransition) -> int:
    return len({each.behavior for each in instant.points})


def _at_rest(net: NetInView, row: Row) -> str:
    """The idle place of a line, if it has one."""
    idle = [each for each in row.places if net.places[each].kind == "idle"]
    return (TOKEN if idle[0] in net.marked else EMPTY) if idle else " "


def _cells(net: NetInView, row: Row, columns: _Columns) -> list[str]:
    """The columns of a line: its points, and its places between them."""
    cells = [" "] * columns.size
    ends = max(row.points, default=0, key=lambda each: columns.at[each])
    last = len(net.transitions) - 1
    for each in sorted(row.places, key=lambda each: net.places[each].kind == "phase"):  # phases above what waits
        place = net.places[each]
        if place.kind == "idle":
            continue
        token = TOKEN if each in net.marked else EMPTY
        waits = row.is_tie or (place.kind != "phase" and row.name != BLOCK)
        style = WAITING if waits else AHEAD
        # What waits for the end of the block stands behind the last point of the behavior.
        source = ends if waits and place.target == last and ends != last else place.source
        letters = max(1, min(len(row.points.get(source, "")), columns.width - 2))
        _draw(cells, columns.at[source] + letters, columns.at[place.target], style, token)
    for each, text in row.points.items():
        at, text = columns.at[each], text[: max(1, columns.width - 2)]
        if at < columns.size:
            cells[at : at + len(text)] = text
    return cells


def _draw(cells: list[str], since: int, to: int, style: str, token: str) -> None:
    """Draw a place from cell to cell, as far as it is in view."""
    to = min(len(cells), to)
    if since < to:
        cells[since:to] = style * (to - since)
        cells[(since + to - 1) // 2] = token


def _connect(rows: Sequence[Row], cells: Sequence[list[str]], columns: _Columns) -> None:
    """Draw each instant that several behaviors share through the lines between them."""
    first: dict[int, int] = {}
    for here, row in enumerate(rows):
        for each in () if row.is_tie else row.points:
            at = columns.at[each]
            if at < columns.size:
                for between in range(first.setdefault(each, here) + 1, here):
                    if (crossed := cells[between][at]) in CROSSED:
                        cells[between][at] = CROSSED[crossed]


def _assembled(name: str, rest: str, cells: str, columns: _Columns, left: int) -> str:
    line = f"{_fill(name, left)}{rest} {cells}"
    return f"{line}…" if columns.is_cut else line.rstrip()


def _fill(text: str, cells: int) -> str:
    """Text of exactly so many cells, with a space at its end."""
    if cell_len(text) >= cells:
        text = set_cell_size(text, cells - 2) + "…"
    return set_cell_size(text, cells)


def _cut(line: str, width: int) -> str:
    return line if cell_len(line) <= width else set_cell_size(line, max(0, width - 1)) + "…"

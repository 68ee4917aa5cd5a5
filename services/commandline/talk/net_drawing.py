"""Drawing of the net of a plan, with its initial marking, as lines of text. Pure.

Each instant is a column, each behavior a line: its sync points as letters, a circle for each phase between them, the
token as a filled one. Below stand the places between instants of different behaviors.
"""

from collections import Counter
from collections.abc import Sequence
from typing import NamedTuple

from rich.cells import cell_len, set_cell_size

from engage_hri.schemas.text import printable
from engage_hri.services.console.nets import BLOCK, REST, NetInView, laid_out
from engage_hri.services.console.web.sections import NetRow, NetShown
from engage_hri.services.console.wording import number

LETTERS = {
    "start": "s", "ready": "r", "attackPeak": "p", "stroke_start": "[", "strokeStart": "[", "stroke": "*",
    "stroke_end": "]", "strokeEnd": "]", "relax": "x", "end": "e",
}  # fmt: skip
"""Letters of sync points, as blocks of all dialects spell them."""
MARK = "m"
"""Letter of a sync point that the behavior itself names: a mark in a speech."""
TOKEN, EMPTY = "●", "○"
NARROWEST, WIDEST = 3, 9
"""Cells of a column."""
LABEL = 20
"""Most cells of a name."""
AT_REST = 2
"""Cells between names and columns, with the tokens at rest."""
WAITING, AHEAD = "┄", "─"
CROSSED = {" ": "┊", WAITING: "┊", AHEAD: "┼"}
"""Line of an instant through the lines of behaviors that have no part in it."""


class _Grid(NamedTuple):
    """The drawing's measures. columns: that are shown. width: cells of one. left: cells of the names."""

    columns: int
    width: int
    left: int
    is_cut: bool

    @property
    def size(self) -> int:
        return self.columns * self.width

    def line(self, name: str, rest: str, cells: str) -> str:
        """A line: name, token at rest, and the columns."""
        if cell_len(name) >= self.left:
            name = set_cell_size(name, self.left - 2) + "…"
        line = f"{set_cell_size(name, self.left)}{rest} {cells}"
        return f"{line}…" if self.is_cut else line.rstrip()


def drawing(net: NetInView, width: int = 80, height: int = 40) -> list[str]:
    """The lines of a net. width, height: most cells and lines."""
    shown = laid_out(net, lambda at: at)
    left = max((cell_len(printable(row.name)) for row in shown.rows), default=0)
    left = max(7, min(left, LABEL, width // 3)) + 1
    space = max(NARROWEST + 2, width - left - AT_REST - 1)
    count = min(len(shown.instants), max(1, space // NARROWEST))
    grid = _Grid(count, max(NARROWEST, min(WIDEST, space // count)), left, count < len(shown.instants))
    title = f"block {printable(net.block)}: {len(net.transitions)} instants, {len(net.marked)} {TOKEN}"
    head = [title, _times(shown, grid)]
    begins = {spot.row: spot.source for spot in shown.places}
    known = [each for each, row in enumerate(shown.rows) if not row.tie or begins[each] < grid.columns]
    drawn = known[: max(1, height - len(head) - 1)]  # the last line says how many are left out
    cells = [_cells(net, shown, each, grid) for each in drawn]
    _connect([shown.rows[each] for each in drawn], cells, grid)
    lines = head + [
        grid.line(printable(shown.rows[each].name), _token_at_rest(net, shown, each), "".join(line))
        for each, line in zip(drawn, cells, strict=True)
    ]
    if hidden := len(shown.rows) - len(drawn):
        lines.append(f"… {hidden} more lines")
    return [line if cell_len(line) <= width else set_cell_size(line, max(0, width - 1)) + "…" for line in lines]


def legend(net: NetInView) -> str:
    """The letters that stand in the drawing of a net, with what they mean."""
    syncs = {each.sync.partition(":")[0] for instant in net.transitions for each in instant.points}
    used = {sync if sync in LETTERS else "mark" for sync in syncs}
    words = [f"{letter}={name}" for name, letter in (*LETTERS.items(), ("mark", MARK)) if name in used]
    return " ".join((f"{TOKEN}=token", *words))


def _letter(sync: str) -> str:
    """Letter of a sync point, whatever the number of its stroke is: `stroke:2`."""
    return LETTERS.get(sync.partition(":")[0], MARK)


def _times(shown: NetShown, grid: _Grid) -> str:
    """The line of the planned times, as many as there is room for: those of instants that are shared first."""
    cells = [" "] * grid.size
    sharing = Counter(column for row in shown.rows for column, _ in row.points)
    for instant in sorted(shown.instants, key=lambda each: -sharing[each.column]):
        text, at = number(instant.planned), instant.column * grid.width
        free = cells[max(0, at - 1) : at + len(text) + 1]
        if at + len(text) <= grid.size and not "".join(free).strip():
            cells[at : at + len(text)] = text
    for at in range(0, grid.size, grid.width):
        if cells[at] == " " and (not at or cells[at - 1] in " ·"):
            cells[at] = "·"
    return grid.line("planned", " ", "".join(cells))


def _token_at_rest(net: NetInView, shown: NetShown, row: int) -> str:
    """The idle place of a row, if it has one."""
    idle = [each for each, spot in enumerate(shown.places) if spot.row == row and spot.source == REST]
    return (TOKEN if idle[0] in net.marked else EMPTY) if idle else " "


def _cells(net: NetInView, shown: NetShown, row: int, grid: _Grid) -> list[str]:
    """The columns of a row: its points, and its places between them."""
    cells = [" "] * grid.size
    line, last = shown.rows[row], len(shown.instants) - 1
    points = {column: "".join(map(_letter, syncs.split(" = "))) for column, syncs in line.points}
    places = [(each, spot) for each, spot in enumerate(shown.places) if spot.row == row and spot.source != REST]
    if line.tie:
        points = {column: end for _, spot in places for column, end in ((spot.source, "├"), (spot.target, "┤"))}
    ends = max(points, default=0)
    for each, spot in sorted(places, key=lambda one: one[1].kind == "phase"):  # phases above what waits
        waits = line.tie or (spot.kind != "phase" and line.name != BLOCK)
        # What waits for the end of the block stands behind the last point of the behavior.
        source = ends if waits and spot.target == last and ends != last else spot.source
        letters = max(1, min(len(points.get(source, "")), grid.width - 2))
        since, to = source * grid.width + letters, min(grid.size, spot.target * grid.width)
        if since < to:
            cells[since:to] = (WAITING if waits else AHEAD) * (to - since)
            cells[(since + to - 1) // 2] = TOKEN if each in net.marked else EMPTY
    for column, text in points.items():
        at, text = column * grid.width, text[: max(1, grid.width - 2)]
        if at < grid.size:
            cells[at : at + len(text)] = text
    return cells


def _connect(rows: Sequence[NetRow], cells: Sequence[list[str]], grid: _Grid) -> None:
    """Draw each instant that several behaviors share through the lines between them."""
    first: dict[int, int] = {}
    for here, row in enumerate(rows):
        for column, _ in row.points:
            at = column * grid.width
            if at < grid.size:
                for between in range(first.setdefault(column, here) + 1, here):
                    if (crossed := cells[between][at]) in CROSSED:
                        cells[between][at] = CROSSED[crossed]

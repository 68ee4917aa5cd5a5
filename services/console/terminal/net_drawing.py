"""Drawing of a net with its tokens, as lines of text. No state: the same net gives the same lines.

Each instant is a column, each behavior a line: its sync points as letters, a circle for each phase between them, the
token as a filled one. Below stand the places between instants of different behaviors.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from rich.cells import cell_len, set_cell_size
from rich.text import Text

from engage_hri.schemas.nets import NetPlace, NetTransition
from engage_hri.schemas.units import Seconds
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
from engage_hri.services.console.view import OWN_BLOCKS
from engage_hri.services.console.wording import number

TOKEN, EMPTY = "●", "○"
NARROWEST, WIDEST = 3, 9
"""Cells of a column."""
LABEL = 20
"""Most cells of a name."""
SMALLEST = 6
"""Lines of a net below which it is not drawn beside others."""
REST = 2
"""Cells between names and columns, with the tokens at rest."""
WAITING, AHEAD, DONE = "┄", "─", "━"
CROSSED = {" ": "┊", WAITING: "┊", AHEAD: "┼", DONE: "┿"}
"""Line of an instant through the lines of behaviors that have no part in it."""


class _Columns(NamedTuple):
    """The instants that are shown: the cell where each begins, the width of one, and what is cut off."""

    at: Mapping[int, int]
    """For each transition, its cell; left of the first for those that are cut off there."""
    width: int
    size: int
    cut: tuple[int, int]


def drawing(net: NetInView, width: int = 80, height: int | None = None, now: Seconds | None = None) -> list[str]:
    """The lines of a net. width, height: most cells and lines; None: as many as it takes. now: local time."""
    if net.waits_for:
        return [_cut(_title(net, now), width)]
    rows, ties = behaviors(net), net_rows.ties(net)
    left = min(LABEL, max(cell_len(printable(row.name)) for row in (*rows, *ties))) if rows else 0
    left = max(7, min(left, width // 3)) + 1
    columns = _columns(net, max(NARROWEST + 2, width - left - REST - 1))
    head = [_title(net, now), _times(net, columns, "planned", left)]
    if net.fired:
        head.append(_times(net, columns, "fired", left))
    in_view = [row for row in ties if _is_in_view(row, columns)]
    shown, hidden = _fitting(net, [*rows, *in_view], None if height is None else height - len(head))
    hidden += [row for row in ties if row not in in_view]
    cells = [_cells(net, row, columns) for row in shown]
    _connect(shown, cells, columns)
    lines = head + [
        _assembled(printable(row.name), _at_rest(net, row), "".join(line), columns, left)
        for row, line in zip(shown, cells, strict=True)
    ]
    if hidden:
        tokens = sum(each in net.marked for row in hidden for each in row.places)
        lines.append(f"… {len(hidden)} more lines, with {tokens} {TOKEN}")
    return [_cut(line, width) for line in lines]


def picture(nets: Sequence[NetInView], width: int, height: int, now: Seconds, held: Sequence[str] = ()) -> Text:
    """Draw the nets of all live blocks, as large as the terminal: the newest first, those of mere looks last.

    held: what is held, above them.
    """
    lines = [_cut(f"held: {printable(', '.join(held))}", width)] if held else []
    if not nets:
        return Text("\n".join([*lines, "no block runs"]), style="dim")
    newest = [net for own in (False, True) for net in reversed(nets) if net.block.startswith(OWN_BLOCKS) == own]
    for net in newest:
        room = height - len(lines) - 2  # the legend, and the line where the cursor stands
        if room < SMALLEST and lines:
            lines[-1] = "… other blocks"
            break
        lines += [*drawing(net, width, max(SMALLEST, room), now), ""]
    lines.append(_cut(legend(nets), width))
    text = Text("\n".join(lines), no_wrap=True)
    text.highlight_regex(f"{TOKEN}+", "bold green")
    text.highlight_regex("(?m)^block .*$", "bold")
    text.highlight_regex("^held: .*$", "bold yellow")
    return text


def legend(nets: Iterable[NetInView]) -> str:
    """The letters that stand in the drawings of these nets, with what they mean."""
    points = {each.sync for net in nets for instant in net.transitions for each in instant.points}
    used = {name if (name := without_number(sync)) in LETTERS else "mark" for sync in points}
    words = [f"{letter}={name}" for name, letter in (*LETTERS.items(), ("mark", MARK)) if name in used]
    return " ".join((f"{TOKEN}=token", *words))


def _title(net: NetInView, now: Seconds | None) -> str:
    parts = [f"block {printable(net.block)}:"]
    if net.is_over:
        parts.append("over,")
    elif now is not None:
        parts.append(f"{max(0.0, now - net.began):.1f} s,")
    if net.waits_for:
        return " ".join((*parts, f"waits for {', '.join(map(printable, net.waits_for))}"))
    fired = f"{len(net.fired)} of {len(net.transitions)} instants have fired"
    return " ".join((*parts, f"{fired}, {len(net.marked)} {TOKEN}"))


# -- what is drawn -----------------------------------------------------------------------------------------------


def _is_in_view(row: Row, columns: _Columns) -> bool:
    cells = [columns.at[each] for each in row.points]
    return max(cells) >= 0 and min(cells) < columns.size


def _fitting(net: NetInView, rows: list[Row], height: int | None) -> tuple[list[Row], list[Row]]:
    """The rows that are drawn, and those for which there is no room: what holds a token on its way comes first."""
    if height is None or len(rows) <= height:
        return rows, []

    def rank(here: int) -> tuple[bool, bool, bool]:
        row = rows[here]
        moving = any(net.places[each].source for each in net.marked.intersection(row.places))
        return here > 0, row.is_tie, not moving

    kept = frozenset(sorted(range(len(rows)), key=rank)[: max(1, height - 1)])
    return [rows[each] for each in sorted(kept)], [row for each, row in enumerate(rows) if each not in kept]


# -- where it is drawn -------------------------------------------------------------------------------------------


def _columns(net: NetInView, space: int) -> _Columns:
    """Columns for as many instants as there is space for, around the one that fired last."""
    order = ordered(net)
    fits = max(1, space // NARROWEST)
    first = 0
    if len(order) > fits:
        latest = max((place for place, each in enumerate(order) if each in net.fired), default=0)
        first = max(0, min(latest - fits // 3, len(order) - fits))
    shown = order[first : first + fits]
    width = max(NARROWEST, min(WIDEST, space // len(shown)))
    at = {each: (place - first) * width for place, each in enumerate(order)}
    return _Columns(at, width, len(shown) * width, (first, len(order) - first - len(shown)))


def _times(net: NetInView, columns: _Columns, name: str, left: int) -> str:
    """A line of times, below one another for as many instants as there is room for: those that are shared first."""
    transitions = sorted(range(len(net.transitions)), key=lambda each: -_sharing(net.transitions[each]))
    planned = {each: net.transitions[each].time for each in transitions}
    cells, readable = _written(planned, columns)
    if name == "fired":
        cells, _ = _written({each: net.fired[each] for each in readable if each in net.fired}, columns)
    for each in net.fired if name == "fired" else transitions:
        at = columns.at[each]
        if 0 <= at < columns.size and cells[at] == " " and (not at or cells[at - 1] in " ·"):
            cells[at] = "·"
    return _assembled(name, " ", "".join(cells), columns, left)


def _written(times: Mapping[int, Seconds], columns: _Columns) -> tuple[list[str], list[int]]:
    """Cells with times at their columns, and the transitions that there was room for."""
    cells, readable = [" "] * columns.size, []
    for each, time in times.items():
        text, at = number(time), columns.at[each]
        free = cells[max(0, at - 1) : at + len(text) + 1]
        if at >= 0 and at + len(text) <= columns.size and not "".join(free).strip():
            cells[at : at + len(text)] = text
            readable.append(each)
    return cells, readable


def _sharing(instant: NetTransition) -> int:
    return len({each.behavior for each in instant.points})


def _at_rest(net: NetInView, row: Row) -> str:
    """The idle place of a line, if it has one."""
    idle = [each for each in row.places if net.places[each].kind == "idle"]
    return (TOKEN if idle[0] in net.marked else EMPTY) if idle else " "


def _cells(net: NetInView, row: Row, columns: _Columns) -> list[str]:
    """The columns of a line: its points, and its places between them."""
    cells = [" "] * columns.size
    done = max((place.source for place in _held(net, row)), default=None, key=lambda each: columns.at[each])
    ends = max(row.points, default=0, key=lambda each: columns.at[each])
    last = len(net.transitions) - 1
    for each in sorted(row.places, key=lambda each: net.places[each].kind == "phase"):  # phases above what waits
        place = net.places[each]
        if place.kind == "idle":
            continue
        token = TOKEN if each in net.marked else EMPTY
        is_over = columns.at[place.target] <= columns.at[done] if done is not None else ends in net.fired
        waits = row.is_tie or (place.kind != "phase" and row.name != BLOCK)
        style = WAITING if waits else DONE if is_over else AHEAD
        # What waits for the end of the block stands behind the last point of the behavior.
        source = ends if waits and place.target == last and ends != last else place.source
        letters = max(1, min(len(row.points.get(source, "")), columns.width - 2))
        _draw(cells, columns.at[source] + letters, columns.at[place.target], style, token)
    for each, text in row.points.items():
        at, text = columns.at[each], text[: max(1, columns.width - 2)]
        if 0 <= at < columns.size:
            cells[at : at + len(text)] = text
    return cells


def _held(net: NetInView, row: Row) -> list[NetPlace]:
    """The places of a line that hold a token of what is under way."""
    return [net.places[each] for each in row.places if each in net.marked and net.places[each].kind != "idle"]


def _draw(cells: list[str], since: int, to: int, style: str, token: str) -> None:
    """Draw a place from cell to cell, as far as it is in view."""
    since, to = max(0, since), min(len(cells), to)
    if since < to:
        cells[since:to] = style * (to - since)
        cells[(since + to - 1) // 2] = token


def _connect(rows: Sequence[Row], cells: Sequence[list[str]], columns: _Columns) -> None:
    """Draw each instant that several behaviors share through the lines between them."""
    first: dict[int, int] = {}
    for here, row in enumerate(rows):
        for each in () if row.is_tie else row.points:
            at = columns.at[each]
            if 0 <= at < columns.size:
                for between in range(first.setdefault(each, here) + 1, here):
                    if (crossed := cells[between][at]) in CROSSED:
                        cells[between][at] = CROSSED[crossed]


def _assembled(name: str, rest: str, cells: str, columns: _Columns, left: int) -> str:
    before, behind = columns.cut
    line = _fill(name, left) + rest + ("…" if before else " ") + cells
    return f"{line}…" if behind else line.rstrip()


def _fill(text: str, cells: int) -> str:
    """Text of exactly so many cells, with a space at its end."""
    if cell_len(text) >= cells:
        text = set_cell_size(text, cells - 2) + "…"
    return set_cell_size(text, cells)


def _cut(line: str, width: int) -> str:
    return line if cell_len(line) <= width else set_cell_size(line, max(0, width - 1)) + "…"

"""Layout of a net for the page: which instant in which column, which behavior in which row. Pure."""

from engage_hri.schemas.nets import NetTransition
from engage_hri.services.console.net_rows import BLOCK, Row, behaviors, ordered, ties
from engage_hri.services.console.nets import NetInView, where
from engage_hri.services.console.view import OWN_BLOCKS
from engage_hri.services.console.web.lanes import Zero
from engage_hri.services.console.web.sections import NetInstant, NetRow, NetShown, NetSpot, Tokens

REST = -1
"""Column of the places of a behavior at rest, left of all instants."""


def laid_out(net: NetInView, zero: Zero) -> NetShown:
    """The net as it is drawn, without its tokens."""
    columns = {transition: column for column, transition in enumerate(ordered(net))} if net.transitions else {}
    rows = [*behaviors(net), *ties(net)] if net.transitions else []
    return NetShown(
        block=net.block,
        since=zero(net.began),
        own=net.block.startswith(OWN_BLOCKS),
        waits_for=net.waits_for,
        rows=tuple(_row(net, row, columns) for row in rows),
        instants=tuple(
            NetInstant(instant.name, instant.time, columns[number], _span(instant, rows))
            for number, instant in enumerate(net.transitions)
        ),
        places=_places(net, rows, columns),
    )


def tokens(net: NetInView) -> Tokens:
    """The tokens of a net, and what has fired."""
    return Tokens(net.block, tuple(sorted(net.marked)), dict(net.fired), net.is_over)


def _row(net: NetInView, row: Row, columns: dict[int, int]) -> NetRow:
    if row.is_tie:
        return NetRow(row.name, True, ())
    name = "" if row.name == BLOCK else row.name
    points = []
    for number in row.points:
        syncs = [point.sync for point in net.transitions[number].points if point.behavior == name]
        points.append((columns[number], " = ".join(syncs)))
    return NetRow(row.name, False, tuple(points))


def _span(instant: NetTransition, rows: list[Row]) -> tuple[int, int]:
    """First and last row of the behaviors that share an instant."""
    names = {point.behavior or BLOCK for point in instant.points}
    shared = [number for number, row in enumerate(rows) if not row.is_tie and row.name in names]
    return (min(shared), max(shared)) if shared else (0, 0)


def _places(net: NetInView, rows: list[Row], columns: dict[int, int]) -> tuple[NetSpot, ...]:
    row_of = {place: number for number, row in enumerate(rows) for place in row.places}
    spots = []
    for number, place in enumerate(net.places):
        at_rest = place.kind == "idle"
        spots.append(
            NetSpot(
                row=row_of[number],
                source=REST if at_rest else columns[place.source],
                target=REST if at_rest else columns[place.target],
                kind=place.kind,
                lag=place.lag,
                words=where(net, place),
            )
        )
    return tuple(spots)

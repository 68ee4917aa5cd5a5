"""Layout of a net: which instant in which column, which behavior or place between behaviors in which row. Pure.

The page and the drawing of `engage plan` show the same layout.
"""

from engage_hri.schemas.blocks import NetPlace, NetTransition
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.nets import NetInView, where
from engage_hri.services.console.view import OWN_BLOCKS
from engage_hri.services.console.web.lanes import Zero
from engage_hri.services.console.web.sections import NetInstant, NetRow, NetShown, NetSpot, Tokens

REST = -1
"""Column of the places of a behavior at rest, left of all instants."""
BLOCK = "bml"
"""Name of the row of the block itself."""
TIES = ("delay", "order", "handover", "series")
"""Places between behaviors, the most interesting first."""


def laid_out(net: NetInView, zero: Zero) -> NetShown:
    """The net as it is drawn, without its tokens."""
    columns = {transition: column for column, transition in enumerate(_ordered(net))} if net.transitions else {}
    names = _behaviors(net, columns) if net.transitions else {}
    ties = _ties(net) if net.transitions else {}
    row_of = {name: number for number, name in enumerate((*names, *ties))}
    return NetShown(
        block=net.block,
        since=zero(net.began),
        own=net.block.startswith(OWN_BLOCKS),
        waits_for=net.waits_for,
        rows=(
            *(NetRow(name or BLOCK, False, tuple(points)) for name, points in names.items()),
            *(NetRow(f"{kind} {lag:g} s" if lag else kind, True, ()) for kind, _, _, lag in ties),
        ),
        instants=tuple(
            NetInstant(instant.name, instant.time, columns[number], _span(instant, list(names)))
            for number, instant in enumerate(net.transitions)
        ),
        places=tuple(_spot(net, place, row_of[_owner(net, place)], columns) for place in net.places),
    )


def tokens(net: NetInView) -> Tokens:
    """The tokens of a net, and what has fired."""
    return Tokens(net.block, tuple(sorted(net.marked)), dict(net.fired), net.is_over)


Tie = tuple[str, int, int, Seconds]
"""Kind, source, target and time of places between behaviors that say the same."""


def _ordered(net: NetInView) -> list[int]:
    """Transitions by their planned times; the end of the block is the last."""
    end = len(net.transitions) - 1
    return sorted(range(end + 1), key=lambda each: (each == end, net.transitions[each].time, each))


def _behaviors(net: NetInView, columns: dict[int, int]) -> dict[str, list[tuple[int, str]]]:
    """Columns and sync points of the block itself, whose name is empty, then of behaviors by their first instant."""
    points: dict[str, list[tuple[int, str]]] = {}
    for transition, column in columns.items():
        here: dict[str, list[str]] = {}
        for point in net.transitions[transition].points:
            here.setdefault(point.behavior, []).append(point.sync)
        for name, syncs in here.items():
            points.setdefault(name, []).append((column, " = ".join(syncs)))
    for place in net.places:
        if isinstance(owner := _owner(net, place), str):
            points.setdefault(owner, [])
    return {name: points[name] for name in sorted(points, key=lambda name: name != "")}


def _ties(net: NetInView) -> dict[Tie, None]:
    """The places between behaviors, in the order of `TIES`."""
    found = dict.fromkeys(tie for place in net.places if isinstance(tie := _owner(net, place), tuple))
    ranks = {kind: rank for rank, kind in enumerate(TIES)}
    return dict.fromkeys(sorted(found, key=lambda tie: ranks.get(tie[0], len(TIES))))


def _owner(net: NetInView, place: NetPlace) -> str | Tie:
    """The behavior on whose row a place lies, or the tie that it is between behaviors."""
    end = len(net.transitions) - 1
    if place.kind in ("phase", "idle") or (not place.lag and (place.source == 0 or place.target == end)):
        return place.behavior
    return (place.kind, place.source, place.target, place.lag)


def _span(instant: NetTransition, names: list[str]) -> tuple[int, int]:
    """First and last row of the behaviors that share an instant."""
    shared = [names.index(name) for name in {point.behavior for point in instant.points} if name in names]
    return (min(shared), max(shared)) if shared else (0, 0)


def _spot(net: NetInView, place: NetPlace, row: int, columns: dict[int, int]) -> NetSpot:
    at_rest = place.kind == "idle"
    return NetSpot(
        row=row,
        source=REST if at_rest else columns[place.source],
        target=REST if at_rest else columns[place.target],
        kind=place.kind,
        lag=place.lag,
        words=where(net, place),
    )

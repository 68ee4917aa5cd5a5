"""Rows of a drawing of a net: one for each behavior, and one for each place between behaviors. Pure."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from engage_hri.schemas.nets import NetPlace
from engage_hri.schemas.units import Seconds
from engage_hri.services.console.nets import NetInView

LETTERS = {
    "start": "s", "ready": "r", "attackPeak": "p", "stroke_start": "[", "strokeStart": "[", "stroke": "*",
    "stroke_end": "]", "strokeEnd": "]", "relax": "x", "end": "e",
}  # fmt: skip
"""Letters of sync points, as blocks of all dialects spell them."""
MARK = "m"
"""Letter of a sync point that the behavior itself names: a mark in a speech."""
BLOCK = "bml"
"""Name of the line of the block itself."""
TIES = ("delay", "order", "handover", "series")
"""Places between behaviors, the most interesting first."""


class Row(NamedTuple):
    """A line to draw. points: transitions with their letters. places: those on the line, in order."""

    name: str
    points: Mapping[int, str]
    places: Sequence[int]
    is_tie: bool = False


def behaviors(net: NetInView) -> list[Row]:
    """The block itself, then its behaviors by their first instant."""
    points: dict[str, dict[int, str]] = {}
    for transition in ordered(net):
        for point in net.transitions[transition].points:
            here = points.setdefault(point.behavior, {})
            here[transition] = here.get(transition, "") + letter(point.sync)
    places: dict[str, list[int]] = {name: [] for name in points}
    for each, place in enumerate(net.places):
        if (name := owner(net, place)) is not None:
            places.setdefault(name, []).append(each)
    names = sorted(places, key=lambda name: name != "")
    return [Row(name or BLOCK, points.get(name, {}), places[name]) for name in names]


def owner(net: NetInView, place: NetPlace) -> str | None:
    """The behavior on whose line a place lies; None: it lies between behaviors."""
    end = len(net.transitions) - 1
    if place.kind in ("phase", "idle") or (not place.lag and (place.source == 0 or place.target == end)):
        return place.behavior
    return None


def ties(net: NetInView) -> list[Row]:
    """A line for each place between behaviors; one for those that say the same."""
    found: dict[tuple[str, int, int, Seconds], list[int]] = {}
    for each, place in enumerate(net.places):
        if owner(net, place) is None:
            found.setdefault((place.kind, place.source, place.target, place.lag), []).append(each)
    ranks = {kind: rank for rank, kind in enumerate(TIES)}
    in_order = sorted(found, key=lambda tie: ranks.get(tie[0], len(TIES)))
    return [
        Row(f"{kind} {lag:g} s" if lag else kind, {source: "├", target: "┤"}, found[kind, source, target, lag], True)
        for kind, source, target, lag in in_order
    ]


def ordered(net: NetInView) -> list[int]:
    """Transitions by their planned times; the end of the block is the last."""
    end = len(net.transitions) - 1
    return sorted(range(end + 1), key=lambda each: (each == end, net.transitions[each].time, each))


def letter(sync: str) -> str:
    return LETTERS.get(without_number(sync), MARK)


def without_number(sync: str) -> str:
    """The name of a point, without the number of a stroke: `stroke` of `stroke:2`."""
    return sync.partition(":")[0]

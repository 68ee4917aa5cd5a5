"""Turns in a net: the ties that make a behavior wait until another has left it a part."""

from collections.abc import Iterable, Iterator, Mapping

from engage_hri.services.realizer.plan.handover import Turn
from engage_hri.services.realizer.plan.prediction import Circle
from engage_hri.services.realizer.points import Point

Ends = tuple[int, int]
"""Transitions of the point that is waited for, and of the start of who waits."""


def by_ends(turns: Iterable[Turn], at: Mapping[Point, int]) -> dict[Ends, Turn]:
    """Turns by where they stand in a net. at: the transition of each point."""
    return {(at[point], at[Point(id, "start")]): (id, point) for id, point in sorted(turns)}


def turns_in(ends: Mapping[Ends, Turn], *circles: Circle) -> Iterator[Turn]:
    """The turns that circles of ties go through, in their order."""
    ties = ((tie.source, tie.target) for circle in circles for tie, _ in circle if tie.kind == "series")
    yield from (ends[each] for each in ties if each in ends)

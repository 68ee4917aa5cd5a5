"""Spare time of the ties in a schedule, and along ways of several ties.

A tie says that one instant comes a time after another, at least. In a schedule it may come later than that: the rest
is the spare time of the tie. The least spare time on all ways from one instant to another tells how much later the
second must come, whatever else is moved.
"""

from collections.abc import Iterable, Sequence
from heapq import heappop, heappush
from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, Place
from engage_hri.services.realizer.plan.prediction import least
from engage_hri.services.realizer.points import EPSILON

Spare = list[list[tuple[int, Seconds]]]
"""For each transition, those that wait for it, and how many seconds later than they must they come."""


def spare_times(ties: Iterable[Place | Bound], times: Sequence[Seconds]) -> Spare:
    """The spare time of each tie in a schedule, in which phases may become as short or long as can be.

    times: of each transition.
    """
    spare: Spare = [[] for _ in times]
    for tie in ties:
        seconds = times[tie.target] - times[tie.source] - least(tie)
        if tie.kind != "idle" and -EPSILON < seconds < inf:
            spare[tie.source].append((tie.target, max(0.0, seconds)))
    return spare


def distances(source: int, out: Sequence[Sequence[tuple[int, Seconds]]]) -> dict[int, Seconds]:
    """Shortest distances from a node to all that can be reached (Dijkstra)."""
    found: dict[int, Seconds] = {}
    todo = [(0.0, source)]
    while todo:
        distance, here = heappop(todo)
        if here not in found:
            found[here] = distance
            for target, length in out[here]:
                if target not in found:
                    heappush(todo, (distance + length, target))
    return found

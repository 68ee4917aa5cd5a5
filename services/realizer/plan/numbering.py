"""The transitions of a net, numbered in an order in which they can fire: the same for any order of elements."""

import heapq
from collections.abc import Callable, Sequence
from math import inf
from typing import TypeVar

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, PlaceKind, Transition

_Tie = tuple[int, int, PlaceKind, Seconds, str, tuple[int, ...], tuple[Seconds, str]]
TieT = TypeVar("TieT", Place, Bound)


def numbered(
    transitions: Sequence[Transition], places: Sequence[Place], bounds: Sequence[Bound]
) -> tuple[PetriNet, list[int], bool]:
    """The net, the former number of each transition, and whether they can all fire in this order.

    Transitions that wait for each other come last, before the end.
    """
    ranked = _firing_order(len(transitions), places)
    is_ordered = len(ranked) == len(transitions)
    if not is_ordered:
        known = set(ranked)
        ranked += [each for each in range(len(transitions)) if each not in known]
    number = [0] * len(ranked)
    for new, old in enumerate(ranked):
        number[old] = new
    ties = _renumbered(places, number, lambda place: (place.shortest, place.after))
    limits = _renumbered(bounds, number, lambda bound: (inf if bound.stretch is None else bound.stretch, ""))
    placed = [
        Place(kind, source, target, lag, shortest, behavior, lines, after)
        for source, target, kind, lag, behavior, lines, (shortest, after) in _sorted(ties)
    ]
    bounded = [
        Bound(kind, source, target, lag, None if stretch == inf else stretch, behavior, lines)
        for source, target, kind, lag, behavior, lines, (stretch, _) in _sorted(limits)
    ]
    net = PetriNet(tuple([transitions[each] for each in ranked]), tuple(placed), tuple(bounded))
    return net, ranked, is_ordered


def _renumbered(
    ties: Sequence[TieT], number: Sequence[int], last: Callable[[TieT], tuple[Seconds, str]]
) -> list[_Tie]:
    """Each place or bound as a tuple that can be sorted, with the new numbers of its ends."""
    return [(number[it.source], number[it.target], it.kind, it.lag, it.behavior, it.lines, last(it)) for it in ties]


def _firing_order(size: int, places: Sequence[Place]) -> list[int]:
    """The transitions as they can fire, but the last one and those that wait for each other."""
    out: list[list[int]] = [[] for _ in range(size)]
    missing = [0] * size
    for place in places:
        if place.kind != "idle":
            out[place.source].append(place.target)
            missing[place.target] += 1
    ready = [each for each in range(size - 1) if not missing[each]]
    found: list[int] = []
    while ready:
        found.append(here := heapq.heappop(ready))
        for target in out[here]:
            missing[target] -= 1
            if not missing[target]:
                heapq.heappush(ready, target)
    return found


def _sorted(ties: list[_Tie]) -> list[_Tie]:
    """The ties in order, without repetitions."""
    ties.sort()
    return [tie for tie, before in zip(ties, [None, *ties], strict=False) if tie != before]

"""The transitions of a net, numbered in an order in which they can fire: the same for any order of elements."""

import heapq
from collections.abc import Sequence
from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, PlaceKind, Transition
from engage_hri.services.realizer.plan.steps import PORTION, Steps, portions

_Tie = tuple[int, int, PlaceKind, Seconds, str, tuple[int, ...], Seconds]


def numbered(
    transitions: Sequence[Transition], places: Sequence[Place], bounds: Sequence[Bound]
) -> Steps[tuple[PetriNet, list[int], bool]]:
    """The net, the former number of each of its transitions, and whether they can all fire in this order.

    Those that wait for each other come last, before the end.
    """
    ranked = yield from _firing_order(len(transitions), places)
    is_ordered = len(ranked) == len(transitions)
    if not is_ordered:
        known = set(ranked)
        ranked += [each for each in range(len(transitions)) if each not in known]
    number = [0] * len(ranked)
    for new, old in enumerate(ranked):
        number[old] = new
    ties: list[_Tie] = []
    for portion in portions(places):
        ties += [
            (number[it.source], number[it.target], it.kind, it.lag, it.behavior, it.lines, it.shortest)
            for it in portion
        ]
        yield len(portion) // 8
    limits: list[_Tie] = []
    for part in portions(bounds):
        limits += [
            (number[it.source], number[it.target], it.kind, it.lag, it.behavior, it.lines, _sortable(it.stretch))
            for it in part
        ]
        yield len(part) // 8
    placed: list[Place] = []
    for tied in portions(_sorted(ties)):
        placed += [
            Place(kind, source, target, lag, shortest, behavior, lines)
            for source, target, kind, lag, behavior, lines, shortest in tied
        ]
        yield len(tied) // 8
    bounded: list[Bound] = []
    for tied in portions(_sorted(limits)):
        bounded += [
            Bound(kind, source, target, lag, None if stretch == inf else stretch, behavior, lines)
            for source, target, kind, lag, behavior, lines, stretch in tied
        ]
        yield len(tied) // 8
    net = PetriNet(tuple([transitions[each] for each in ranked]), tuple(placed), tuple(bounded))
    return net, ranked, is_ordered


def _firing_order(size: int, places: Sequence[Place]) -> Steps[list[int]]:
    """The transitions as they can fire, the last one last, without those that wait for each other."""
    out: list[list[int]] = [[] for _ in range(size)]
    missing = [0] * size
    for portion in portions(places):
        for place in portion:
            if place.kind != "idle":
                out[place.source].append(place.target)
                missing[place.target] += 1
        yield len(portion) // 8
    ready = [each for each in range(size - 1) if not missing[each]]
    found: list[int] = []
    while ready:
        found.append(here := heapq.heappop(ready))
        for target in out[here]:
            missing[target] -= 1
            if not missing[target]:
                heapq.heappush(ready, target)
        if not len(found) % PORTION:
            yield PORTION // 8
    return found


def _sorted(ties: list[_Tie]) -> list[_Tie]:
    """In order, each once."""
    ties.sort()
    return [tie for tie, before in zip(ties, [None, *ties], strict=False) if tie != before]


def _sortable(stretch: Seconds | None) -> Seconds:
    return inf if stretch is None else stretch

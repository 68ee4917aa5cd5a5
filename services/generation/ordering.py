"""The order of a fragment's behaviors: topological in its constraints, document order for ties (decision B12)."""

import heapq
from collections.abc import Iterator, Sequence
from itertools import combinations

from schemas.behaviors import After, Before, Constraint, FragmentBehavior
from schemas.syncref import SyncRef

START = "start"


def ordered(behaviors: Sequence[FragmentBehavior], constraints: Sequence[Constraint]) -> tuple[FragmentBehavior, ...]:
    """The behaviors, each after those that its constraints put before it. A cycle is left in document order."""
    index = {behavior.id: place for place, behavior in enumerate(behaviors)}
    later: list[set[int]] = [set() for _ in behaviors]
    earlier = [0] * len(behaviors)
    for one, other in _precedences(behaviors, constraints):
        first, second = index.get(one), index.get(other)
        if first is not None and second is not None and first != second and second not in later[first]:
            later[first].add(second)
            earlier[second] += 1
    free = [place for place, count in enumerate(earlier) if count == 0]
    placed: list[int] = []
    left = set(range(len(behaviors)))
    while left:
        if not free:  # a cycle; whether it can be performed is the realizer's to say
            free = [min(left)]
        place = heapq.heappop(free)
        if place not in left:
            continue
        left.remove(place)
        placed.append(place)
        for follower in later[place]:
            earlier[follower] -= 1
            if earlier[follower] == 0 and follower in left:
                heapq.heappush(free, follower)
    return tuple(behaviors[place] for place in placed)


def _precedences(
    behaviors: Sequence[FragmentBehavior], constraints: Sequence[Constraint]
) -> Iterator[tuple[str, str]]:
    """(earlier, later) ids. Two points of one instant order their behaviors when only one of them is a start."""
    for behavior in behaviors:
        for timing in behavior.timing:
            yield from _same_instant(SyncRef(behavior=behavior.id, sync=timing.sync), _read(timing.ref))
    for constraint in constraints:
        for operator in constraint.operators:
            reference = _read(operator.ref)
            syncs = [_read(sync) for sync in operator.syncs]
            if isinstance(operator, After):
                yield from ((reference.behavior, sync.behavior) for sync in syncs)
            elif isinstance(operator, Before):
                yield from ((sync.behavior, reference.behavior) for sync in syncs)
            else:
                for one, other in combinations([reference, *syncs], 2):
                    yield from _same_instant(one, other)


def _same_instant(one: SyncRef, other: SyncRef) -> Iterator[tuple[str, str]]:
    if one.sync == START != other.sync:
        yield other.behavior, one.behavior
    elif other.sync == START != one.sync:
        yield one.behavior, other.behavior


def _read(text: str) -> SyncRef:
    return SyncRef.parse(text) if text else SyncRef()

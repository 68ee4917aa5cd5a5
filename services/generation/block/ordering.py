"""The order of a fragment's behaviors: topological in its constraints, document order for ties (decision B12).

Constraints speak of sync points, so it is instants that are ordered: a gaze that ends after a speech has begun may
well come before that speech. Points of one instant, or a fixed time apart, are told apart by their offsets.
"""

import heapq
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise

from msgspec import Struct

from engage_hri.schemas.behavior_types import SYNC_POINTS, canonical_sync
from engage_hri.schemas.behaviors import After, Before, Constraint, FragmentBehavior, Gaze, Reference, Speech
from engage_hri.schemas.references import SyncRef
from engage_hri.schemas.units import Seconds

Sync = tuple[str, str, str]
"""Block ("" for this one), behavior ("" for the block itself), sync point."""
Instant = tuple[int, Seconds]
"""Number of a group of sync points that are a fixed time apart, and the time within the group."""
START, END = "start", "end"
ROUNDING = 6
"""Decimals of seconds that count."""


class _Relations(Struct):
    """Relations between sync points.

    ties: the second point comes so many seconds after the first. orders: it comes no earlier than the first.
    """

    ties: list[tuple[Sync, Sync, Seconds]] = []
    orders: list[tuple[Sync, Sync]] = []


def ordered(
    behaviors: Sequence[FragmentBehavior], constraints: Sequence[Constraint], fragment: str = ""
) -> tuple[FragmentBehavior, ...]:
    """The behaviors, each after those that its constraints put before it. A cycle is left in document order.

    A behavior that needs neither voice nor gaze (a nod) comes as soon as it may: a reference that is tied to it need
    not wait for the words between. fragment: its id, by which sync references may name it.
    """
    behaviors = sorted(behaviors, key=lambda behavior: isinstance(behavior, Speech | Reference | Gaze))
    relations = _relations(behaviors, constraints, fragment)
    begins = [("", behavior.id, START) for behavior in behaviors]
    instants = _instants(begins, relations)
    orders = [(instants[one], instants[other]) for one, other in relations.orders]
    starts = [instants[sync] for sync in begins]
    return tuple(behaviors[place] for place in _sorted(starts, [*orders, *_passing_of_time(instants)]))


def _relations(behaviors: Sequence[FragmentBehavior], constraints: Sequence[Constraint], fragment: str) -> _Relations:
    relations = _Relations()
    # The voice says one thing at a time: whatever is said of two speeches' points holds of their starts.
    spoken = {("", behavior.id) for behavior in behaviors if isinstance(behavior, Speech | Reference)}

    def no_later(one: tuple[Sync, Seconds], other: tuple[Sync, Seconds]) -> None:
        (earlier, before), (later, after) = one, other
        if before >= after:
            relations.orders.append((earlier, later))
            if {earlier[:2], later[:2]} <= spoken:
                relations.orders.append(((*earlier[:2], START), (*later[:2], START)))

    for behavior in behaviors:
        for timing in behavior.timing:
            sync, offset = _read(timing.ref, fragment)
            relations.ties.append((sync, ("", behavior.id, canonical_sync(timing.sync)), offset))
    for constraint in constraints:
        for operator in constraint.operators:
            syncs = [_read(text, fragment) for text in operator.syncs]
            reference = _read(operator.ref, fragment) if operator.ref else None
            if isinstance(operator, After | Before):
                assert reference is not None
                for each in syncs:
                    no_later(*((reference, each) if isinstance(operator, After) else (each, reference)))
            else:
                together = [*([reference] if reference else []), *syncs]
                relations.ties += [(one, other, a - b) for (one, a), (other, b) in pairwise(together)]
    return relations


def _instants(begins: Sequence[Sync], relations: _Relations) -> dict[Sync, Instant]:
    """Instant of each sync point, as far as fixed distances tell; where two contradict each other the first holds."""
    apart: dict[Sync, list[tuple[Sync, Seconds]]] = defaultdict(list)
    for one, other, seconds in relations.ties:
        apart[one].append((other, seconds))
        apart[other].append((one, -seconds))
    ordered = [sync for order in relations.orders for sync in order]
    instants: dict[Sync, Instant] = {}
    for number, root in enumerate([*begins, *apart, *ordered]):
        if root in instants:
            continue
        instants[root] = (number, 0.0)
        reached = [root]
        for sync in reached:
            for other, seconds in apart[sync]:
                if other not in instants:
                    instants[other] = (number, round(instants[sync][1] + seconds, ROUNDING))
                    reached.append(other)
    return instants


def _passing_of_time(instants: Mapping[Sync, Instant]) -> Iterator[tuple[Instant, Instant]]:
    """Pairs of an earlier and a later instant: of points a fixed time apart, and of points of one behavior."""
    for one, other in pairwise(sorted(set(instants.values()))):
        if one[0] == other[0]:
            yield one, other
    points: dict[tuple[str, str], dict[str, Instant]] = defaultdict(dict)
    for (block, behavior, sync), instant in instants.items():
        points[block, behavior][sync] = instant
    for named in points.values():
        yield from pairwise([named[sync] for sync in SYNC_POINTS if sync in named])
        for mark in named.keys() - set(SYNC_POINTS):
            yield from ((named[START], named[mark]) for _ in named.keys() & {START})
            yield from ((named[mark], named[END]) for _ in named.keys() & {END})


def _sorted(starts: Sequence[Instant], orders: Iterable[tuple[Instant, Instant]]) -> Iterator[int]:
    """Places in `starts` in the order asked for.

    An instant is over once all that starts in it is listed; then it opens those that wait for it alone.
    """
    later: dict[Instant, list[Instant]] = defaultdict(list)
    waits: Counter[Instant] = Counter()
    for one, other in set(orders):
        if one != other:
            later[one].append(other)
            waits[other] += 1
    starting: dict[Instant, set[int]] = defaultdict(set)
    for place, instant in enumerate(starts):
        starting[instant].add(place)
    free: list[int] = []
    opened: set[Instant] = set()
    left = dict.fromkeys(range(len(starts)))
    opening = [instant for instant in {*later, *starting} if not waits[instant]]
    while left:
        if not opening and not free:  # a cycle; whether it can be performed is the realizer's to say
            opening.append(starts[next(iter(left))])
        while opening:
            instant = opening.pop()
            opened.add(instant)
            for place in starting[instant]:
                heapq.heappush(free, place)
            if not starting[instant]:
                opening += _freed(later[instant], waits, opened)
        if free:
            place = heapq.heappop(free)
            del left[place]
            yield place
            instant = starts[place]
            starting[instant].remove(place)
            if not starting[instant]:
                opening += _freed(later[instant], waits, opened)


def _freed(followers: Iterable[Instant], waits: Counter[Instant], opened: set[Instant]) -> Iterator[Instant]:
    for follower in followers:
        waits[follower] -= 1
        if not waits[follower] and follower not in opened:
            yield follower


def _read(text: str, fragment: str) -> tuple[Sync, Seconds]:
    ref = SyncRef.parse(text)
    block = "" if ref.block == fragment else ref.block
    return (block, ref.behavior, ref.sync or START), ref.offset

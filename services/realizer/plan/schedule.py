"""Schedule of a net: the earliest instants within lower and upper bounds, and the cycles that forbid them.

Each place of the net says that one instant comes no earlier than so many seconds after another. Without upper bounds
the earliest times are longest paths: one pass over the places in the order in which transitions can fire finds them.

An upper bound says that an instant comes no later than so long after another. Where it is broken, the *earlier* one
of the two is moved, since nothing can be moved forward. What follows it moves with it, and may break other bounds.
So passes forward over places and back over bounds take turns (`solve`). Times only grow, so the passes end, unless a
cycle of places and bounds asks for more time than it has.

Phases last as long as is natural. Only where a cycle asks for it, they are slower or faster, as far as the body can
(`predict`). What is left then is a contradiction that no timing solves. It is returned, for the planner to say who is
to blame.

In a schedule an instant may come later than a tie asks: the rest is the spare time of the tie. The least spare time
on all ways from one instant to another tells how much later the second must come, whatever else is moved
(`distances`).
"""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from heapq import heappop, heappush
from math import inf
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place
from engage_hri.services.realizer.points import EPSILON, Point


class Lag(Struct, frozen=True, gc=False):
    """Lower bound: `target` is no earlier than `source` + `seconds`, perhaps negative. reason: the caller's index."""

    source: int
    target: int
    seconds: Seconds
    reason: int


class PositiveCycle(Exception):
    """Raised if there is no schedule: these lags lead back to their start and take more than no time.

    cycles: all that were found, no two of which share an instant other than the first. lags: of the first.
    """

    def __init__(self, cycles: Sequence[Sequence[Lag]]) -> None:
        self.cycles = tuple(map(tuple, cycles))
        self.lags = self.cycles[0]
        super().__init__(f"a cycle of {sum(lag.seconds for lag in self.lags):+g} s")


class Solution(NamedTuple):
    """Schedule. times: of each instant. causes: for each that could not be earlier, the lag because of which."""

    times: list[Seconds]
    causes: dict[int, Lag]


def solve(size: int, lags: Sequence[Lag], past: Mapping[int, Seconds] = {}) -> Solution:
    """The least instants, none before 0 or what `past` says, that satisfy `lags`. Raises PositiveCycle.

    Sweeps go to and fro over the lags. Where these are in an order in which they can be met, forward lags need one
    sweep, what backward ones push back another; only what is pushed to and fro costs more (Yen's Bellman-Ford).
    Instant 0 stays where it is, so that every bound on a time of the clock that cannot be kept is found in one go.
    """
    times = [0.0] * size
    for instant, at in past.items():
        times[instant] = at
    causes: dict[int, Lag] = {}
    inner = [lag for lag in lags if lag.target]
    clock = [lag for lag in lags if not lag.target]
    sweeps = (inner, inner[::-1])
    just = EPSILON / 100
    for number in range(2 * size + 4):
        moved = None
        for lag in sweeps[number % 2]:
            at = times[lag.source] + lag.seconds
            if at > times[lag.target] + just:
                moved = lag.target
                times[moved] = at
                causes[moved] = lag
        if number and moved is not None and (cycles := _cycles(causes)):
            raise PositiveCycle(cycles)
        if moved is None:
            late = [lag for lag in clock if times[lag.source] + lag.seconds > times[0] + just]
            if not late:
                return Solution(times, causes)
            late.sort(key=lambda lag: times[lag.source] + lag.seconds, reverse=True)
            if cycles := _round_trips(
                late, causes, {lag.target: lag for lag in inner if lag.source == 0 == lag.seconds}
            ):
                raise PositiveCycle(cycles)
            times[0], causes[0] = times[late[0].source] + late[0].seconds, late[0]
    raise AssertionError("every transition moved once too often, yet no cycle of causes")  # pragma: no cover


def _round_trips(late: Iterable[Lag], causes: Mapping[int, Lag], at_once: Mapping[int, Lag]) -> list[list[Lag]]:
    """Cycles from instant 0 along what makes each of `late` too late, and by that lag back.

    at_once: lags of no time from instant 0, by target.
    """
    found = []
    visited: set[int] = set()
    for last in late:
        trip = [last]
        while (here := trip[-1].source) and here not in visited:
            visited.add(here)
            if (before := causes.get(here) or at_once.get(here)) is None:
                break
            trip.append(before)
        if not here:
            found.append(trip[::-1])
    return found


def _cycles(causes: dict[int, Lag]) -> list[list[Lag]]:
    """Every cycle among the causes: each instant has one, so they are disjoint."""
    found = []
    visited: dict[int, int] = {}
    for root in causes:
        here = root
        while here in causes and here not in visited:
            visited[here] = root
            here = causes[here].source
        if here in causes and visited[here] == root:
            cycle = [causes[here]]
            while (before := cycle[-1].source) != here:
                cycle.append(causes[before])
            found.append(cycle[::-1])
    return found


def critical_path(solution: Solution) -> tuple[int, ...]:
    """Transitions from the start of the block to its end, each the reason why the next is not earlier."""
    path = [len(solution.times) - 1]
    while (cause := solution.causes.get(path[-1])) is not None:
        path.append(cause.source)
    return tuple(path[::-1])


class Foresight(Place, frozen=True):
    """Place that stands for what is known beforehand of its target: it comes no earlier than `lag` seconds."""


class Awaited(Place, frozen=True, kw_only=True):
    """Place that stands for what other blocks wait for: its target, a point of theirs, comes after its source.

    pair: the point of this block, and that of the other.
    """

    pair: tuple[Point, Point]


Circle = tuple[tuple[Place | Bound, Seconds], ...]
"""Ties that lead back to their start, in order, each with its seconds: the sum is more than 0."""


class Impossible(Exception):
    """Raised if there is no schedule, with every phase of these circles as short or long as can be.

    circles: all that were found, no two of which share an instant other than the start of the block.
    """

    def __init__(self, circles: Sequence[Circle]) -> None:
        self.circles = tuple(circles)
        super().__init__(f"a cycle of {sum(seconds for _, seconds in self.circles[0]):+g} s")


def predict(
    net: PetriNet,
    dispensable: Callable[[Iterable[Place | Bound]], Collection[object]] = lambda ties: (),
    known: Mapping[int, Seconds] = {},
    awaited: Iterable[Awaited] = (),
    may_be_late: bool = False,
) -> Solution:
    """The earliest schedule; `reason` of a cause is the number of the place or, after them, of the bound.

    known: when transitions come that depend on more than this net, at the earliest; negative: before the block.
    awaited: which of them come after transitions of this net.
    A cycle that takes too long is shortened: each phase by a share of its room, those that can be slower before those
    that have to hurry. Raises Impossible; also for a cycle with ties that are dispensable: no phase is hurried for
    their sake. may_be_late: what the block says is missed then, by as little as can be.
    """
    foreseen = [Foresight("order", 0, each, at, at) for each, at in sorted(known.items()) if each and at > 0.0]
    past = {each: at for each, at in known.items() if each and at <= 0.0}
    ties: tuple[Place | Bound, ...] = (*net.places, *net.bounds, *foreseen, *awaited)
    lags = []
    for number, tie in enumerate(ties):
        if tie.kind != "idle":
            # What came before the block does not wait for its start.
            is_before = tie.target in past and _is_beginning(tie)
            lags.append(Lag(tie.source, tie.target, past[tie.target] if is_before else tie.lag, number))
    index: dict[int, int] = {}
    while True:
        try:
            return solve(len(net.transitions), lags, past)
        except PositiveCycle as found:
            index = index or {lag.reason: number for number, lag in enumerate(lags)}
            hopeless = []
            for cycle in found.cycles:
                circle = tuple([(ties[lag.reason], lag.seconds) for lag in cycle])
                room = [seconds - least(tie) for tie, seconds in circle]
                excess = sum(lag.seconds for lag in cycle)
                if sum(room) < excess - EPSILON and may_be_late and (last := _said(circle)) is not None:
                    room[last] = excess - sum(room)
                if sum(room) < excess - EPSILON:
                    hopeless.append(tuple([(tie, least(tie)) for tie, _ in circle]))
                    continue
                if dispensable([tie for tie, _ in circle]):
                    hopeless.append(circle)
                    continue
                slower = [
                    seconds if isinstance(tie, Bound) else 0.0 for (tie, _), seconds in zip(circle, room, strict=True)
                ]
                for lag in _shortened(cycle, slower, min(excess, sum(slower))):
                    lags[index[lag.reason]] = lag
                if (rest := excess - sum(slower)) > 0.0:
                    faster = [seconds - each for seconds, each in zip(room, slower, strict=True)]
                    if not any(faster):  # They miss each other by a rounding: nobody notices who gives way.
                        faster = [1.0] * len(cycle)
                    for lag in _shortened(cycle, faster, rest):
                        lags[index[lag.reason]] = lag
            if hopeless:
                raise Impossible(hopeless) from None


def _shortened(cycle: tuple[Lag, ...], room: list[Seconds], excess: Seconds) -> list[Lag]:
    """The lags of the cycle that give way, by `excess` in all, each in proportion to its `room`."""
    if sum(room) == inf:
        # What can wait as long as it must does so as early as it can, as it does when it is performed.
        first = min(lag.target for lag, each in zip(cycle, room, strict=True) if each == inf)
        room = [float(each == inf and lag.target == first) for lag, each in zip(cycle, room, strict=True)]
    if not (total := sum(room)):
        return []
    shares = [each / total for each in room]
    return [
        replace(lag, seconds=lag.seconds - excess * share) for lag, share in zip(cycle, shares, strict=True) if share
    ]


def _said(circle: Circle) -> int | None:
    """Number of the tie in a circle that may be missed: of what the block says, that of the last instant."""
    said = [number for number, (tie, _) in enumerate(circle) if isinstance(tie, Bound) and not tie.behavior]
    return max(said, key=lambda number: circle[number][0].source, default=None)


def _is_beginning(tie: Place | Bound) -> bool:
    """True for the place that only says that nothing comes before the block."""
    return isinstance(tie, Place) and tie.kind == "order" and not (tie.source or tie.lag or tie.behavior)


def least(tie: Place | Bound) -> Seconds:
    """The least that the lag may be."""
    if isinstance(tie, Place):
        return tie.shortest
    return -inf if tie.stretch is None else tie.lag - tie.stretch


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


def distances(source: int, out: Sequence[Sequence[tuple[int, Seconds]]]) -> list[Seconds]:
    """Shortest distances from a node to all others, inf to those that cannot be reached (Dijkstra)."""
    found = [inf] * len(out)
    found[source] = 0.0
    todo = [(0.0, source)]
    while todo:
        distance, here = heappop(todo)
        if distance <= found[here]:
            for target, length in out[here]:
                if distance + length < found[target]:
                    found[target] = distance + length
                    heappush(todo, (found[target], target))
    return found

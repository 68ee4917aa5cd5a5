"""Schedule of the earliest instants within lower and upper bounds: longest paths, and the cycles that forbid them.

Each place of the net says that one instant comes no earlier than so many seconds after another. Without upper bounds
the earliest times are longest paths: one pass over the places in the order in which transitions can fire finds them.

An upper bound says that an instant comes no later than so long after another. Where it is broken, the *earlier* one
of the two is moved, since nothing can be moved forward. What follows it moves with it, and may break other bounds.
So passes forward over places and back over bounds take turns. Times only grow, so the passes end, unless a cycle of
places and bounds asks for more time than it has. Such a cycle is a contradiction that no timing solves. It is
returned, for the planner to say who is to blame.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.points import EPSILON

LAGS_AN_ELEMENT = 32
"""Number of lags that take as long as one element of a block: see `steps`."""


class Lag(NamedTuple):
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
    for number in range(2 * size + 4):
        moved = None
        for lag in sweeps[number % 2]:
            source, target, seconds, _ = lag
            at = times[source] + seconds
            if at > times[target] + EPSILON / 100:
                times[target] = at
                causes[target] = lag
                moved = target
        if number and moved is not None and (cycles := _cycles(causes)):
            raise PositiveCycle(cycles)
        if moved is None:
            late = [lag for lag in clock if times[lag.source] + lag.seconds > times[0] + EPSILON / 100]
            if not late:
                return Solution(times, causes)
            late.sort(key=lambda lag: times[lag.source] + lag.seconds, reverse=True)
            if cycles := _round_trips(late, causes, {lag.target: lag for lag in inner if lag[::2] == (0, 0.0)}):
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

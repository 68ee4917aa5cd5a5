"""The earliest instants that satisfy lower and upper bounds: longest paths, and the cycles that forbid them."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from schemas.units import Seconds

EPSILON: Seconds = 1e-6
"""Times closer than this are the same instant."""


class Lag(NamedTuple):
    """`target` is no earlier than `source` + `seconds`; which may be negative. reason: the caller's index."""

    source: int
    target: int
    seconds: Seconds
    reason: int


class PositiveCycle(Exception):
    """No schedule: these lags lead back to their start and take longer than no time at all.

    cycles: all that were found, no two of which share an instant. lags: of the first.
    """

    def __init__(self, cycles: Sequence[Sequence[Lag]]) -> None:
        self.cycles = tuple(map(tuple, cycles))
        self.lags = self.cycles[0]
        super().__init__(f"a cycle of {sum(lag.seconds for lag in self.lags):+g} s")


class Solution(NamedTuple):
    """times: of each instant. causes: what keeps an instant from being earlier; none where nothing does."""

    times: list[Seconds]
    causes: dict[int, Lag]


def solve(start: Sequence[Seconds], fixed: Iterable[int], lags: Sequence[Lag]) -> Solution:
    """Least instants, each no earlier than its `start`, that satisfy `lags`. Raises PositiveCycle.

    fixed: instants that are facts and never move; a bound that they break is ignored.
    Sweeps go to and fro over the lags. Where these are in an order in which they can be met, forward lags need one
    sweep, what backward ones push back another; only what is pushed to and fro costs more (Yen's Bellman-Ford).
    """
    times = list(start)
    facts = frozenset(fixed)
    live = [lag for lag in lags if lag.target not in facts] if facts else list(lags)
    causes: dict[int, Lag] = {}
    sweeps = (live, live[::-1])
    for number in range(len(times) + 2):
        moved = None
        for lag in sweeps[number % 2]:
            source, target, seconds, _ = lag
            at = times[source] + seconds
            if at > times[target] + EPSILON / 100:
                times[target] = at
                causes[target] = lag
                moved = target
        if moved is None:
            return Solution(times, causes)
        if number and (cycles := _cycles(causes)):
            raise PositiveCycle(cycles)
    raise AssertionError("every transition moved once too often, yet no cycle of causes")  # pragma: no cover


def earliest(start: Sequence[Seconds], fixed: Iterable[int], lags: Sequence[Lag]) -> list[Seconds]:
    """The times of `solve`."""
    return solve(start, fixed, lags).times


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

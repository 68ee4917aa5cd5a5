"""The earliest instants that satisfy lower and upper bounds: longest paths, and the cycles that forbid them."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from schemas.units import Seconds

EPSILON: Seconds = 1e-6
"""Times closer than this are the same instant."""
NEVER: Seconds = float("-inf")


class Lag(NamedTuple):
    """`target` is no earlier than `source` + `seconds`; which may be negative. reason: the caller's index."""

    source: int
    target: int
    seconds: Seconds
    reason: int


class PositiveCycle(Exception):
    """No schedule: these lags lead back to their start and take longer than no time at all."""

    def __init__(self, lags: Sequence[Lag]) -> None:
        self.lags = tuple(lags)
        super().__init__(f"a cycle of {sum(lag.seconds for lag in lags):+g} s")


def earliest(start: Sequence[Seconds], fixed: Iterable[int], lags: Sequence[Lag]) -> list[Seconds]:
    """Least instants, each no earlier than its `start`, that satisfy `lags`. Raises PositiveCycle.

    fixed: instants that are facts and never move; a bound that they break is ignored.
    Lags in an order in which they can be met make this one pass; backward bounds cost a pass for each time
    they move something.
    """
    times = list(start)
    facts = frozenset(fixed)
    live = [lag for lag in lags if lag.target not in facts]
    cause: dict[int, Lag] = {}
    for _ in range(len(times) + 1):
        moved = None
        for lag in live:
            at = times[lag.source] + lag.seconds
            if at > times[lag.target] + EPSILON / 100:
                times[lag.target] = at
                cause[lag.target] = lag
                moved = lag.target
        if moved is None:
            return times
        if cycle := _cycle(cause, moved):
            raise PositiveCycle(cycle)
    raise AssertionError("every transition moved once too often, yet no cycle of causes")  # pragma: no cover


def _cycle(cause: dict[int, Lag], transition: int) -> list[Lag]:
    """The cycle that the causes of `transition` lead into, if any."""
    seen: dict[int, int] = {}
    path: list[Lag] = []
    while transition in cause:
        if transition in seen:
            return path[seen[transition] :][::-1]
        seen[transition] = len(path)
        path.append(cause[transition])
        transition = cause[transition].source
    return []

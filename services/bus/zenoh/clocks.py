"""Offsets between clocks of different machines, from the messages that pass between them. Pure.

A round trip says between which two offsets the true one is: the other clock was read after the question was sent, and
before the answer was there. What several trips allow is where they overlap; with time it grows by what clocks drift.
"""

from collections.abc import Callable
from math import inf, isfinite
from typing import NamedTuple

from engage_hri.schemas.participants import ClockOffset
from engage_hri.schemas.units import Seconds, Stamp

REFRESH: Seconds = 10.0
"""Time between two measurements of a clock."""
DRIFT = 100e-6
"""Rate by which two clocks drift apart at most: quartzes are right to 50 ppm."""
KEPT = 256
"""Number of clocks that are remembered. Processes whose clock is their own come and go."""


class _Offset(NamedTuple):
    """Bounds of an offset, as they were at `at`: local = remote + offset. trip: the quickest of the last trips."""

    low: Seconds
    high: Seconds
    at: Seconds
    trip: Seconds = inf

    @property
    def middle(self) -> Seconds:
        """The estimate. Before the first round trip there is no lower bound."""
        return (self.low + self.high) / 2 if isfinite(self.low) else self.high

    def later(self, at: Seconds) -> "_Offset":
        drifted = DRIFT * max(0.0, at - self.at)
        return _Offset(self.low - drifted, self.high + drifted, max(at, self.at), self.trip)


class Clocks:
    """Offsets of all clocks heard of to the clock `own`. now: reads that one."""

    def __init__(self, own: str, now: Callable[[], Seconds]) -> None:
        self.own = own
        self.now = now
        self._offsets: dict[str, _Offset] = {}

    def local(self, stamp: Stamp) -> Seconds:
        """Convert a stamp to the own clock. A stamp of a clock that is not known reads as now."""
        if stamp.clock == self.own:
            return stamp.seconds
        known = self._offsets.get(stamp.clock)
        return self.now() if known is None else stamp.seconds + known.middle

    def heard(self, clock: str, sent: Seconds, arrived: Seconds) -> None:
        """Take the times of a message: until its clock is measured, the quickest message bounds the offset."""
        if clock == self.own or not clock:
            return
        known = self._offsets.get(clock)
        # A message cannot arrive before it was sent, so arrived - sent is an upper bound, and the lowest is best.
        if known is None or (not isfinite(known.low) and arrived - sent < known.high):
            self._put(clock, _Offset(-inf, arrived - sent, arrived))

    def measured(self, clock: str, asked: Seconds, remote: Seconds, answered: Seconds) -> None:
        """Take a round trip. What contradicts all that was known begins anew: a machine has slept, say."""
        if clock == self.own or not clock:
            return
        low, high, trip = asked - remote, answered - remote, answered - asked
        known = self._offsets.get(clock)
        if known is not None and isfinite(known.low):
            before = known.later(answered)
            if before.low <= high and low <= before.high:
                trip = min(trip, known.trip) if answered - known.at < REFRESH / 2 else trip
                low, high = max(low, before.low), min(high, before.high)
        self._put(clock, _Offset(low, high, answered, trip))

    def _put(self, clock: str, offset: _Offset) -> None:
        if clock not in self._offsets and len(self._offsets) >= KEPT:
            unmeasured = (name for name, known in self._offsets.items() if not isfinite(known.low))
            del self._offsets[next(unmeasured, next(iter(self._offsets)))]
        self._offsets[clock] = offset

    def error(self, clock: str) -> Seconds:
        """Greatest error of `local` now; inf before the first measurement."""
        if clock == self.own:
            return 0.0
        known = self._offsets.get(clock)
        if known is None:
            return inf
        now = known.later(self.now())
        return (now.high - now.low) / 2

    @property
    def offsets(self) -> tuple[ClockOffset, ...]:
        """All offsets that have been measured."""
        return tuple(
            ClockOffset(clock=clock, offset=known.middle, error=self.error(clock), trip=known.trip)
            for clock, known in sorted(self._offsets.items())
            if isfinite(known.low)
        )

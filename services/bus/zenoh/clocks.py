"""Offsets between clocks of different machines, from the messages that pass between them. Pure."""

from collections.abc import Callable
from typing import NamedTuple

from engage_hri.schemas.units import Seconds, Stamp

REFRESH: Seconds = 60.0
"""Time between two measurements: quartz clocks drift apart by some 10 ppm, under a millisecond in this time."""


KEPT = 256
"""Number of clocks that are remembered. Processes whose clock is their own come and go."""


class _Offset(NamedTuple):
    """An estimate: local = remote + offset. error: half the round trip, or unknown (inf) for a one-way bound."""

    offset: Seconds
    error: Seconds
    at: Seconds


class Clocks:
    """Offsets of all clocks heard of to the clock `own`."""

    def __init__(self, own: str, now: Callable[[], Seconds]) -> None:
        self.own = own
        self._now = now
        self._offsets: dict[str, _Offset] = {}

    def local(self, stamp: Stamp) -> Seconds:
        """Convert a stamp to the own clock. A stamp of a clock that is not known reads as now."""
        if stamp.clock == self.own:
            return stamp.seconds
        known = self._offsets.get(stamp.clock)
        return self._now() if known is None else stamp.seconds + known.offset

    def heard(self, clock: str, sent: Seconds, arrived: Seconds) -> bool:
        """Take the times of a message: they bound the offset of its clock. True if a measurement is due."""
        if clock == self.own or not clock:
            return False
        known = self._offsets.get(clock)
        if known is None and len(self._offsets) >= KEPT:
            del self._offsets[next(iter(self._offsets))]
        # A message cannot arrive before it was sent, so arrived - sent is an upper bound, and the lowest is best.
        if known is None or (known.error == float("inf") and arrived - sent < known.offset):
            self._offsets[clock] = _Offset(arrived - sent, float("inf"), known.at if known else arrived - REFRESH)
        if arrived - self._offsets[clock].at < REFRESH:
            return False
        self._offsets[clock] = self._offsets[clock]._replace(at=arrived)
        return True

    def measured(self, clock: str, asked: Seconds, remote: Seconds, answered: Seconds) -> None:
        """Take a round trip: the remote clock was read in its middle, give or take half of it."""
        half = (answered - asked) / 2
        known = self._offsets.get(clock)
        if known is None or half <= known.error or answered - known.at > REFRESH / 2:
            self._offsets[clock] = _Offset(asked + half - remote, half, answered)

    def error(self, clock: str) -> Seconds:
        """Greatest error of `local`; inf before the first measurement."""
        if clock == self.own:
            return 0.0
        return self._offsets[clock].error if clock in self._offsets else float("inf")

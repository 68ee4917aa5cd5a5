"""Stops: for how long holds have stopped the clocks and phases of a block, as far as another plan has to know."""

from collections.abc import Callable, Collection, Iterable, Mapping

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.points import Point


class Hold(Struct, frozen=True):
    """Time in which the same was held. behaviors: which clocks stood, by what they lead to; None: all of them."""

    since: Seconds
    until: Seconds
    behaviors: Collection[str] | None

    def names(self, behaviors: Iterable[str]) -> bool:
        """True if one of these was held."""
        return self.behaviors is None or any(each in self.behaviors for each in behaviors)


class Stops(Struct, frozen=True):
    """Measure of what holds have stopped. All times are seconds from the start of the block.

    holds: one after the other, up to now. phases: for a point, the seconds in which its behavior stood on its way
    there. times: of points that are reached, and of others as they are expected now. cost: for a point and one
    before it, the seconds for which holds account, of those by which it is later than allowed after that: the
    allowed seconds, and those by which it is later.
    """

    holds: tuple[Hold, ...] = ()
    phases: Mapping[Point, Seconds] = {}
    reached: Mapping[Point, Seconds] = {}
    times: Mapping[Point, Seconds] = {}
    cost: Callable[[Point, Point, Seconds, Seconds], Seconds] = lambda late, early, allowed, by: 0.0

    def of_clock(self, behaviors: Collection[str], since: Seconds, lag: Seconds) -> Seconds:
        """Seconds for which a clock stood that began to run at a time for so long, and leads to these behaviors.

        As `RunningNet.prolonged`: a hold that comes when the clock has run down stops it no more.
        """
        ripe = since + lag
        for hold in self.holds:
            if hold.until > since and hold.since < ripe and hold.names(behaviors):
                ripe += hold.until - max(hold.since, since)
        return ripe - since - lag

    def of(self, behavior: str, since: Seconds, until: Seconds) -> Seconds:
        """Seconds between these times in which a behavior was held."""
        overlaps = (min(each.until, until) - max(each.since, since) for each in self.holds if each.names((behavior,)))
        return sum(each for each in overlaps if each > 0.0)


NO_STOPS = Stops()

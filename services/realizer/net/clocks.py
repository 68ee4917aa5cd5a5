"""Clocks of the places with a delay, and stops: for how long holds have stopped clocks and phases.

Each clock runs from a measured instant, and can be stopped and let go on. Another plan of the block has to know what
has stood for how long: else it would take what a hold cost for lateness.
"""

from collections.abc import Callable, Collection, Iterable, Mapping

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.bus.deadlines import Deadlines
from engage_hri.services.realizer.points import Point


class Clocks:
    """The time at which the token in each place will be ripe, for tokens that are not."""

    def __init__(self) -> None:
        self._due: Deadlines[int] = Deadlines(int)
        self._left: dict[int, Seconds] = {}

    @property
    def stopped(self) -> Mapping[int, Seconds]:
        """Places whose clocks are stopped, with the seconds that are left."""
        return self._left

    @property
    def next(self) -> Seconds | None:
        """Time at which the next token is ripe; None: no clock runs."""
        return self._due.earliest

    def set(self, place: int, at: Seconds, now: Seconds, *, is_stopped: bool) -> None:
        """Let the token in `place` be ripe at `at`; later by as long as the clock is stopped, from `now` on."""
        if is_stopped:
            self._left[place] = at - now
        else:
            self._due.set(place, at)

    def ripe(self, now: Seconds) -> tuple[int, Seconds] | None:
        """Remove the first token that is ripe by `now`; returns its place, and since when. None: there is none."""
        at = self._due.earliest
        if at is None or at > now or (place := self._due.due(now)) is None:
            return None
        return place, at

    def stop(self, is_held: Callable[[int], bool], now: Seconds) -> dict[int, Seconds]:
        """Stop the clocks of the places that are held now, and let all others run.

        Returns the places whose clocks go on, each with the time at which its token is ripe now.
        """
        for place in [each for each in self._due if is_held(each)]:
            at = self._due[place]
            assert at is not None
            self._due.clear(place)
            self._left[place] = at - now
        going_on = {place: now + left for place, left in self._left.items() if not is_held(place)}
        for place, at in going_on.items():
            del self._left[place]
            self.set(place, at, now, is_stopped=False)
        return going_on


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

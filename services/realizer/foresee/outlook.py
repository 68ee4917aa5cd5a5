"""Times of all points of a block, as they were measured or are expected at one moment."""

from collections.abc import Iterable, Mapping
from math import inf

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.points import Point


class Outlook(Struct, frozen=True):
    """Times as they were measured or are expected, by the loop's clock.

    instants: for each point, when all that share its instant have come. arrivals: when its own behavior passes it.
    """

    instants: Mapping[Point, Seconds]
    arrivals: Mapping[Point, Seconds]

    def apart(self, point: Point, other: Point) -> Seconds:
        """Seconds by which the instant of one point is later than that of another; -inf if one is not known."""
        if point not in self.instants or other not in self.instants:
            return -inf
        return self.instants[point] - self.instants[other]

    def behind(self, point: Point, others: Iterable[Point]) -> Seconds:
        """Seconds by which a behavior comes later to `point` than the first of the others of its instant."""
        if (at := self.arrivals.get(point)) is None:
            return 0.0
        return at - min((self.arrivals.get(other, at) for other in others), default=at)

"""Times of all points of a block, as they were measured or are expected at one moment."""

from collections.abc import Mapping
from math import inf

from msgspec import Struct

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.points import Point


class Outlook(Struct, frozen=True):
    """Times at which behaviors pass their points, as they were measured or are expected, by the loop's clock."""

    times: Mapping[Point, Seconds]

    def apart(self, point: Point, other: Point) -> Seconds:
        """Seconds by which one point is later than another; -inf if one is not known."""
        if point not in self.times or other not in self.times:
            return -inf
        return self.times[point] - self.times[other]

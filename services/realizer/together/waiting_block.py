"""Blocks that wait for their turn: when their points are expected, for others that are tied to them."""

from collections.abc import Callable, Collection, Iterable, Mapping, Set

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.known import BLOCK_END, BLOCK_START, block_of, qualified
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.points import Point
from engage_hri.services.realizer.together.live_blocks import LiveBlocks, Neighbor


class WaitingBlock(Neighbor):
    """A block that begins when others have ended: no earlier than the last of these is expected to end.

    It follows their ends, and is followed itself (see `LiveBlocks`). So dates pass from block to block, always from
    one that came earlier to one that came later: they never go round in a circle.
    """

    def __init__(
        self,
        plan: Plan,
        live_blocks: LiveBlocks,
        now: Callable[[], Seconds],
        leaders: Collection[str] = (),
        is_held: Callable[[], bool] = lambda: False,
    ) -> None:
        """leaders: blocks that have to end first. is_held: whether it is held itself."""
        self.leaders = leaders
        self._is_held = is_held
        self._plan = plan
        self._live_blocks = live_blocks
        self._now = now
        self._ends: dict[str, Seconds] = {}
        """When each of the other blocks is expected to end."""
        self._followed: set[Point] = set()

    def follow(self, points: Iterable[Point]) -> None:
        """Tell from now on when these points are expected: other blocks are tied to them."""
        self._followed.update(points)
        self._tell()

    def hear(self, point: Point, at: Seconds) -> None:
        """Take the news that a point of another block is reached: its end, perhaps."""
        self.foresee(point, at)

    def foresee(self, point: Point, at: Seconds) -> None:
        """Take the news that another block is expected to end at another time than before.

        Points of it that others are tied to are told, too.
        """
        if point == qualified(block_of(point), BLOCK_END):
            self._ends[block_of(point)] = at
            self._tell()

    def stuck(self, elsewhere: Set[Point], standing: Set[Point]) -> Set[Point]:
        """Points that others are tied to and that do not come before what is held goes on."""
        waits = not elsewhere.isdisjoint(qualified(block, BLOCK_END) for block in self.leaders)
        return self._followed if waits or self._is_held() else frozenset()

    def running(self, elsewhere: Set[Point], running: Set[Point]) -> Set[Point]:
        """Points that others are tied to and that come nearer: others that have to end first go on."""
        standing = elsewhere - running
        goes_on = any(qualified(block, BLOCK_END) not in standing for block in self.leaders)
        return self._followed if goes_on else frozenset()

    def stick(self, elsewhere: Set[Point], standing: Set[Point]) -> None:
        """Take the news which points of other blocks do not come before what is held goes on."""

    def miss(self, behaviors: Iterable[str]) -> None:
        """Take the news that another block is gone."""
        lost = set(behaviors)
        for end in [qualified(block, BLOCK_END) for block in self._ends]:
            if end.behavior in lost:
                del self._ends[block_of(end)]

    @property
    def newest_plan(self) -> Plan:
        """The plan that it had before it had to wait."""
        return self._plan

    def _tell(self) -> None:
        times = self.times()
        self._live_blocks.foresee(
            self._plan.block.id, {each: times[each] for each in self._followed if each in times}
        )

    def times(self) -> Mapping[Point, Seconds]:
        """Expected time of each of its points, if it is performed as planned before it had to wait."""
        begins = max((self._now(), *self._ends.values()))
        schedule = self._plan.schedule
        times = {point: begins + schedule[at] for point, at in self._plan.at.items()}
        return {**times, BLOCK_START: begins, BLOCK_END: begins + schedule[-1]}

"""Other live blocks, as known when a block is planned: when their points come, and who has which part when."""

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Set

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.body import Estimate
from engage_hri.schemas.references import BLOCK_ITSELF
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.facts import NO_STOPS, Stops
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import Elsewhere
from engage_hri.services.realizer.points import EPSILON, Point


class Holder(Struct, frozen=True):
    """A behavior of another live block that has parts of the body, or will have them.

    chain: its points are named as other blocks name them. is_natural: it ends when something takes its place, or with
    its block. kept: points that it cannot be deprived of, since something waits for them. estimate: of the body.
    reached: number of its points that have been. taker: the behavior of the block that is planned to which it hands
    its parts over by plan already; empty: none.
    """

    chain: Chain
    is_natural: bool
    kept: frozenset[Point]
    estimate: Estimate | None = None
    reached: int = 0
    taker: str = ""


class Known(Struct, frozen=True, kw_only=True):
    """Other live blocks, as far as the planning of one block has to know them. Times are seconds from its own start.

    blocks: their contents, by id. points: when points of others were reached (negative: before this block) or are
    expected; and when behaviors of this block began, or may begin at the earliest. holders: behaviors of others that
    have parts of the body or will have them, by `block:behavior`; they are given, and come in the order in which they
    have their parts.
    given: behaviors of this block that hand their parts over to another block by plan, and the start of the one there
    that takes them. kept: points of this block that other blocks wait for. begun: behaviors of this block that have
    begun; they wait for nobody any more. stops: what holds have stopped of these.
    due: those that would begin now, but for a behavior of another block.
    untied: points of others to which nothing is to be tied: these wait for this block by now.
    awaiting: points of others that come only after points of this block, each with those, and the seconds from there
    at least. The end of the block is `BLOCK_END`. lost: points of others that are named and never come.
    """

    blocks: Elsewhere = {}
    points: Mapping[Point, Seconds] = {}
    holders: Mapping[str, Holder] = {}
    given: Mapping[str, Point] = {}
    kept: Set[Point] = frozenset()
    begun: frozenset[str] = frozenset()
    stops: Stops = NO_STOPS
    due: Set[str] = frozenset()
    untied: Set[Point] = frozenset()
    awaiting: Mapping[Point, Mapping[Point, Seconds]] = {}
    lost: Set[Point] = frozenset()

    def with_own(self, times: Mapping[Point, Seconds]) -> Mapping[Point, Seconds]:
        """Times of a schedule for the block's own points, with those of others as they are known here.

        Others come when they come, also where the block would need them later.
        """
        if not self.points:
            return times
        return {**self.points, **{point: at for point, at in times.items() if not is_foreign(point.behavior)}}

    def natural_end(self, chain: Chain) -> Seconds:
        """Expected end of a behavior of this block that has begun, if it goes on at its natural pace."""
        return self.points[chain.points[0]] + sum(each.natural for each in chain.segments)

    def _with_waiting(self, times: Mapping[Point, Seconds], end: Seconds) -> Mapping[Point, Seconds]:
        """The same times, with points of others no earlier than they can be if they wait for points of this block."""
        own = {**times, BLOCK_END: end}
        later = {
            point: max([times[point], *(own[each] + seconds for each, seconds in waits.items() if each in own)])
            for point, waits in self.awaiting.items()
            if point in times
        }
        return {**times, **later} if later else times

    def in_truth(
        self, chains: Iterable[Chain], times: Mapping[Point, Seconds], end: Seconds
    ) -> Mapping[Point, Seconds]:
        """Times as of `with_own`, as far as they can be kept.

        Behaviors of the block begin when they began, or no earlier than they can begin now; who is due comes now.
        Points of others that wait for points of this block come no earlier than these allow. end: of the block.
        """
        late: dict[Point, Seconds] = {}
        for chain in chains if self.points else ():
            start = chain.points[0]
            by = self.points.get(start, 0.0) - times[start]
            if chain.behavior.id in self.begun:
                late[start] = self.points[start]
            if by > EPSILON:
                late |= _later(chain, times, by)
            elif chain.behavior.id in self.due:
                late |= {point: times[point] + by for point in chain.points}
        return self._with_waiting({**self.with_own(times), **late}, end)


def _later(chain: Chain, times: Mapping[Point, Seconds], by: Seconds) -> dict[Point, Seconds]:
    """Times of the points of a behavior that begins so much later: where it was to wait, it waits for less."""
    before, at = times[chain.points[0]], times[chain.points[0]] + by
    found = {chain.points[0]: at}
    for point, segment in zip(chain.points[1:], chain.segments, strict=True):
        at = max(times[point], at + min(segment.natural, times[point] - before))
        found[point], before = at, times[point]
    return found


NOTHING = Known()


def qualified(block: str, point: Point) -> Point:
    """The point as other blocks name it."""
    return Point(f"{block}:{point.behavior}", point.sync)


def at_home(point: Point) -> Point:
    """The point, named as other blocks name it, as its own block does."""
    return Point(point.behavior.partition(":")[2], point.sync)


def block_of(point: Point) -> str:
    """Id of the block of a point that is named as other blocks name it."""
    return point.behavior.partition(":")[0]


def is_foreign(name: str) -> bool:
    """True for the name of a behavior of another block."""
    return ":" in name


def is_named_in(block: str, foreign: Iterable[Point]) -> bool:
    """True if one of these points of other blocks is of the block of that id."""
    return any(block_of(point) == block for point in foreign)


def holders_of(
    block: str,
    chains: Mapping[str, Chain],
    estimates: Mapping[str, Estimate],
    natural: Container[str],
    kept: frozenset[Point],
    over: Container[str],
    reached: Callable[[str], int],
    takers: Mapping[str, str],
) -> Iterator[tuple[str, Holder]]:
    """Behaviors of a live block that have parts of the body or will have them, by `block:behavior`.

    kept: points that something waits for. over: behaviors that have ended or do not count. reached: number of points
    of a behavior that have been. takers: behaviors that hand their parts over to the block that is planned, each with
    the one there that takes them.
    """
    for id, chain in chains.items():
        if chain.parts and id not in over:
            renamed = replace(chain, points=tuple([qualified(block, point) for point in chain.points]))
            held = frozenset(qualified(block, point) for point in kept.intersection(chain.points))
            taker = takers.get(id, "")
            yield f"{block}:{id}", Holder(renamed, id in natural, held, estimates.get(id), reached(id), taker)


BLOCK_END = Point(BLOCK_ITSELF, "end")
"""The end of a block, as its own live block names it."""
BLOCK_START = Point(BLOCK_ITSELF, "start")

"""Live blocks as others see them: their sync points, expected, reached or lost; and blocks that have ended.

Points of one block may be tied to points of another. So each that is performed, or waits for its turn, tells here
when its points are expected, and hears of those that it follows.

A manager that streams blocks cannot know whether the one that it names still runs when its message arrives. So what
has ended stays known for a while; the time and the number are bounded, so that nothing grows.
"""

from abc import ABC, abstractmethod
from collections import Counter, OrderedDict, deque
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Set
from contextlib import contextmanager
from math import inf
from typing import Generic, TypeVar

from engage_hri.schemas.blocks import Block
from engage_hri.schemas.references import BLOCK_ITSELF, LONGEST_ID, with_names
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.known import BLOCK_END, BLOCK_START, at_home, block_of, qualified
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.relations import LASTING, extent
from engage_hri.services.realizer.points import EPSILON, LIFE, Point, frozen

MOST = 20_000
"""Greatest size of all that is known of the past; a block counts as its elements. Ten of the largest blocks."""

Ended = TypeVar("Ended")


class Past(Generic[Ended]):
    """Blocks that have ended, by id: the latest of each, for `LASTING` seconds, and no more than `MOST` in all."""

    def __init__(self, now: Callable[[], Seconds]) -> None:
        self._now = now
        self._ended: OrderedDict[str, tuple[Seconds, int, Ended]] = OrderedDict()
        """When it ended, its size, and itself; in the order of the ends."""
        self._size = 0

    def add(self, id: str, thing: Ended, size: int = 1) -> list[Ended]:
        """Remember what ends now, in place of another of its id; returns what is forgotten for it."""
        self.take_out(id)
        self._ended[id] = (self._now(), size, thing)
        self._size += size
        gone = list[Ended]()
        while self._ended:
            oldest, (at, _, before) = next(iter(self._ended.items()))
            if at >= self._now() - LASTING and self._size <= MOST:
                break
            self.take_out(oldest)
            gone.append(before)
        return gone

    def take_out(self, id: str) -> Ended | None:
        """Forget what has this id, and return it."""
        if (found := self._ended.pop(id, None)) is None:
            return None
        self._size -= found[1]
        return found[2]

    def get(self, id: str) -> Ended | None:
        """The block of this id; None: nothing is known of it."""
        found = self._ended.get(id)
        return found[2] if found is not None and found[0] >= self._now() - LASTING else None

    def all(self) -> dict[str, Ended]:
        """All that is known, by id."""
        since = self._now() - LASTING
        return {id: thing for id, (at, _, thing) in self._ended.items() if at >= since}


MOST_TELLINGS = 20
"""Most changes of one expected time that are told in a row. Blocks that wait for each other, by a tie and by a part
that changes hands, may never agree on a time; they go on when something is measured."""


class Neighbor(ABC):
    """A live block, as other live blocks see it: it is being performed, or waits for its turn.

    Points of others are named `block:behavior`. leaders: blocks that have to end before it begins.
    """

    leaders: Collection[str] = ()

    @property
    @abstractmethod
    def newest_plan(self) -> Plan:
        """The plan that it follows now, or would follow if its turn came."""

    @abstractmethod
    def times(self) -> Mapping[Point, Seconds]:
        """Time of each point, measured or expected, by the loop's clock."""

    @abstractmethod
    def follow(self, points: Iterable[Point]) -> None:
        """Tell from now on when these points are expected: others are tied to them."""

    # -- news of other blocks ------------------------------------------------------------------------------------

    @abstractmethod
    def hear(self, point: Point, at: Seconds) -> None:
        """Take the news that a point of another block is reached."""

    @abstractmethod
    def foresee(self, point: Point, at: Seconds) -> None:
        """Take the news that a point of another block is expected at another time than before."""

    @abstractmethod
    def miss(self, behaviors: Iterable[str]) -> None:
        """Take the news that no more points of these behaviors will be reached."""

    # -- holds: a point is stuck if it does not come before what is held goes on ---------------------------------

    @abstractmethod
    def stuck(self, elsewhere: Set[Point], standing: Set[Point]) -> Set[Point]:
        """Points that others are tied to and that are stuck.

        elsewhere: points of other blocks that are. standing: those of them that come no nearer either.
        """

    @abstractmethod
    def running(self, elsewhere: Set[Point], running: Set[Point]) -> Set[Point]:
        """Points that others are tied to and that come nearer. running: those of other blocks that do."""

    @abstractmethod
    def stick(self, elsewhere: Set[Point], standing: Set[Point]) -> None:
        """Take the news which points of other blocks are stuck, and which come no nearer either."""


class _Tracked:
    """Points of one block that others may be tied to.

    others: blocks that were known when it came, and that it may name. number: of blocks that had come by then. lost:
    behaviors that were dropped. named: points that others are tied to. expected: the last expected time of each of
    these points that was told.
    """

    __slots__ = ("block", "expected", "followers", "lost", "named", "number", "others", "performance", "reached")

    def __init__(self, block: Block, others: Mapping[str, "_Tracked"], number: int) -> None:
        self.block = block
        self.others = others
        self.number = number
        self.performance: Neighbor | None = None
        self.named: set[Point] = set()
        self.expected: dict[Point, Seconds] = {}
        self.reached: dict[Point, Seconds] = {}
        self.lost: frozenset[str] = frozen()
        self.followers: list[Neighbor] = []

    def end(self) -> None:
        """Forget all that only a live block needs: what it referred to, and who asked for its times."""
        self.others, self.performance, self.followers = {}, None, []


class LiveBlocks:
    """All live blocks, from their request to their end; and for a while those that have ended (`Past`).

    Ids are free again after the end. But blocks that live may still think of the one that has ended: of its points,
    of the parts that it had. So another of its id has another name here, as long as they live.
    """

    def __init__(self, now: Callable[[], Seconds]) -> None:
        self._tracked: dict[str, _Tracked] = {}
        self._past = Past[_Tracked](now)
        """Blocks that have ended, by name: a point of theirs that was reached is past, any other is lost."""
        self._names: dict[str, str] = {}
        """Name of each block that is live or of the past, by its id."""
        self._forgotten: dict[str, int] = {}
        """For each name that is not free yet, in the order of their ends, how many blocks had come by then."""
        self._count = 0
        self._untold: deque[tuple[_Tracked, Point, Seconds]] = deque()
        """Expected times that followers have yet to be told. What these expect because of them is told after that."""
        self._is_telling = False
        self._is_finding = False
        self._may_be_stuck = False
        """True if what is stuck has to be found again."""

    @contextmanager
    def opened(self, block: Block) -> Iterator[Block]:
        """Keep the block as live inside the `with`. Gives it with names for ids: its own, and those it refers to."""
        id = block.id
        self._forget(self._past.take_out(self._names.get(id, "")))
        name = self._names[id] = self._free_name(id)
        if changed := {each: other for each, other in self._names.items() if each != other}:
            block = with_names(block, changed)
        self._count += 1
        tracked = self._tracked[name] = _Tracked(block, {**self._past.all(), **self._tracked}, self._count)
        try:
            yield block
        finally:
            del self._tracked[name]
            self._forget(*self._past.add(name, tracked, 1 + extent(block)))
            ends = (BLOCK_ITSELF, *(behavior.id for behavior in block.behaviors))
            followers = tracked.followers
            tracked.end()
            for follower in followers:
                follower.miss(f"{name}:{id}" for id in ends)

    def _forget(self, *past: _Tracked | None) -> None:
        """Forget blocks of the past; their names are not free before all that live have ended."""
        gone = {each.block.id for each in past if each is not None}
        self._names = {id: name for id, name in self._names.items() if name not in gone} if gone else self._names
        self._forgotten |= dict.fromkeys(gone, self._count)
        oldest = next(iter(self._tracked.values())).number if self._tracked else inf
        while self._forgotten and (first := next(iter(self._forgotten.items())))[1] < oldest:
            del self._forgotten[first[0]]

    def _free_name(self, id: str) -> str:
        is_free = id not in self._tracked and id not in self._forgotten
        return id if is_free else f"{id[: LONGEST_ID - 16]}{LIFE}{self._count}"

    def is_live(self, id: str) -> bool:
        """True if a block of this id is live."""
        return self._names.get(id) in self._tracked

    def named_by(self, name: str) -> Mapping[str, Block]:
        """The blocks that a live one may name, live or of the past, by name."""
        return {id: tracked.block for id, tracked in self._tracked[name].others.items()}

    @property
    def blocks(self) -> Mapping[str, Block]:
        """The live blocks, by name."""
        return {id: tracked.block for id, tracked in self._tracked.items()}

    def named(self, block: str) -> Set[Point]:
        """Points of a live block that others wait for."""
        return self._tracked[block].named

    def reached(self, block: str) -> Mapping[Point, Seconds]:
        """Points that a block has reached, by loop time; none if it is not known any more."""
        tracked = self._find(block)
        return tracked.reached if tracked is not None else {}

    def is_past(self, point: Point) -> bool:
        """True if a point, named as other blocks name it, is reached, or its block not live any more."""
        tracked = self._tracked.get(block_of(point))
        return tracked is None or at_home(point) in tracked.reached

    def is_lost(self, point: Point) -> bool:
        """True if a point, named as other blocks name it, has not been reached and never will be."""
        home, named = self._find(block_of(point)), at_home(point)
        if home is None:
            return True
        is_over = named.behavior in home.lost or self._tracked.get(block_of(point)) is not home
        return is_over and named not in home.reached

    def times(self, block: str) -> Mapping[Point, Seconds]:
        """Times of the points of a live block, measured or expected; none if it is yet to be planned."""
        tracked = self._tracked.get(block)
        return tracked.performance.times() if tracked is not None and tracked.performance is not None else {}

    @property
    def plans(self) -> list[tuple[Plan, Collection[str]]]:
        """Plans of all live blocks that have been planned, and the blocks that have to end before each begins."""
        performances = (tracked.performance for tracked in self._tracked.values())
        return [(each.newest_plan, each.leaders) for each in performances if each is not None]

    def _find(self, name: str) -> _Tracked | None:
        """A live block, or one that has ended, as long as it is of the past or blocks live that name it."""
        if (known := self._tracked.get(name) or self._past.get(name)) is not None:
            return known
        return next((each.others[name] for each in self._tracked.values() if name in each.others), None)

    def reach(self, block: str, point: Point, at: Seconds) -> None:
        """Tell followers that a point of a live block is reached. The block itself is the behavior `bml`."""
        tracked = self._tracked[block]
        tracked.reached[point] = at
        for follower in list(tracked.followers):
            follower.hear(qualified(block, point), at)

    def perform(self, block: str, performance: Neighbor, named: Container[str] = ()) -> None:
        """Note that `performance` performs the block now, or lets it wait: it is asked for its expected times.

        named: other blocks that it refers to, whatever its plan says.
        """
        tracked = self._tracked[block]
        tracked.performance = performance
        planned = set(map(block_of, performance.newest_plan.foreign))
        tracked.others = {id: each for id, each in tracked.others.items() if id in planned or id in named}
        performance.follow(tracked.named)

    def foresee(self, block: str, expected: Mapping[Point, Seconds]) -> None:
        """Tell followers when points of a live block are expected, if that is news."""
        tracked = self._tracked[block]
        for point, at in expected.items():
            if abs(at - tracked.expected.get(point, inf)) > EPSILON:
                tracked.expected[point] = at
                self._untold.append((tracked, point, at))
        if self._is_telling:
            return  # The call below tells it: a chain of blocks may be longer than calls may be nested.
        self._is_telling = True
        try:
            told: Counter[tuple[str, Point]] = Counter()
            while self._untold:
                tracked, point, at = self._untold.popleft()
                told[tracked.block.id, point] += 1
                if told[tracked.block.id, point] > MOST_TELLINGS:
                    continue
                for follower in list(tracked.followers):
                    follower.foresee(qualified(tracked.block.id, point), at)
        finally:
            self._is_telling = False

    def tell_stuck(self) -> None:
        """Tell each block which points of the others do not come before what is held goes on.

        To be called whenever something is held, or not any more, and at news of any block while something is. It is
        found from the beginning each time: two blocks do not wait for each other once nothing is held.
        """
        self._may_be_stuck = True
        if self._is_finding:
            return  # The call below finds and tells it.
        self._is_finding = True
        try:
            while self._may_be_stuck:
                self._may_be_stuck = False
                stuck, standing = self._stuck()
                for tracked in list(self._tracked.values()):
                    if tracked.performance is not None:
                        tracked.performance.stick(stuck, standing)
        finally:
            self._is_finding = False

    def _stuck(self) -> tuple[Set[Point], Set[Point]]:
        """Points of all blocks that are stuck, and those of them that come no nearer either."""
        first = self._found(lambda block, found: block.stuck(found, frozenset()))
        standing = first - self._found(lambda block, found: block.running(first, found))
        return self._found(lambda block, found: block.stuck(found, standing)), standing

    def _found(self, more: Callable[[Neighbor, Set[Point]], Set[Point]]) -> Set[Point]:
        """Points of all blocks that follow from each other, and from nothing."""
        found: set[Point] = set()
        before = -1
        while len(found) > before:
            before = len(found)
            for name, tracked in self._tracked.items():
                if tracked.performance is not None:
                    found |= {qualified(name, point) for point in more(tracked.performance, found)}
        return found

    def lose(self, block: str, behavior: str) -> None:
        """Tell followers that a behavior of a live block is dropped; once for each behavior."""
        tracked = self._tracked[block]
        if behavior in tracked.lost:
            return
        tracked.lost |= {behavior}
        for follower in list(tracked.followers):
            follower.miss((f"{block}:{behavior}",))

    @contextmanager
    def followed(self, follower: Neighbor, points: Iterable[Point]) -> Iterator[None]:
        """Tell `follower` what becomes of these points of other blocks, and what already has."""
        self.follow(follower, points)
        try:
            yield
        finally:
            for tracked in self._tracked.values():
                if follower in tracked.followers:
                    tracked.followers.remove(follower)

    def follow(self, follower: Neighbor, points: Iterable[Point]) -> None:
        """Tell `follower` from now on what becomes of these points of other blocks, and what already has."""
        wanted = sorted(points)
        found = {name: self._find(name) for name in map(block_of, wanted)}
        homes = {id: tracked for id, tracked in found.items() if tracked is not None}
        for name, tracked in homes.items():
            if name in self._tracked and follower not in tracked.followers:
                tracked.followers.append(follower)
        for point in wanted:
            block = block_of(point)
            named = at_home(point)
            home = homes.get(block)
            if home is not None and (at := home.reached.get(named)) is not None:
                follower.hear(point, at)
            elif home is None or self.is_lost(point):
                follower.miss((point.behavior,))
            else:
                home.named.add(named)
                if (expected := home.expected.get(named)) is not None:
                    follower.foresee(point, expected)
        for id, tracked in homes.items():
            if tracked.performance is not None and self._tracked.get(id) is tracked:
                tracked.performance.follow(tracked.named)


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

"""Other live blocks in the plan of a block: when their points come, and who waits for a part that they have.

The others are given: what they were promised is not taken from them. A behavior that has made its stroke hands its
part over and loses its way home, as within one block; before that, who comes waits, or uses the other arm, or does
without. Points of theirs that this block names are times in its schedule, and may leave no time for a behavior of it.
"""

from collections.abc import Callable, Collection, Container, Iterable, Iterator, Mapping, Set
from math import inf

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.body import Estimate
from engage_hri.schemas.references import BLOCK_ITSELF
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.facts import NO_STOPS, Stops
from engage_hri.services.realizer.plan.assembly import Assembly
from engage_hri.services.realizer.plan.handover import (
    RELAX,
    Arrangement,
    Conflict,
    Hands,
    Turn,
    is_overlaid,
    last_kept,
    least,
    leaving,
    window,
)
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import Elsewhere, Equal, Relations, Term
from engage_hri.services.realizer.plan.schedule import Awaited
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


def share(
    chains: Mapping[str, Chain],
    relations: Relations,
    known: Known,
    arranged: Arrangement,
    times: Mapping[Point, Seconds],
    hands: Hands,
    assembly: Assembly,
    undated: Container[str] = (),
) -> tuple[Arrangement, list[Conflict]]:
    """The arrangement with the handovers from and to behaviors of other live blocks, and the conflicts with them.

    times: of the points of this block, in the schedule that `arranged` is for, and of others. hands: as of `arrange`.
    assembly: the net of that schedule. undated: behaviors that wait for points of which nobody knows yet when they
    come; once it is known they are planned again.
    """
    if not known.holders and not known.given:
        return arranged, []
    shared = _Sharing(chains, relations, known, arranged, times, hands, assembly)
    for id in chains:
        shared.give(id)
        for name in shared.rivals(id) if id not in undated else ():
            shared.settle(id, name)
        shared.keep_taking(id)
    lasting = tuple(sorted(arranged.natural - shared.successors.keys()))
    return (
        replace(arranged, lasting=lasting, successors=shared.successors, cuts=shared.cuts, takes=shared.takes),
        shared.conflicts,
    )


class _Sharing:
    def __init__(
        self,
        chains: Mapping[str, Chain],
        relations: Relations,
        known: Known,
        arranged: Arrangement,
        times: Mapping[Point, Seconds],
        hands: Hands,
        assembly: Assembly,
    ) -> None:
        self.assembly = assembly
        self.chains = chains
        self.known = known
        self.times = times
        self.hands = hands
        self.natural = arranged.natural
        self.successors = dict(arranged.successors)
        self.cuts = dict(arranged.cuts)
        self.takes = dict(arranged.takes)
        self.turns = arranged.turns
        self.conflicts: list[Conflict] = []
        self.held = relations.constrained
        self.mentioned = {point.behavior for point in relations.constrained}
        """Behaviors of which something is said. One that nobody asks for now waits until the earlier has ended."""
        self.named = frozenset(point for point in relations.constrained if is_foreign(point.behavior))
        """Points of other blocks that this one is tied to. They keep their parts up to these."""
        self.users: dict[str, list[str]] = {}
        for name, holder in known.holders.items():
            for part in holder.chain.parts:
                self.users.setdefault(part, []).append(name)

    def rivals(self, id: str) -> Iterator[str]:
        """Behaviors of other blocks that have a part of this one while it does, in the order of their starts."""
        since, to = window(self.chains[id], self.times)
        for begins, ends, name in self._users_of(id):
            if since <= ends + EPSILON and (begins < to - EPSILON or begins <= since + EPSILON):
                yield name

    def _users_of(self, id: str) -> list[tuple[Seconds, Seconds, str]]:
        """Behaviors of other blocks that have a part of this one at any time: from when until when, in this order."""
        names = {name for part in self.chains[id].parts for name in self.users.get(part, ())}
        return sorted((*window(self.known.holders[name].chain, self.times), name) for name in names)

    def settle(self, id: str, name: str) -> None:
        """Settle between a behavior of this block and one of another that has the same part."""
        chain, holder = self.chains[id], self.known.holders[name]
        start, begins = self.times[chain.points[0]], self.times[holder.chain.points[0]]
        if begins > start + EPSILON:
            first = self._first_after(chain, begins)
            if first is None or is_overlaid(holder.chain, chain):
                return
            last = last_kept(chain, holder.chain, first, self.held, is_natural=id in self.natural, is_asked=True)
            if last is None and self._comes_too_late(chain, holder):
                last = first
            if last is None:
                self._hand_over(id, name, first)
            elif id not in self.known.begun:
                self._wait(id, self._release(id, holder, 1))
        elif is_overlaid(chain, holder.chain):
            if start < self.times[holder.chain.points[-1]] - EPSILON:
                self.cuts[id] = 0  # A shift takes nothing from a gaze.
        elif id not in self.known.begun:
            first = self._first_after(holder.chain, start)
            if first is not None and (point := self._needed(id, holder, first)) is not None:
                self._wait(id, point)
            elif (point := self._still_needed(id, holder, first)) is not None:
                self.conflicts.append(Conflict((id, point), None))
            elif first is None:
                return
            elif name not in self.takes or start < self.times[self.chains[self.takes[name]].points[0]] - EPSILON:
                self.takes[name] = id

    def _comes_too_late(self, chain: Chain, holder: Holder) -> bool:
        """True if what the behavior must have made comes only once the holder has begun: then that has the part."""
        needed = chain.points[: least(chain, holder.chain) + 1]
        return not coming_with(self.assembly, self.known, holder.chain.points[0]).isdisjoint(needed)

    def keep_taking(self, id: str) -> None:
        """Go on taking what is handed over to a behavior by plan: only for that does it end as this one begins.

        But not if this block is tied to the way home that is lost by it: it would wait for itself.
        """
        start = self.times[self.chains[id].points[0]]
        for begins, _, name in self._users_of(id):
            holder = self.known.holders[name]
            home = holder.chain.points[least(holder.chain) + 1 :]
            if holder.taker == id and begins <= start + EPSILON and self.named.isdisjoint(home):
                self.takes.setdefault(name, id)

    def give(self, id: str) -> None:
        """Hand the part over to the behavior of another block that takes it by that block's plan.

        That waits for what this one keeps, whenever it is expected. If that is the way home of one that lasts until
        something takes its place, it does not wait for who takes it: the two would wait for each other. Nor if that
        one waits for the end of this block.
        """
        if (taker := self.known.given.get(id)) is not None and taker in self.times:
            chain, kept = self.chains[id], self.held | self.known.kept
            first = self._first_after(chain, self.times[taker])
            least_kept = max([least(chain), *(number for number, point in enumerate(chain.points) if point in kept)])
            is_awaited = id in self.natural and least_kept >= leaving(chain)
            if first is not None and least_kept + 1 < len(chain.points) and not is_awaited:
                self._hand_over(id, taker.behavior, max(first, least_kept + 1))

    def _waits_for_home(self, id: str, taker: Point) -> bool:
        """True if who is to take the part waits for the way home of the behavior, or for the end of the block."""
        chain = self.chains[id]
        home = (BLOCK_END, *chain.points[leaving(chain) :])
        return not self.known.awaiting.get(taker, {}).keys().isdisjoint(home)

    def _first_after(self, chain: Chain, at: Seconds) -> int | None:
        """Number of the first point of a behavior that comes after `at`; None: it has ended by then."""
        numbers = (number for number, point in enumerate(chain.points) if self.times[point] > at + EPSILON)
        return next(numbers, None)

    def _hand_over(self, id: str, successor: str, first: int) -> None:
        if id in self.natural and self._waits_for_home(id, Point(successor, "start")):
            return
        if id in self.successors:
            before = Point(self.successors[id][0], "start")
            if self.times[before] <= self.times[Point(successor, "start")] + EPSILON:
                return
        if id in self.natural:
            first = min(first, RELAX)
        if first:
            self.successors[id] = (successor, self.chains[id].points[first])
            self.cuts[id] = first - 1

    def _needed(self, id: str, holder: Holder, first: int) -> Point | None:
        """The last point of the holder, from `first` on, that a behavior of this block must wait for."""
        kept = holder.kept | self.named
        is_asked = id in self.mentioned
        last = last_kept(holder.chain, self.chains[id], first, kept, is_natural=holder.is_natural, is_asked=is_asked)
        if last is None or self._lies_beneath(holder.chain.points[last], id):
            return None
        return holder.chain.points[last]

    def _lies_beneath(self, point: Point, id: str) -> bool:
        """True for the end of a shift that waits for the look which is to begin over it: then it lies beneath."""
        chain = self.known.holders[point.behavior].chain
        awaited = self.known.awaiting.get(point, {})
        return is_overlaid(chain, self.chains[id]) and any(each.behavior == id for each in awaited)

    def _still_needed(self, id: str, holder: Holder, first: int | None) -> Point | None:
        """A point that comes before a behavior of this block by plan, but which may turn out slow.

        first: number of the first point of the holder after that; None: it has ended by then, or does just then.
        """
        point = self._needed(id, holder, holder.reached)
        if point is None or (id, point) in self.turns:
            return None
        is_just_now = self.times[point] >= self.times[self.chains[id].points[0]] - EPSILON
        is_free = not is_just_now or point in self.named or is_behind(self.assembly, self.known, point, id)
        return None if first is None and is_free else point

    def _behind_all(self, id: str, point: Point) -> Point:
        """The point that a behavior waits for if it waits for `point`, and for whoever is in its way from then on."""
        since, to = window(self.chains[id], self.times)
        for begins, ends, name in self._users_of(id):
            holder, at = self.known.holders[name], self.times[point]
            if is_behind(self.assembly, self.known, holder.chain.points[0], id):
                continue
            if at < ends - EPSILON and at - EPSILON <= begins < at + to - since - EPSILON:
                point = self._release(id, holder, 1)
        return point

    def _release(self, id: str, holder: Holder, first: int) -> Point:
        """The point from which on the holder may lose its part to a behavior of this block."""
        return self._needed(id, holder, first) or holder.chain.points[first]

    def _wait(self, id: str, point: Point) -> None:
        turn: Turn = (id, self._behind_all(id, point))
        if turn in self.turns:
            return
        self.conflicts.append(Conflict(turn, self.hands.choose((id,))))


def naming_others(present: Relations, arrangement: Arrangement) -> Relations:
    """The relations, with the points of other blocks that the arrangement names, too."""
    points = {turn[1] for turn in arrangement.turns}
    points |= {Point(successor, "start") for successor, _ in arrangement.successors.values()}
    foreign = sorted(point for point in points - present.named if is_foreign(point.behavior))
    if not foreign:
        return present
    return replace(present, equals=(*present.equals, *(Equal((Term(each, 0.0, str(each)),)) for each in foreign)))


def needless_turns(
    turns: Collection[Turn], takes: Mapping[str, str], known: Known, chains: Mapping[str, Chain]
) -> set[Turn]:
    """Turns of behaviors that wait for the way home of one of another block, of which another here takes the part.

    That one saves it the way home, and who comes later waits for that one. takes: as of `Arrangement`.
    """
    found = set[Turn]()
    candidates = [turn for turn in turns if takes.get(turn[1].behavior, turn[0]) != turn[0]]
    waits = {(id, point.behavior) for id, point in turns} if candidates else set()
    for id, point in candidates:
        taker, holder = takes[point.behavior], known.holders[point.behavior].chain
        is_led = taker in chains and (id, taker) in waits and point in holder.points[least(holder) + 1 :]
        if is_led and set(chains[id].parts) & set(holder.parts) <= set(chains[taker].parts):
            found.add((id, point))
    return found


AFTER: Seconds = 0.001
"""Least time from a point to one that waits for it: who waits for itself waits for ever."""


def foreseen(assembly: Assembly, known: Known, doubted: Collection[Point]) -> dict[int, Seconds]:
    """Earliest times of transitions, as far as they are known beforehand. doubted: points not to count on."""
    found: dict[int, Seconds] = {}
    if known.points:
        for point, transition in assembly.at.items():
            if point not in doubted and (at := known.points.get(point)) is not None:
                found[transition] = max(at, found.get(transition, -inf))
    return found


def awaited(assembly: Assembly, known: Known, waived: Container[tuple[Point, Point]]) -> Iterator[Awaited]:
    """Ties of a schedule from points of this block to those of others that come after them.

    waived: pairs of such points that do not count.
    """
    for foreign, target in assembly.at.items() if known.awaiting else ():
        for own, seconds in known.awaiting.get(foreign, {}).items():
            source = len(assembly.members) - 1 if own == BLOCK_END else assembly.at.get(own, 0)
            if source and source != target and (own, foreign) not in waived:
                lag = max(seconds, AFTER)
                yield Awaited("order", source, target, lag, lag, pair=(own, foreign))


def is_behind(assembly: Assembly, known: Known, foreign: Point, behavior: str) -> bool:
    """True if a point of another block comes only after this behavior has begun."""
    awaited = known.awaiting.get(foreign, {})
    start = assembly.at[Point(behavior, "start")]
    later = assembly.net.later([start]) if awaited else ()
    return any(own == BLOCK_END or assembly.at.get(own) in later for own in awaited)


def coming_with(assembly: Assembly, known: Known, foreign: Point) -> set[Point]:
    """Points of this block that come only once a point of another one has, or a later one of that block."""
    block, at = block_of(foreign), known.points.get(foreign, inf) - EPSILON
    named = [each for each in assembly.at if is_foreign(each.behavior) and block_of(each) == block]
    later = assembly.net.later([assembly.at[each] for each in named if known.points.get(each, -inf) >= at])
    return {point for point, transition in assembly.at.items() if transition in later}


def without_date(assembly: Assembly, known: Known) -> set[str]:
    """Behaviors that begin after points of other blocks of which it is not known when they come."""
    dated = {*known.points, *known.lost}
    unknown = [at for point, at in assembly.at.items() if is_foreign(point.behavior) and point not in dated]
    later = assembly.net.later(unknown)
    return {point.behavior for point, at in assembly.at.items() if at in later and point.sync == "start"}

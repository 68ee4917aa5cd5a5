"""A plan of a block: what its planning comes to (planner.py), and what it promises.

*Promises.* What a block says of its points is held against when they come, as they are planned and as they are
measured. It is the one measure of what was kept: with two, a block would be told late that its plan calls on time.
Times of other blocks may leave no time for all that a block says, so a plan may break some of it (`compared`).

*Manner.* How short a phase can be depends on how it begins. Who passes a hold point on the way cannot change pace at
once; who stands there first sets out anew, with a gesture that is as small as it has to be. So a plan may let a
behavior stand for @

*Slack.* Who is early at a hold point by less than a stop costs is slower on its way, and does not stop.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from math import inf
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import PetriNet, Place
from engage_hri.services.realizer.plan.handover import Turn
from engage_hri.services.realizer.plan.known import BLOCK_END, Known, is_foreign
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import Equal, Order, Problem, Relations, Term, at_line
from engage_hri.services.realizer.points import EPSILON, ORIGIN, Member, Point, frozen

STAND: Seconds = 0.05
"""Seconds for which a behavior waits where it is to stand: a stop costs less, so that it has come to rest by then."""


class Manner(Struct, frozen=True):
    """stands: hold points at which behaviors stand. may_be_late: true to miss times, and lose no behavior.

    lost: why behaviors are dropped all the same: what the body promises leaves no time for them.
    """

    stands: frozenset[Point] = frozen()
    may_be_late: bool = False
    lost: tuple[Problem, ...] = ()


AT_EASE = Manner()
"""Nobody stands, and what cannot be on time is dropped: how a block is planned first."""
Late = Mapping[tuple[int, int], Seconds]
"""Upper bounds that a plan misses, by the transitions at their ends, and by how much."""


def standing(
    net: PetriNet, at: Mapping[Point, int], chains: Mapping[str, Chain], stands: frozenset[Point]
) -> PetriNet:
    """The net in which behaviors stand there. at: the transition of each point."""
    places = list(net.places)
    for point in sorted(stands):
        if (chain := chains.get(point.behavior)) is not None and point in chain.points:
            source, target = at[chain.points[0]], at[point]
            way = sum(each.natural for each in chain.segments[: chain.points.index(point)])
            if source != target:
                places.append(Place("order", source, target, way + STAND, way + STAND))
    return replace(net, places=tuple(places)) if len(places) > len(net.places) else net


def eased(net: PetriNet, times: Sequence[Seconds]) -> tuple[PetriNet, Late]:
    """The net with the bounds on what the block says as much later as these times miss them, and which those are.

    So whoever performs it hurries as the plan does, and no more.
    """
    late = {
        (each.source, each.target): by
        for each in net.bounds
        if not each.behavior and (by := times[each.source] + each.lag - times[each.target]) > EPSILON
    }
    bounds = [
        each if each.behavior else replace(each, lag=each.lag - late.get((each.source, each.target), 0.0))
        for each in net.bounds
    ]
    return replace(net, bounds=tuple(bounds)), late


class Broken(Struct, frozen=True):
    """Two points that do not come as a block says.

    early, late: the one that comes too early, and the one that comes too late for it. seconds: by which they are off.
    said: what the block says of them. last: the one of the two that came last. line: of the XML that says it; 0: not
    known.
    """

    early: Point
    late: Point
    seconds: Seconds
    said: str
    last: Point
    line: int = 0

    @property
    def point(self) -> Point:
        """The one of the two that is told of: the last, but no point of another block if one of this block is there,
        and not the block itself."""
        points = [point for point in (self.last, self.late, self.early) if point != ORIGIN]
        return next((point for point in points if not is_foreign(point.behavior)), points[0])

    @property
    def direction(self) -> str:
        """The way in which `point` is wrong."""
        return "later" if self.point == self.late else "earlier"

    def told(self, sync: str, verb: str, why: str = "") -> str:
        """The sentence of a warning, with its place.

        sync: the sync point of `point`, as the block spells it. verb: `came`, or `is planned`. why: the cause.
        """
        reason = f"{sync} {verb} {self.seconds:.2f} s {self.direction} than it should be: {self.said}"
        return at_line(self.line, "; ".join(filter(None, (reason, why))))


class _Same:
    """Terms that are one instant, and of those that have come the earliest and the latest."""

    __slots__ = ("ends", "terms")

    def __init__(self, equal: Equal) -> None:
        self.terms = equal.terms
        self.ends: tuple[tuple[Seconds, Point], tuple[Seconds, Point]] | None = None

    def come(self, term: Term, at: Seconds) -> Iterator[Broken]:
        here = (at + term.offset, term.point)
        earliest, latest = self.ends or (here, here)
        self.ends = min(here, earliest), max(here, latest)
        for early, late in ((here, latest), (earliest, here)):
            if late[0] > early[0]:
                said, line = " = ".join([each.text for each in self.terms]), max(each.line for each in self.terms)
                yield Broken(early[1], late[1], late[0] - early[0], said, term.point, line)


class _Ordered:
    """Two terms, of which the one is no earlier than the other."""

    __slots__ = ("_came", "_order")

    def __init__(self, order: Order) -> None:
        self._order = order
        self._came: dict[Term, Seconds] = {}

    def come(self, term: Term, at: Seconds) -> Iterator[Broken]:
        self._came[term] = at + term.offset
        if len(self._came) == 2:
            before, after = self._order.earlier, self._order.later
            if (seconds := self._came[before] - self._came[after]) > 0.0:
                said, line = f"{before.text} <= {after.text}", max(before.line, after.line)
                yield Broken(after.point, before.point, seconds, said, term.point, line)


class _Link(NamedTuple):
    """Something said of a point, and the link to what was said of it before: most points have one, which is small."""

    said: _Same | _Ordered
    term: Term
    before: "_Link | None"


class Promises:
    """Everything that a block says of its points, to be held against when they come, whoever comes wrong."""

    def __init__(self, relations: Relations) -> None:
        self._of: dict[Point, _Link] = {}
        for equal in relations.equals:
            self._take(_Same(equal), equal.terms)
        for order in relations.orders:
            self._take(_Ordered(order), (order.earlier, order.later))

    def _take(self, said: "_Same | _Ordered", terms: tuple[Term, ...]) -> None:
        for term in terms:
            self._of[term.point] = _Link(said, term, self._of.get(term.point))

    @property
    def points(self) -> tuple[Point, ...]:
        """The points of which something is said."""
        return tuple(self._of)

    def come(self, point: Point, at: Seconds) -> list[Broken]:
        """Note that a point comes `at` a time; returns what is broken with those that have come before."""
        links: list[_Link] = []
        link = self._of.get(point)
        while link is not None:
            links.append(link)
            link = link.before
        found = [broken for each in reversed(links) for broken in each.said.come(each.term, at)]
        return [each for each in found if each.early != each.late]


def broken_by(relations: Relations, times: Mapping[Point, Seconds]) -> list[Broken]:
    """Constraints that are broken if their points come at these times."""
    promises = Promises(relations)
    found: list[Broken] = []
    coming = [point for point in promises.points if point in times]
    for point in sorted(coming, key=times.__getitem__):
        found += [each for each in promises.come(point, times[point]) if each.seconds > EPSILON]
    return found


class Plan(Struct, frozen=True, kw_only=True, dict=True):
    """A planned block.

    schedule: of each transition of the net, seconds from the block's start, if all goes as estimated.
    block: with a hand for each gesture that must use a certain one. critical: the transitions that make the block as
    long as it is, from first to last.
    kept: for each behavior, the last point that it must pass itself. Who takes its part, in whatever block, may save
    it the rest.
    entering: behaviors in the order in which they take their parts: of two that begin at one instant, too.
    rounds: for each behavior, how many events of the instant in which it begins are measured before it, in a row.
    turns: behaviors that wait for a point of another before they take its part. holders: behaviors of other blocks
    that are waited for in this way, with their parts.
    behaviors: those that will be performed, in document order. dropped: those that will not, with `problems`.
    natural: behaviors that end when something takes their place, or with the block.
    waited_for: behaviors that the end of the block waits for. given_up: for each speech that lacks a time it should
    have, what the block said, with the warning.
    untied: points of other blocks that are not waited for, though the block names them: there is no time for it.
    relations: what the block says of these behaviors. broken: what of that the plan cannot keep, since times are
    fixed, another block has passed a point already, or the body cannot hurry so.
    manner: see there. late: bounds that the plan misses, though all that can hurry for them does.
    constrained: points that something waits for, or that are timed.
    successors: behaviors that hand their parts over, each with the one that takes them (`block:behavior` of another
    block), and the first of its points that comes by that. takes: behaviors of other blocks whose parts are taken.
    """

    block: Block
    behaviors: tuple[BlockBehavior, ...]
    net: PetriNet
    at: Mapping[Point, int]
    members: tuple[tuple[Member, ...], ...]
    schedule: tuple[Seconds, ...]
    chains: Mapping[str, Chain]
    estimates: Mapping[str, Estimate]
    natural: frozenset[str]
    required: frozenset[str]
    waited_for: frozenset[str]
    kept: Mapping[str, Point]
    entering: tuple[str, ...]
    relations: Relations
    rounds: Mapping[str, int] = {}
    turns: frozenset[Turn] = frozenset()
    manner: Manner = AT_EASE
    late: Late = {}
    holders: Mapping[str, tuple[str, ...]] = {}
    untied: frozenset[Point] = frozenset()
    broken: tuple[Broken, ...] = ()
    constrained: frozenset[Point] = frozenset()
    successors: Mapping[str, tuple[str, Point]] = {}
    takes: Mapping[str, str] = {}
    critical: tuple[int, ...] = ()
    dropped: tuple[str, ...] = ()
    given_up: Mapping[str, Mapping[str, Problem]] = {}
    problems: tuple[Problem, ...] = ()

    def predicted(self, point: Point) -> Seconds:
        """Seconds from the block's start to the point, if all goes as estimated."""
        return self.schedule[self.at[point]]

    @property
    def lateness(self) -> Seconds:
        """Most seconds by which the plan misses what the block says, as the body cannot hurry so."""
        return max(self.late.values(), default=0.0)

    @property
    def times(self) -> dict[Point, Seconds]:
        """Seconds from the block's start to each point, if all goes as estimated."""
        return {point: self.schedule[at] for point, at in self.at.items()}

    def begun_in_order(self, behaviors: Iterable[str]) -> list[str]:
        """Behaviors that begin at one instant in the order in which they are told: who waits for no measured event of
        that instant first, then as they take parts, and a torso first, since head and arms aim for where that is
        going to be."""
        rank = {
            id: (self.rounds.get(id, 0), "torso" not in self.chains[id].parts, number)
            for number, id in enumerate(self.entering)
        }
        return sorted(behaviors, key=rank.__getitem__)

    def transition(self, point: Point) -> int | None:
        """The transition of a point as other blocks may name it: the end of the block has one, too."""
        return len(self.net.transitions) - 1 if point == BLOCK_END else self.at.get(point)

    @cached_property
    def foreign(self) -> tuple[Point, ...]:
        """Points of other blocks that this one is tied to, or waits for."""
        return tuple([point for point in self.at if is_foreign(point.behavior)])

    def parts(self, behavior: str) -> set[str]:
        """Parts of the body that a behavior uses, by its estimate."""
        estimate = self.estimates.get(behavior)
        return set(estimate.parts) if estimate is not None else set()


BRIEF: Seconds = 0.05
"""Most seconds by which a behavior is slower on its way, so as not to stop."""
UNNOTICED: Seconds = 0.008
"""Seconds by which it may pass there too early; and by which a plan may miss what its block says, untold."""
BRAKING: Seconds = 0.1
"""Seconds before a hold point at which a movement that is to stop there begins to brake, at the most."""


def slack(plan: Plan, point: Point) -> Seconds:
    """Seconds by which a behavior may be early at a hold point that it shares with nobody, and not stop there.

    point: any that comes with the hold point.
    """
    members = plan.members[plan.at[point]]
    if len(members) > 1 or not members[0].can_wait or (hold := members[0].point) in plan.manner.stands:
        return 0.0
    chain = plan.chains[hold.behavior]
    number = next(index for index, each in enumerate(chain.points) if plan.at[each] == plan.at[hold]) - 1
    longest = chain.longest[number]
    room = inf if longest is None else longest - chain.segments[number].natural
    return min(BRIEF, max(0.0, room) + UNNOTICED)


def compared(plan: Plan, said: Relations, known: Known) -> Plan:
    """The plan with what it cannot keep of what the block says, and a copy of that: it has worked out nothing."""
    if not (known.points or plan.late):
        return replace(plan, relations=replace(plan.relations))
    times = known.with_own({point: plan.schedule[at] for point, at in plan.at.items()})
    broken = broken_by(said, times)
    return replace(plan, relations=replace(said), broken=tuple(broken))

"""Losses: who is to blame for what cannot be on time, and what is given up for it.

Points that wait for each other in a circle, or that have too little time, cost a behavior; only if there is none that
may be lost, the whole block is refused. Words are not lost for the sake of a time: a speech gives up the times that
cannot be kept, one after the other, before it is dropped.
"""

from collections.abc import Collection, Container, Iterable, Mapping, Sequence, Set
from itertools import accumulate
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import types_with
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place
from engage_hri.services.realizer.plan.handover import Ends, Turn, turns_in
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import BlockRefused, Classes, Equal, Order, Relations
from engage_hri.services.realizer.plan.schedule import Circle
from engage_hri.services.realizer.plan.words import (
    AS_IN_DRAFTS,
    LATER,
    Spelling,
    lines_by_point,
    lines_of_instants,
    other_part,
    see_lines,
    shortage,
    taken,
    waits_in,
    way_round,
)
from engage_hri.services.realizer.points import EPSILON, Point


class Times:
    """The relations of a block, of which some that place its speeches are given up."""

    def __init__(self, relations: Relations, speeches: Container[str]) -> None:
        """speeches: those whose times may be given up."""
        self._relations = relations
        self._equals: dict[int, Equal | None] = dict(enumerate(relations.equals))
        """By number; None: given up. The numbers of the orders are negative."""
        self._orders: dict[int, Order | None] = {-n: order for n, order in enumerate(relations.orders, 1)}
        self._naming: dict[Point, list[int]] = {}
        """Numbers of the relations that name a point."""
        named = [(n, [term.point for term in each.terms]) for n, each in enumerate(self._relations.equals)]
        named += [(-n, [each.earlier.point, each.later.point]) for n, each in enumerate(self._relations.orders, 1)]
        for number, points in named:
            for point in dict.fromkeys(points):
                if point.behavior in speeches:
                    self._naming.setdefault(point, []).append(number)

    def give_up(
        self, points: Sequence[Point], among: Container[Point], dropped: Container[str]
    ) -> tuple[Point, str] | None:
        """Give up one relation of a speech; returns the point and what the relation said of it: `s:end = 2`.

        It is one of the last point that has any, the speech's own timing before what others say; what a required
        behavior says is never given up. None: there is none left.

        points: of speeches, that cannot all be on time. among: points to which the relation ties it, if there is such
        a one. dropped: behaviors that are gone; what is tied to them is tied through them, and given up last.
        """
        for is_enough in (
            lambda others: any(each in among and each.behavior not in dropped for each in others),
            lambda others: any(each.behavior not in dropped for each in others),
            bool,
        ):
            for point in reversed(points):
                naming = self._naming.get(point, ())
                for number in sorted(naming, key=lambda each: (each < 0, not self._is_own(each, point))):
                    if is_enough(self._others(number, point)):
                        return point, self._without(number, point)
        return None

    def _is_own(self, number: int, point: Point) -> bool:
        equal = self._equals.get(number)
        return equal is not None and equal.behavior == point.behavior

    def _others(self, number: int, point: Point) -> list[Point]:
        """Points to which a relation ties the point; none if it is given up already, or must be kept."""
        if number < 0:
            order = self._orders[number]
            return [] if order is None else [end.point for end in (order.earlier, order.later) if end.point != point]
        equal = self._equals[number]
        if equal is None or equal.behavior in self._relations.required:
            return []
        named = [term.point for term in equal.terms]
        return [each for each in named if each != point] if point in named else []

    def _without(self, number: int, point: Point) -> str:
        """Give up what a relation says of the point; returns what it said."""
        if number < 0:
            order, self._orders[number] = self._orders[number], None
            return f"{order.earlier.text} <= {order.later.text}" if order is not None else ""
        equal = self._equals[number]
        assert equal is not None
        others = tuple([term for term in equal.terms if term.point != point])
        self._equals[number] = Equal(others) if not equal.behavior and len(others) > 1 else None
        return " = ".join([term.text for term in equal.terms])

    @property
    def left(self) -> Relations:
        """The relations that are left."""
        equals = tuple([each for each in self._equals.values() if each is not None])
        orders = tuple([each for each in self._orders.values() if each is not None])
        return replace(self._relations, equals=equals, orders=orders)


FACES = types_with(family="face", lasts=True)


class Loss(NamedTuple):
    """A behavior that cannot be on time, and why.

    points: those that cannot all be on time, if it is a speech: of all speeches that may give way, the first to do so
    last. among: points of all behaviors that have to do with it. turn: the wait that is impossible, if it is one.
    advice: what the author of the block can do. line: of what says so; 0: of the behavior.
    """

    behavior: str
    reason: str
    points: tuple[Point, ...] = ()
    among: frozenset[Point] = frozenset()
    turn: Turn | None = None
    advice: str = ""
    line: int = 0


def clashes(
    turns: Iterable[Turn],
    chains: Mapping[str, Chain],
    required: Collection[str],
    classes: Classes,
    times: Mapping[Point, Seconds] = {},
    spelling: Spelling = AS_IN_DRAFTS,
) -> list[Loss]:
    """Losses by turns that cannot be waited for, whatever the rest of the block: ties leave no time for both.

    times: of points, from the start of the block, as far as they are known.
    """
    rank = {id: number for number, id in enumerate(chains)}
    losses: dict[str, Loss] = {}
    stays: dict[str, str] = {}
    """For each lost behavior, the one that keeps the part instead."""
    for later, (earlier, sync) in sorted(turns, key=lambda turn: (rank[turn[0]], rank[turn[1].behavior])):
        if (stayed := stays.get(earlier, earlier)) != earlier:
            # Of another type, perhaps, without that point.
            earlier, sync = stayed, next((each.sync for each in chains[stayed].points if each.sync == sync), "end")
        free = [id for id in (earlier, later) if id not in required]
        if free and later not in losses and _clash(chains[earlier], sync, chains[later], classes):
            lost = max(free, key=rank.__getitem__)
            turn = (later, Point(earlier, sync))
            among = frozenset(chains[earlier].points + chains[later].points)
            reason = f"cannot be on time: {_in_the_way(turn, lost, chains, times.get(turn[1]), spelling)}"
            advice = _instead(turn, lost, chains, spelling)
            losses[lost] = Loss(lost, reason, chains[lost].points, among, turn, advice)
            stays[lost] = later if lost == earlier else earlier
    return list(losses.values())


def _in_the_way(turn: Turn, lost: str, chains: Mapping[str, Chain], at: Seconds | None, spelling: Spelling) -> str:
    """Say who has the part that `turn` is about, and until when; and, if that one is lost, for whose sake."""
    later, until = turn
    holder = until.behavior
    parts = [part for part in chains[later].parts if part in chains[holder].parts]
    if not parts:
        return f"{later} would have to wait for {spelling(until)}"
    has = taken(holder, parts, until, spelling, at=at)
    return has if lost == later else f"{has}, and {later} cannot wait for that"


def _instead(turn: Turn, lost: str, chains: Mapping[str, Chain], spelling: Spelling) -> str:
    later, holder = turn[0], turn[1].behavior
    other = holder if lost == later else later
    if all(chains[each].type in FACES for each in (lost, other)):
        return f"put both into one <face>, each as its <lexeme> or <facs>, or {LATER}"
    return other_part(lost, chains[lost].parts, chains[other].parts, spelling)


def _clash(earlier: Chain, sync: str, later: Chain, classes: Classes) -> bool:
    """True if two of their points are tied so closely that `later` has to start before `earlier` is at `sync`."""
    last = next(number for number, point in enumerate(earlier.points) if point.sync == sync)
    since_start = list(accumulate((each.shortest for each in later.segments), initial=0.0))
    left = list(accumulate((each.shortest for each in reversed(earlier.segments[:last])), initial=0.0))[::-1]
    ends = [(*classes.place(point), still) for point, still in zip(earlier.points, left, strict=False)]
    starts = [(*classes.place(point), gone) for point, gone in zip(later.points, since_start, strict=True)]
    return any(
        tied_to == other and end - start < still + gone - EPSILON
        for tied_to, start, still in ends
        for other, end, gone in starts
    )


def judge(
    circles: Sequence[Circle],
    net: PetriNet,
    chains: Mapping[str, Chain],
    relations: Relations,
    classes: Classes,
    block: str,
    turns: Mapping[Ends, Turn],
    spelling: Spelling = AS_IN_DRAFTS,
) -> list[Loss]:
    """The losses of impossible circles. turns: as of `by_ends`. Raises BlockRefused.

    A time that cannot be met costs a behavior, a speech only if there is no other, and of several the later in the
    document; waiting for each other costs the block, and so does a time that only what is required cannot meet.
    Each circle costs a behavior, unless one that is lost already was part of it.
    """
    case = _Case(net, chains, lines_by_point(relations), spelling)
    rank = {id: number for number, id in enumerate(chains) if id not in relations.required}
    found = [(_loss(circle, case, rank, turns), circle) for circle in circles]
    losses: dict[str, Loss] = {}
    for loss, circle in sorted(found, key=lambda each: rank[each[0].behavior] if each[0] else -1):
        if loss is not None and not _touched(circle, net) & losses.keys():
            losses[loss.behavior] = loss
    if losses:
        return list(losses.values())
    everybody = {id: number for number, id in enumerate(chains)}
    if (loss := _loss(circles[0], case, everybody, turns)) is not None:
        times = Times(replace(relations, required=relations.required - {loss.behavior}), {loss.behavior})
        own = [point for point in loss.points if point.behavior == loss.behavior]
        given_up = times.give_up(own, loss.among, ())
        otherwise = f"{given_up[1]} would be given up, and its words said" if given_up else "it would be dropped"
        advice = f"{loss.advice}; it is required: without `required` {otherwise}"
        where, line = f"{block}: {loss.behavior}", loss.line or chains[loss.behavior].behavior.line
        fault = Fault(reason=loss.reason, where=where, line=line, advice=advice)
        raise BlockRefused(fault, "IMPOSSIBLE_TO_SCHEDULE")
    raise _deadlock(circles[0], net, relations.orders, classes, block, chains, spelling)


class _Case(NamedTuple):
    """Block that is judged. lines: for each point that the block ties to another, the lines that do."""

    net: PetriNet
    chains: Mapping[str, Chain]
    lines: Mapping[Point, Set[int]]
    spelling: Spelling


def _loss(circle: Circle, case: _Case, rank: Mapping[str, int], turns: Mapping[Ends, Turn]) -> Loss | None:
    """The behavior that is to blame for a circle; None: the block. rank: place in the document if it may be dropped.

    Of two that must have the same part at the same time, the later. For a phase that is too long for the time it is
    given, its behavior; else the behavior with a phase that would have to be longer than it can be.
    """
    net, chains = case.net, case.chains
    ties = [tie for tie, _ in circle]
    turn = next(turns_in(turns, circle), None)
    slow = {tie.behavior for tie in ties if isinstance(tie, Place) and tie.kind == "phase"}
    quick = {tie.behavior for tie in ties if isinstance(tie, Bound) and tie.kind == "phase"}
    touched = _touched(circle, net)
    is_timed = any(tie.source == 0 for tie in ties)
    if turn or quick or is_timed or len([id for id in slow or touched if id in chains]) == 1:
        for group in ({turn[0], turn[1].behavior},) if turn else (slow, quick, touched):
            if free := group & rank.keys():
                lost = max(free, key=lambda id: (chains[id].type != "speech", rank[id]))
                among = frozenset(point for tie, _ in circle for point in net.transitions[tie.source].points)
                speeches = sorted(
                    (id for id in touched & rank.keys() if chains[id].type == "speech"), key=rank.__getitem__
                )
                points = [point for id in speeches for point in chains[id].points if point in among]
                reason, advice, line = _explained(circle, case, lost, turn)
                return Loss(lost, reason, tuple(points) if lost in speeches else (), among, turn, advice, line)
    return None


def _explained(circle: Circle, case: _Case, lost: str, turn: Turn | None) -> tuple[str, str, int]:
    """Reason, advice and line of the loss of a behavior to a circle."""
    net, chains, lines, spelling = case
    way = way_round(net, circle, spelling=spelling)
    lacks = shortage(net, circle, chains[lost], lines.keys())
    told = lacks.told(spelling) if lacks else ""
    if turn is not None and turn[1].behavior in chains:
        has = _in_the_way(turn, lost, chains, None, spelling)
        if lacks is None or lacks.amount == "wrong order":
            # The turn says the order already: what remains is why its behaviors come when they do.
            others = tuple([each for each in circle if each[0].kind != "series" or turn[0] != each[0].behavior])
            return (
                f"cannot be on time: {has}: {way_round(net, others, spelling=spelling)}",
                _instead(turn, lost, chains, spelling),
                0,
            )
        return f"cannot be on time: {has}, and {told}{way}", _instead(turn, lost, chains, spelling), 0
    said = {line for point in (lacks.since, lacks.to) for line in lines.get(point, ())} if lacks else set()
    own = chains[lost].behavior.line
    line = 0 if own in said else min(said, default=0)
    advice = f"{lacks.advice if lacks else 'change one of these times'}{see_lines(said - {line or own})}"
    return f"cannot be on time: {told}{way}", advice, line


def _touched(circle: Circle, net: PetriNet) -> set[str]:
    """Behaviors with a point in an instant of the circle."""
    return {point.behavior for tie, _ in circle for point in net.transitions[tie.source].points}


def _deadlock(
    circle: Circle,
    net: PetriNet,
    orders: Sequence[Order],
    classes: Classes,
    block: str,
    chains: Mapping[str, Chain],
    spelling: Spelling,
) -> BlockRefused:
    ties = [tie for tie, _ in circle]
    lines = sorted(
        {line for tie in ties for line in tie.lines} | lines_of_instants(ties, net, orders, classes, chains)
    )
    way = waits_in(net, circle, spelling)
    fault = Fault(
        reason=f"these points wait for each other in a circle: {way}",
        where=block,
        line=lines[0] if lines else 0,
        advice="leave one of them out" + (f"; see lines {', '.join(map(str, lines))}" if len(lines) > 1 else ""),
    )
    return BlockRefused(fault, "IMPOSSIBLE_TO_SCHEDULE")

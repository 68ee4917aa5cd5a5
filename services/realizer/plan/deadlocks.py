"""Blame for points that wait for each other in a circle: a behavior is dropped, or the whole block refused."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import accumulate, groupby
from typing import NamedTuple

from msgspec.structs import replace

from engage_hri.schemas.faults import Fault
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place
from engage_hri.services.realizer.plan.assembly import Assembly
from engage_hri.services.realizer.plan.given_up import times_of
from engage_hri.services.realizer.plan.handover import Turn
from engage_hri.services.realizer.plan.instants import Classes
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.prediction import Circle, Impossible
from engage_hri.services.realizer.plan.relations import BlockRefused, Order, Relations
from engage_hri.services.realizer.plan.steps import Steps
from engage_hri.services.realizer.points import EPSILON, Point


class Loss(NamedTuple):
    """A behavior that cannot be on time, and why.

    points: those that cannot all be on time, if it is a speech: of all speeches that may give way, the first to do so
    last. among: points of all behaviors that have to do with it. turn: the wait that is impossible, if it is one.
    """

    behavior: str
    reason: str
    points: tuple[Point, ...] = ()
    among: frozenset[Point] = frozenset()
    turn: Turn | None = None


class Losses(Exception):
    """Behaviors that cannot be on time, in document order: planning goes on without them."""

    def __init__(self, losses: Sequence[Loss]) -> None:
        self.losses = tuple(losses)
        super().__init__("; ".join(f"{loss.behavior} {loss.reason}" for loss in losses))


def clashes(
    turns: Iterable[Turn], chains: Mapping[str, Chain], required: Collection[str], classes: Classes
) -> Steps[list[Loss]]:
    """Losses by turns that cannot be waited for, whatever the rest of the block: ties leave no time for both."""
    rank = {id: number for number, id in enumerate(chains)}
    losses: dict[str, Loss] = {}
    stays: dict[str, str] = {}
    """For each lost behavior, the one that keeps the part instead."""
    for later, (earlier, sync) in sorted(turns, key=lambda turn: (rank[turn[0]], rank[turn[1].behavior])):
        yield 16
        if (stayed := stays.get(earlier, earlier)) != earlier:
            # Of another type, perhaps, without that point.
            earlier, sync = stayed, next((each.sync for each in chains[stayed].points if each.sync == sync), "end")
        free = [id for id in (earlier, later) if id not in required]
        if free and later not in losses and _clash(chains[earlier], sync, chains[later], classes):
            lost = max(free, key=rank.__getitem__)
            turn = (later, Point(earlier, sync))
            reason = f"cannot be on time: {later} would have to wait for {turn[1]}"
            among = frozenset(chains[earlier].points + chains[later].points)
            losses[lost] = Loss(lost, reason, chains[lost].points, among, turn)
            stays[lost] = later if lost == earlier else earlier
    return list(losses.values())


def _clash(earlier: Chain, sync: str, later: Chain, classes: Classes) -> bool:
    """True if two of their points are tied so closely that `later` has to start before `earlier` is at `sync`."""
    last = next(number for number, point in enumerate(earlier.points) if point.sync == sync)
    since_start = list(accumulate((each.shortest for each in later.segments), initial=0.0))
    left = list(accumulate((each.shortest for each in reversed(earlier.segments[:last])), initial=0.0))[::-1]
    return any(
        (apart := classes.offset_between(one, other)) is not None and apart < still + gone - EPSILON
        for one, still in zip(earlier.points, left, strict=False)
        for other, gone in zip(later.points, since_start, strict=True)
    )


def judge(
    impossible: Impossible,
    assembly: Assembly,
    chains: Mapping[str, Chain],
    relations: Relations,
    classes: Classes,
    block: str,
    turns: Collection[Turn],
) -> Steps[Losses | BlockRefused]:
    """The losses of impossible circles, or the refusal of the block.

    A time that cannot be met costs a behavior, a speech only if there is no other, and of several the later in the
    document; waiting for each other costs the block, and so does a time that only what is required cannot meet.
    Each circle costs a behavior, unless one that is lost already was part of it.
    """
    net = assembly.net
    rank = {id: number for number, id in enumerate(chains) if id not in relations.required}
    ends = {(assembly.at[turn[1]], assembly.at[Point(turn[0], "start")]): turn for turn in sorted(turns)}
    found = []
    for circle in impossible.circles:
        found.append((_loss(circle, net, rank, chains, ends), circle))
        yield 4 + 2 * len(circle)
    losses: dict[str, Loss] = {}
    for loss, circle in sorted(found, key=lambda each: rank[each[0].behavior] if each[0] else -1):
        yield len(circle)
        if loss is not None and not _touched(circle, net) & losses.keys():
            losses[loss.behavior] = loss
    if losses:
        return Losses(tuple(losses.values()))
    everybody = {id: number for number, id in enumerate(chains)}
    if (loss := _loss(impossible.circles[0], net, everybody, chains, ends)) is not None:
        times = yield from times_of(
            {loss.behavior}, replace(relations, required=relations.required - {loss.behavior})
        )
        own = [point for point in loss.points if point.behavior == loss.behavior]
        given_up = times.give_up(own, loss.among, ())
        otherwise = f"{given_up[1]} would be given up, and its words said" if given_up else "it would be dropped"
        advice = f"it is required; without `required` {otherwise}"
        where, line = f"{block}: {loss.behavior}", chains[loss.behavior].behavior.line
        return BlockRefused(
            Fault(reason=loss.reason, where=where, line=line, advice=advice), "IMPOSSIBLE_TO_SCHEDULE"
        )
    return _deadlock(impossible.circles[0], net, relations.orders, classes, block)


def _loss(
    circle: Circle,
    net: PetriNet,
    rank: Mapping[str, int],
    chains: Mapping[str, Chain],
    turns: Mapping[tuple[int, int], Turn],
) -> Loss | None:
    """The behavior that is to blame for a circle; None: the block. rank: place in the document if it may be dropped.

    Of two that must have the same part at the same time, the later. For a phase that is too long for the time it is
    given, its behavior; else the behavior with a phase that would have to be longer than it can be.
    """
    ties = [tie for tie, _ in circle]
    series = ((tie.source, tie.target) for tie in ties if tie.kind == "series")
    turn = next((turns[ends] for ends in series if ends in turns), None)
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
                reason = f"cannot be on time: {_shortage(net, circle, lost)}{way_round(net, circle)}"
                return Loss(lost, reason, tuple(points) if lost in speeches else (), among, turn)
    return None


def _shortage(net: PetriNet, circle: Circle, lost: str) -> str:
    """Explain what takes more time than there is, if phases of the lost behavior do; else nothing."""
    own = [_phase_of(tie) == lost for tie, _ in circle]
    begin = [number for number, is_own in enumerate(own) if is_own and not own[number - 1]]
    first = next(iter(begin), 0)
    phases = [circle[number] for number in (*range(first, len(circle)), *range(first)) if own[number]]
    took = [(tie, seconds) for tie, seconds in phases if seconds > 0]
    needed, excess = sum(seconds for _, seconds in took), sum(seconds for _, seconds in circle)
    is_before = (time := needed - excess) < -EPSILON and len(begin) == 1
    if not (took or is_before):
        return ""
    shown = phases if is_before else took
    since, to = (net.transitions[end].name for end in (shown[0][0].source, shown[-1][0].target))
    if is_before:
        return f"{to} would come {-time:.2f} s before {since}: "
    return f"from {since} to {to} it takes {needed:.2f} s at least, and there are {max(0.0, time):.2f} s: "


def _touched(circle: Circle, net: PetriNet) -> set[str]:
    """Behaviors with a point in an instant of the circle."""
    return {point.behavior for tie, _ in circle for point in net.transitions[tie.source].points}


def _deadlock(circle: Circle, net: PetriNet, orders: Sequence[Order], classes: Classes, block: str) -> BlockRefused:
    ties = [tie for tie, _ in circle]
    lines = sorted({line for tie in ties for line in tie.lines} | _lines_of_instants(ties, net, orders, classes))
    fault = Fault(
        reason=f"these points wait for each other in a circle: {way_round(net, circle, is_timed=False)}",
        where=block,
        line=lines[0] if lines else 0,
        advice="leave one of them out" + (f"; see lines {', '.join(map(str, lines))}" if len(lines) > 1 else ""),
    )
    return BlockRefused(fault, "IMPOSSIBLE_TO_SCHEDULE")


def way_round(net: PetriNet, circle: Circle, *, is_timed: bool = True) -> str:
    """Words for each tie of a circle; phases of a behavior that follow one another are said as one.

    is_timed: False if it is a circle however long its behaviors take; then it is not said how long they do.
    """
    ours = [_phase_of(tie) for tie, _ in circle]
    first = next((number for number, id in enumerate(ours) if not id or id != ours[number - 1]), 0)
    said = []
    for id, run in groupby((*circle[first:], *circle[:first]), lambda each: _phase_of(each[0])):
        ties = list(run)
        if id:
            since, to = (net.transitions[end].name for end in (ties[0][0].source, ties[-1][0].target))
            long = f"takes {_seconds(sum(seconds for _, seconds in ties))}" if is_timed else "lasts"
            said.append(f"{id} {long} from {since} to {to}")
        else:
            said += [_said(net, tie, seconds) for tie, seconds in ties]
    return ", ".join(said)


def _phase_of(tie: Place | Bound) -> str:
    """The behavior of which a place is a phase; empty: it is none."""
    return tie.behavior if isinstance(tie, Place) and tie.kind == "phase" else ""


def _said(net: PetriNet, tie: Place | Bound, seconds: Seconds) -> str:
    """Words for a tie other than the phase of a behavior: `g:end is 2 s after bml:start`."""
    since, to = (net.transitions[end].name for end in (tie.source, tie.target))
    if isinstance(tie, Bound):
        if tie.kind == "phase":
            return f"{tie.behavior} takes at most {_seconds(-seconds)} from {to} to {since}"
        to, since, seconds = since, to, -seconds
    if tie.kind == "delay":
        return f"{to} is {_seconds(seconds)} after {since}"
    if isinstance(tie, Bound):
        return f"{to} is at most {_seconds(seconds)} after {since}" if seconds else f"{to} is not after {since}"
    return f"{to} is at least {_seconds(seconds)} after {since}" if seconds else f"{to} is not before {since}"


def _seconds(seconds: Seconds) -> str:
    return f"{round(seconds, 3) + 0.0:g} s"


def _lines_of_instants(
    ties: list[Place | Bound], net: PetriNet, orders: Sequence[Order], classes: Classes
) -> set[int]:
    """Lines that say that the points of an instant, or of one a fixed time later, belong together."""
    lines: set[int] = set()
    others = [tie for tie in ties if tie.kind != "delay"]
    for before, after in zip([*others[-1:], *others], others, strict=False):
        lines |= classes.lines(_ends(before, net, orders)[1], _ends(after, net, orders)[0])
    return lines


def _ends(tie: Place | Bound, net: PetriNet, orders: Sequence[Order]) -> tuple[Point, Point]:
    """The points that a tie is between: of its behavior, or those that are said to come in this order."""
    since, to = (net.transitions[end].points for end in (tie.source, tie.target))
    said = ((each.earlier.point, each.later.point) for each in orders)
    start, end = next((each for each in said if each[0] in since and each[1] in to), (since[0], to[0]))
    named = {point.behavior: point for point in reversed(since)}, {point.behavior: point for point in reversed(to)}
    return named[0].get(tie.behavior, start), named[1].get(tie.behavior, end)

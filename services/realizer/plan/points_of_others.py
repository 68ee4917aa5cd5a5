"""Points of other blocks in the schedule of a block: when they come, and what they leave no time for."""

from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from functools import partial
from math import inf

from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, Place
from engage_hri.services.realizer.plan.assembly import Assembly
from engage_hri.services.realizer.plan.deadlocks import Loss
from engage_hri.services.realizer.plan.handover import Turn
from engage_hri.services.realizer.plan.known import BLOCK_END, Known, block_of, is_foreign
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.prediction import Awaited, Foresight, Impossible
from engage_hri.services.realizer.plan.sharing import Waits
from engage_hri.services.realizer.plan.turns import by_ends, turns_in
from engage_hri.services.realizer.plan.words import AS_IN_DRAFTS, Spelling, other_part, taken
from engage_hri.services.realizer.points import EPSILON, Point

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
    for foreign, target in assembly.at.items():
        for own, seconds in known.awaiting.get(foreign, {}).items():
            source = len(assembly.members) - 1 if own == BLOCK_END else assembly.at.get(own, 0)
            if source and source != target and (own, foreign) not in waived:
                lag = max(seconds, AFTER)
                yield Awaited("order", source, target, lag, lag, pair=(own, foreign))


def lasting_for_ever(impossible: Impossible, assembly: Assembly, lasting: Iterable[str]) -> set[tuple[str, Point]]:
    """Behaviors that last for a point of another that waits, through another block, until they have left."""
    targets = {assembly.at[Point(id, "relax")]: id for id in lasting}
    found = set()
    for circle in impossible.circles:
        ties = [tie for tie, _ in circle]
        if any(isinstance(tie, Awaited) for tie in ties):
            found |= {
                (id, point)
                for tie in ties
                if isinstance(tie, Place) and tie.after and (id := targets.get(tie.target)) and tie.behavior == id
                for point in assembly.net.transitions[tie.source].points
                if point.behavior == tie.after
            }
    return found


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


def waits(assembly: Assembly, known: Known) -> Waits:
    return Waits(partial(is_behind, assembly, known), partial(coming_with, assembly, known))


def futile(impossible: Impossible) -> set[tuple[Point, Point]]:
    """Pairs of points, as of `awaited`, that wait for each other whatever is planned."""
    return {tie.pair for circle in impossible.circles for tie, _ in circle if isinstance(tie, Awaited)}


def idle(impossible: Impossible, assembly: Assembly, order: Sequence[str]) -> set[tuple[str, str]]:
    """Waits to leave out, as of `Assembly.waits`: of those in a circle that are mere custom only the last one.

    order: behaviors of the block as the document has them.
    """
    rank = {id: number for number, id in enumerate(order)}
    left_out = list[Place | Bound]()
    for circle in impossible.circles:
        ties = [tie for tie, _ in circle]
        customs = [tie for tie in ties if tie.kind == "series" and not tie.behavior]
        left_out += [tie for tie in ties if tie.kind != "series"]
        if customs:
            ranks = [max(rank.get(each.behavior, -1) for each in assembly.members[tie.target]) for tie in customs]
            left_out.append(customs[ranks.index(max(ranks))])
    return assembly.waits(left_out)


def losses_to_others(
    impossible: Impossible,
    assembly: Assembly,
    turns: Iterable[Turn],
    chains: Mapping[str, Chain],
    known: Known,
    spelling: Spelling = AS_IN_DRAFTS,
) -> list[Loss]:
    """Behaviors that have no time to wait until another block is done with their part, in document order.

    A speech gives up its times before it is lost: it may wait until the other has the voice no more.
    """
    ends = by_ends(turns, assembly.at)
    found = {}
    for circle in impossible.circles:
        if (turn := next(turns_in(ends, circle), None)) is not None and is_foreign(turn[1].behavior):
            ends_of_ties = {end for tie, _ in circle for end in (tie.source, tie.target)}
            among = frozenset(point for end in ends_of_ties for point in assembly.net.transitions[end].points)
            chain = chains[turn[0]]
            points = tuple(point for point in chain.points if chain.type == "speech" and point in among)
            reason, advice = _taken(turn, chains, known, spelling)
            found[turn[0]] = Loss(turn[0], reason, points, among, turn, advice)
    return [found[id] for id in chains if id in found]


def ties_within_turns(
    impossible: Impossible, assembly: Assembly, turns: Iterable[Turn], named: Container[Point]
) -> set[Point]:
    """Points of other blocks to which who waits for a part of them is tied, so that it would wait for itself.

    Where a time of the block is fixed besides, the tie is not to blame.
    """
    ends = by_ends(turns, assembly.at)
    found = set[Point]()
    for circle in impossible.circles:
        here = {end for tie, _ in circle for end in (tie.source, tie.target)}
        if (
            (turn := next(turns_in(ends, circle), None)) is not None
            and is_foreign(turn[1].behavior)
            and 0 not in here
        ):
            found.update(point for end in here for point in assembly.net.transitions[end].points if point in named)
    return {point for point in found if is_foreign(point.behavior)}


def _taken(turn: Turn, chains: Mapping[str, Chain], known: Known, spelling: Spelling) -> tuple[str, str]:
    """Reason and advice of the loss of a behavior that would have to wait for one of another block."""
    id, point = turn
    holder = known.holders[point.behavior].chain if point.behavior in known.holders else None
    held = holder.parts if holder is not None else chains[id].parts
    parts = [part for part in chains[id].parts if part in held]
    has = taken(point.behavior, parts, point, spelling, at=known.points.get(point))
    return f"cannot be on time: {has}", other_part(id, chains[id].parts, held, spelling)


def too_late(impossible: Impossible, assembly: Assembly) -> set[Point]:
    """Points that are expected too late for times that are fixed."""
    late = {tie.target for circle in impossible.circles for tie, _ in circle if isinstance(tie, Foresight)}
    return {point for number in late for point in assembly.net.transitions[number].points}


def without_date(assembly: Assembly, known: Known) -> set[str]:
    """Behaviors that begin after points of other blocks of which it is not known when they come."""
    dated = {*known.points, *known.lost}
    unknown = [at for point, at in assembly.at.items() if is_foreign(point.behavior) and point not in dated]
    later = assembly.net.later(unknown)
    return {point.behavior for point, at in assembly.at.items() if at in later and point.sync == "start"}

"""Behaviors of one block that move the same part: which takes it from which, and which must wait."""

from collections.abc import Collection, Container, Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from math import inf
from typing import NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gesture, Hand, Pointing
from engage_hri.schemas.syncref import SYNC_POINTS
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.plan.instants import Classes
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import Relations
from engage_hri.services.realizer.plan.schedule import EPSILON
from engage_hri.services.realizer.plan.steps import Steps
from engage_hri.services.realizer.points import SHIFTS, WITH_STROKE, Point

_OTHER: dict[str, tuple[str, Hand]] = {
    "left_arm": ("right_arm", "RIGHT_HAND"),
    "right_arm": ("left_arm", "LEFT_HAND"),
}
_STROKE, _STROKE_END, _RELAX = (SYNC_POINTS.index(each) for each in ("stroke", "stroke_end", "relax"))
"""Numbers of these points: every behavior that hands over has all seven."""
Turn = tuple[str, Point]
"""A behavior, and the point of another that it waits for before it takes its part."""


class Arrangement(Struct, frozen=True):
    """Order in which behaviors use parts of the body.

    natural: behaviors that end when something takes their place, or with the block; lasting: those with the block.
    successors: for a behavior, the one that takes its part, and the first of its points that this brings about.
    cuts: number of the first segment that is not given its time, because a successor has the part by then.
    turns: behaviors that wait for a point of another before they take its part.
    spoken: the speeches in the order in which they are said.
    takes: behaviors of other blocks, by `block:behavior`, of which one of this block takes a part over.
    """

    natural: frozenset[str] = frozenset()
    lasting: tuple[str, ...] = ()
    successors: Mapping[str, tuple[str, Point]] = {}
    cuts: Mapping[str, int] = {}
    turns: frozenset[Turn] = frozenset()
    spoken: tuple[str, ...] = ()
    takes: Mapping[str, str] = {}


class Conflict(NamedTuple):
    """Two behaviors that would have the same part at the same time.

    turn: the later, and the point of the earlier that it has to wait for. hand: the one that can use the other hand.
    """

    turn: Turn | None
    hand: tuple[str, Hand] | None


def arrange(
    chains: Mapping[str, Chain],
    relations: Relations,
    classes: Classes,
    before: Arrangement,
    times: Mapping[Point, Seconds],
    rounds: Mapping[Point, int],
    barred: Container[tuple[str, Hand]] = (),
    given: Mapping[str, Chain] = {},
) -> Steps[tuple[Arrangement, list[Conflict]]]:
    """The arrangement for a schedule that was made with `before`, and conflicts where it breaks what was asked for.

    rounds: order of points that come at one time. barred: hands with which a behavior cannot be done. given:
    behaviors of other blocks that have parts, with their `times`.
    """
    held = relations.held
    awaited: dict[str, set[Point]] = {}
    yield len(relations.orders) // 8
    for order in relations.orders:
        awaited.setdefault(order.later.point.behavior, set()).add(order.earlier.point)
    mentioned = {point.behavior for point in relations.constrained}
    successors, cuts = dict(before.successors), dict(before.cuts)
    conflicts = []
    yield len(chains) // 4
    ranked = entering(chains, mentioned, times, rounds)
    yield len(chains) // 4
    users = _users(chains, ranked)
    cuts.update(dict.fromkeys(_overlaid(chains, users, times), 0))
    yield len(chains) // 4
    for id, successor in _successors(chains, ranked, users).items():
        yield 1
        chain = chains[id]
        if before.successors.get(successor, ("",))[0] == id:
            # Either would come first if the other cut it short. So neither is cut: the one meant to be later waits.
            conflicts.append(Conflict((id, chains[successor].points[-1]), None))
            continue
        if chain.type == "speech" and is_tied(chains[successor], chain, classes):
            continue
        taken = times[Point(successor, "start")]
        first = next((number for number, point in enumerate(chain.points) if times[point] > taken + EPSILON), 0)
        is_natural = id in before.natural
        if first:
            # Points that the successor itself is to come after are kept: cut short, they would come at once.
            own = awaited.get(successor, set())
            kept = {point for point in chain.points if point in held or point in own}
            is_asked = successor in mentioned or _is_overlaid(chain, chains[successor])
            last = _not_given_up(chain, first, kept, is_natural, is_asked=is_asked)
            turn = (successor, chain.points[last]) if last is not None else None
            # A behavior that has made its stroke hands over; for one that has not, a free other arm is better.
            is_worth_it = turn is not None or first <= _STROKE_END
            hand = free_hand((successor, id), {**chains, **given}, times, barred) if is_worth_it else None
            yield 1 + len(chains) // 32  # `free_hand` has looked at all others
            if turn or hand:
                conflicts.append(Conflict(turn, hand))
        if id in successors:
            continue
        if is_natural:
            first = min(first or _RELAX, _RELAX)
        if first:
            successors[id] = (successor, chain.points[first])
            cuts[id] = first - 1
    lasting = tuple(sorted(before.natural - successors.keys()))
    return replace(before, lasting=lasting, successors=successors, cuts=cuts), conflicts


def entering(
    chains: Mapping[str, Chain],
    mentioned: Collection[str],
    times: Mapping[Point, Seconds],
    rounds: Mapping[Point, int],
) -> tuple[str, ...]:
    """Behaviors in the order in which they take parts. Of those that start together, unmentioned ones come last."""
    rank = {
        id: (round(times[start := chain.points[0]], 6), rounds[start], id not in mentioned, number)
        for number, (id, chain) in enumerate(chains.items())
    }
    return tuple(sorted(chains, key=rank.__getitem__))


def _not_given_up(
    chain: Chain, first: int, kept: Collection[Point], is_natural: bool, *, is_asked: bool
) -> int | None:
    """Number of the last point, from `first` on, that a successor must wait for; None if there is none.

    Points count that share an instant with others or wait for them; all do if nothing asks for the successor now.
    Words are never given up.
    """
    broken = [number for number in range(first, len(chain.points)) if chain.points[number] in kept]
    if not is_asked or chain.type == "speech":
        broken.append(_STROKE if is_natural else len(chain.points) - 1)
    if not broken or broken[-1] < first:
        return None
    return max(broken[-1], _STROKE_END) if chain.type in WITH_STROKE else broken[-1]


def is_tied(later: Chain, speech: Chain, classes: Classes) -> bool:
    """True if the block itself says that `later` begins while the speech is spoken. The voice decides about that."""
    begins = classes.find(later.points[0])[0]
    return any(classes.find(point)[0] == begins for point in speech.points)


def _users(chains: Mapping[str, Chain], order: Iterable[str]) -> Mapping[str, Sequence[str]]:
    """For each part, the behaviors that use it, in the order in which they take it."""
    users: dict[str, list[str]] = {}
    for id in order:
        for part in chains[id].parts:
            users.setdefault(part, []).append(id)
    return users


def _successors(
    chains: Mapping[str, Chain], ranked: Sequence[str], users: Mapping[str, Sequence[str]]
) -> dict[str, str]:
    """For each behavior, the next that takes any of its parts."""
    rank = {id: number for number, id in enumerate(ranked)}
    found: dict[str, str] = {}
    for ids in users.values():
        for earlier, later in _pairs(ids, chains):
            if earlier not in found or rank[later] < rank[found[earlier]]:
                found[earlier] = later
    return found


def _pairs(users: Sequence[str], chains: Mapping[str, Chain]) -> Iterator[tuple[str, str]]:
    """Each user of a part, in order, and the next that takes it over: a shift takes nothing from a gaze."""
    above = [id for id in users if chains[id].type not in SHIFTS]
    yield from pairwise(above)
    yield from ((one, other) for one, other in pairwise(users) if chains[one].type in SHIFTS)


def _is_overlaid(earlier: Chain, later: Chain) -> bool:
    return earlier.type in SHIFTS and later.type not in SHIFTS


def _overlaid(
    chains: Mapping[str, Chain], users: Mapping[str, Sequence[str]], times: Mapping[Point, Seconds]
) -> Iterator[str]:
    """Shifts that start during a gaze."""
    for ids in users.values():
        until = -inf
        for id in ids:
            since, to = _window(chains[id], times)
            if chains[id].type not in SHIFTS:
                until = max(until, to)
            elif since < until - EPSILON:
                yield id


def free_hand(
    rivals: tuple[str, ...],
    chains: Mapping[str, Chain],
    times: Mapping[Point, Seconds],
    barred: Container[tuple[str, Hand]],
) -> tuple[str, Hand] | None:
    """The one of these that can use the other arm, since it names none and the arm is free all the while."""
    for id in rivals:
        chain = chains[id]
        other = _OTHER.get(chain.parts[0]) if len(chain.parts) == 1 else None
        if other is None or not isinstance(chain.behavior, Pointing | Gesture) or chain.behavior.mode is not None:
            continue
        arm, hand = other
        if (id, hand) in barred:
            continue
        if _is_free(arm, _window(chain, times), (each for each in chains.values() if each is not chain), times):
            return id, hand
    return None


def _window(chain: Chain, times: Mapping[Point, Seconds]) -> tuple[Seconds, Seconds]:
    return times[chain.points[0]], times[chain.points[-1]]


def _is_free(
    arm: str, window: tuple[Seconds, Seconds], others: Iterable[Chain], times: Mapping[Point, Seconds]
) -> bool:
    since, to = window
    windows: Sequence[tuple[Seconds, Seconds]] = [_window(each, times) for each in others if arm in each.parts]
    return all(end <= since + EPSILON or start >= to - EPSILON for start, end in windows)

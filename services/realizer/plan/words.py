"""Words for why a block cannot be as it says: who is in the way, what takes how long, and what its author can do.

Sync points are spelled as the block spells them.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import groupby
from typing import Literal, NamedTuple

from engage_hri.schemas.behavior_types import dialect_sync, same_instant
from engage_hri.schemas.behaviors import Gesture, Hand, Pointing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.references import type_name
from engage_hri.schemas.units import Seconds
from engage_hri.services.realizer.net.petri_net import Bound, PetriNet, Place, Transition
from engage_hri.services.realizer.plan.phases import ARMS, Chain
from engage_hri.services.realizer.plan.relations import Classes, Elsewhere, Order, Relations
from engage_hri.services.realizer.plan.schedule import Circle
from engage_hri.services.realizer.points import EPSILON, FINISH, ORIGIN, Point

Tie = Place | Bound
OTHER_HAND: Mapping[Hand, Hand] = {"LEFT_HAND": "RIGHT_HAND", "RIGHT_HAND": "LEFT_HAND"}
LATER = "let one of the two begin later"


class Spelling:
    """Names of sync points as the author of a block writes them. elsewhere: other blocks that it may refer to."""

    def __init__(self, block: Block, elsewhere: Elsewhere | None = None) -> None:
        self._dialect = block.dialect
        self._elsewhere = elsewhere or {}
        self._types = {each.id: type_name(each) for each in block.behaviors} if block.dialect != "draft" else {}
        self.hands = {
            each.id: each.mode
            for each in block.behaviors
            if isinstance(each, Gesture | Pointing) and each.mode is not None
        }
        """Behaviors of which the block says with which hand they are done."""

    def sync(self, point: Point) -> str:
        """Name of the sync point alone."""
        if self._dialect == "draft":
            return point.sync
        type = self._type(point.behavior)
        return dialect_sync(same_instant(point.sync, type), type, self._dialect) or point.sync

    def _type(self, behavior: str) -> str:
        block, _, id = behavior.rpartition(":")
        if not block:
            return self._types.get(behavior, "")
        other = self._elsewhere.get(block)
        return next((type_name(each) for each in (other.behaviors if other else ()) if each.id == id), "")

    def __call__(self, point: Point) -> str:
        return f"{point.behavior or 'bml'}:{self.sync(point)}"

    def instant(self, transition: Transition) -> str:
        """Names of all points of an instant: `gaze-1:ready = point-1:start`."""
        return " = ".join(dict.fromkeys(map(self, transition.points))) or transition.name


AS_IN_DRAFTS = Spelling(Block(id=""))


# -- parts of the body ---------------------------------------------------------------------------------------------


def parts_named(parts: Iterable[str]) -> str:
    """Write parts of the body as `left arm and right arm`."""
    return " and ".join(part.replace("_", " ") for part in parts)


def taken(
    holder: str,
    parts: Iterable[str],
    until: Point,
    spelling: Spelling,
    *,
    at: Seconds | None = None,
    verb: Literal["has", "had"] = "has",
) -> str:
    """Say who has which part of the body, and until when. at: seconds from the start of the block, if known."""
    when = "" if at is None else f", {at:.2f} s after the start of the block"
    return f"{holder} {verb} the {parts_named(parts)} until {spelling(until)}{when}"


def other_part(lost: str, wanted: Collection[str], held: Collection[str], spelling: Spelling) -> str:
    """Say what to do for a behavior of which another has a part. wanted, held: the parts of the two."""
    if (mode := spelling.hands.get(lost)) is None:  # Where the block leaves it open, the other arm has been tried.
        return LATER
    free = [hand for hand in OTHER_HAND if not set(ARMS[hand]) & set(held)]
    if not set(wanted) <= set(ARMS["BOTH_HANDS"]) or len(free) != 1:
        return LATER
    words = "one hand" if mode == "BOTH_HANDS" else "the other hand"
    return f'use {words} with mode="{free[0]}", or {LATER}'


# -- circles of ties -----------------------------------------------------------------------------------------------


class Shortage(NamedTuple):
    """The time between two points of a behavior is not what it takes. amount: how it is off.

    takes, there: seconds that it takes, and that there are; negative: the points come in the wrong order.
    """

    since: Point
    to: Point
    amount: Literal["least", "most", "wrong order"]
    takes: Seconds
    there: Seconds

    def told(self, spelling: Spelling) -> str:
        since, to = spelling(self.since), spelling(self.to)
        if self.amount == "wrong order":
            return f"{to} would come {-self.there:.2f} s before {since}: "
        there = max(0.0, self.there)
        return f"from {since} to {to} it takes {self.takes:.2f} s at {self.amount}, and there are {there:.2f} s: "

    @property
    def advice(self) -> str:
        if self.amount == "wrong order":
            return "change one of its times"
        return f"give it {'more' if self.amount == 'least' else 'less'} time, or leave out one of its times"


def shortage(net: PetriNet, circle: Circle, lost: Chain, named: Collection[Point]) -> Shortage | None:
    """For what there is too little or too much time, if that is phases of the lost behavior; else None.

    named: points that the block names.
    """
    id = lost.behavior.id
    own = [phase_of(tie) == id for tie, _ in circle]
    begin = [number for number, is_own in enumerate(own) if is_own and not own[number - 1]]
    first = next(iter(begin), 0)
    phases = [circle[number] for number in (*range(first, len(circle)), *range(first)) if own[number]]
    excess = sum(seconds for _, seconds in circle)
    if not phases:
        return _excess(net, circle, lost, named)
    needed = sum(seconds for _, seconds in phases if seconds > 0)
    is_before = (time := needed - excess) < -EPSILON and len(begin) == 1
    if not (needed or is_before):
        return None
    ends = _ends_of_phases(net, [tie for tie, _ in phases], lost, named)
    return Shortage(*ends, "wrong order" if is_before else "least", needed, time)


def _excess(net: PetriNet, circle: Circle, lost: Chain, named: Collection[Point]) -> Shortage | None:
    """The time that is more than the behavior can take; None if that is not all that is wrong."""
    limits = [
        (tie, -seconds)
        for tie, seconds in circle
        if isinstance(tie, Bound) and tie.kind == "phase" and tie.behavior == lost.behavior.id
    ]
    if not limits or any(phase_of(tie) for tie, _ in circle):
        return None
    longest = sum(seconds for _, seconds in limits)
    time = longest + sum(seconds for _, seconds in circle)
    ends = _ends_of_phases(net, [tie for tie, _ in reversed(limits)], lost, named)
    return Shortage(*ends, "most", longest, time)


def _ends_of_phases(
    net: PetriNet, ties: Sequence[Tie], chain: Chain, named: Collection[Point] = ()
) -> tuple[Point, Point]:
    """The points of a behavior between which phases lie that follow one another. One that is named goes first."""
    first, last = _numbers(net, ties[0], chain), _numbers(net, ties[-1], chain)
    since = [point for point in _before(net, ties[0], chain, first[1]) if point in named]
    to = [point for point in _behind(net, ties[-1], chain, last[1]) if point in named]
    return next(reversed(since), chain.points[first[0]]), next(iter(to), chain.points[last[1]])


def _from_to(tie: Tie) -> tuple[int, int]:
    """The instants that a phase begins and ends with: a bound goes back."""
    return (tie.target, tie.source) if isinstance(tie, Bound) else (tie.source, tie.target)


def _numbers(net: PetriNet, tie: Tie, chain: Chain) -> tuple[int, int]:
    """Numbers of the points of a behavior that a phase is between; its instants may hold others of its points."""
    since, to = (
        [number for number, point in enumerate(chain.points) if point in net.transitions[end].points]
        for end in _from_to(tie)
    )
    return next((max(before), each) for each in to if (before := [other for other in since if other < each]))


def _before(net: PetriNet, tie: Tie, chain: Chain, number: int) -> list[Point]:
    """Points of the behavior in the instant where a phase begins that ends with the point of this number."""
    return [each for each in chain.points[:number] if each in net.transitions[_from_to(tie)[0]].points]


def _behind(net: PetriNet, tie: Tie, chain: Chain, number: int) -> list[Point]:
    """Points of the behavior in the instant where a phase ends, from the one of this number on."""
    return [each for each in chain.points[number:] if each in net.transitions[_from_to(tie)[1]].points]


def way_round(net: PetriNet, circle: Circle, *, spelling: Spelling = AS_IN_DRAFTS) -> str:
    """Words for each tie of a circle; phases of a behavior that follow one another are said as one."""
    if together := _together(net, circle):
        return f"{spelling.instant(together)} is one instant"
    said = []
    for id, ties in _runs(circle):
        if id:
            since, to = (spelling.instant(net.transitions[end]) for end in (ties[0][0].source, ties[-1][0].target))
            said.append(f"{id} takes {_seconds(sum(seconds for _, seconds in ties))} from {since} to {to}")
        else:
            said += [_said(net, tie, seconds, spelling) for tie, seconds in ties]
    return ", ".join(said)


def waits_in(net: PetriNet, circle: Circle, spelling: Spelling) -> str:
    """Words for a circle that is one however long its behaviors take: `a starts when b ends, b starts when a ends`.

    That a behavior ends after it starts needs no words.
    """
    runs = _runs(circle)
    said = []
    for (before, _), (id, ties) in zip([*runs[-1:], *runs], runs, strict=False):
        if not id:
            said += [_said(net, tie, seconds, spelling) for tie, seconds in ties]
        elif before:
            points = net.transitions[ties[0][0].source].points
            this, last = ([point for point in points if point.behavior == each] for each in (id, before))
            said.append(f"{_comes(this[0], spelling)} when {_comes(last[-1], spelling)}")
    return ", ".join(said)


def _comes(point: Point, spelling: Spelling) -> str:
    """Write `a starts`, `a ends`, or `a:stroke comes`."""
    return f"{point.behavior} {point.sync}s" if point.sync in ("start", "end") else f"{spelling(point)} comes"


def _runs(circle: Circle) -> list[tuple[str, Circle]]:
    """The ties of a circle, with phases of one behavior that follow one another together, and whose they are."""
    ours = [phase_of(tie) for tie, _ in circle]
    first = next((number for number, id in enumerate(ours) if not id or id != ours[number - 1]), 0)
    turned = (*circle[first:], *circle[:first])
    return [(id, tuple(run)) for id, run in groupby(turned, lambda each: phase_of(each[0]))]


def _together(net: PetriNet, circle: Circle) -> Transition | None:
    """The instant that a behavior is to both begin and end phases with, if these alone make the circle."""
    ours = {phase_of(tie) for tie, _ in circle}
    instants = (net.transitions[tie.source] for tie, _ in circle) if len(ours) == 1 and ours != {""} else ()
    return next((each for each in instants if sum(point.behavior in ours for point in each.points) > 1), None)


def phase_of(tie: Tie) -> str:
    """The behavior of which a place is a phase; empty: it is none."""
    return tie.behavior if isinstance(tie, Place) and tie.kind == "phase" else ""


def _said(net: PetriNet, tie: Tie, seconds: Seconds, spelling: Spelling) -> str:
    """Words for a tie other than the phase of a behavior: `g:end is 2 s after bml:start`."""
    since, to = (spelling.instant(net.transitions[end]) for end in (tie.source, tie.target))
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


# -- lines ---------------------------------------------------------------------------------------------------------


def lines_of_instants(
    ties: Sequence[Tie], net: PetriNet, orders: Sequence[Order], classes: Classes, chains: Mapping[str, Chain]
) -> set[int]:
    """Lines that say that the points of an instant, or of one a fixed time later, belong together."""
    lines: set[int] = set()
    others = [tie for tie in ties if tie.kind != "delay"]
    for before, after in zip([*others[-1:], *others], others, strict=False):
        lines |= classes.lines(_ends(before, net, orders, chains)[1], _ends(after, net, orders, chains)[0])
    return lines


def _ends(tie: Tie, net: PetriNet, orders: Sequence[Order], chains: Mapping[str, Chain]) -> tuple[Point, Point]:
    """The points that a tie is between: of its behavior, or those that are said to come in this order."""
    if tie.kind == "phase" and (chain := chains.get(tie.behavior)) is not None:
        since_point, to_point = _ends_of_phases(net, (tie,), chain)
        return (to_point, since_point) if isinstance(tie, Bound) else (since_point, to_point)
    since, to = (net.transitions[end].points or (FINISH,) for end in (tie.source, tie.target))
    said = ((each.earlier.point, each.later.point) for each in orders)
    start, end = next((each for each in said if each[0] in since and each[1] in to), (since[0], to[0]))
    named = {point.behavior: point for point in reversed(since)}, {point.behavior: point for point in reversed(to)}
    return named[0].get(tie.behavior, start), named[1].get(tie.behavior, end)


def lines_by_point(relations: Relations) -> dict[Point, set[int]]:
    """For each point that a block ties to another, or to a time, the lines that do."""
    found: dict[Point, set[int]] = {}
    ties = [each.terms for each in relations.equals] + [(each.earlier, each.later) for each in relations.orders]
    for terms in ties:
        if len(terms) > 1:
            lines = {term.line for term in terms} - {0}
            for term in terms:
                if term.point != ORIGIN:
                    found.setdefault(term.point, set()).update(lines)
    return found


def see_lines(lines: Collection[int]) -> str:
    """Write `: see lines 4, 5` behind an advice; nothing if there are none."""
    told = ", ".join(map(str, sorted(lines)))
    return f": see line{'s' * (len(lines) > 1)} {told}" if lines else ""

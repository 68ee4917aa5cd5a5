"""Behaviors that are not performed, and what remains of a block without them.

Not performed are those that nobody here knows or that the body refuses, and those that mean nothing without others
which are not performed (`Behavior.needs`). What the block says of them is taken out of its relations: else points
that never come would keep the others waiting.
"""

from collections.abc import Collection, Container, Iterable, Mapping
from functools import partial
from typing import get_args

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import Event, Head, Unknown
from engage_hri.schemas.blocks import Block, WarningKind
from engage_hri.schemas.body import Estimate
from engage_hri.schemas.faults import Fault
from engage_hri.schemas.vocabulary import unperformed
from engage_hri.services.realizer.plan.known import is_foreign
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import Classes, Equal, Order, Relations, Term
from engage_hri.services.realizer.points import ORIGIN, Point, frozen


def without(needed: str) -> str:
    """Reason why a behavior is dropped that needs another one. needed: id of that."""
    return f"it needs {needed}, which is not performed"


def falling(chains: Mapping[str, Chain], lost: Iterable[str], begun: Container[str]) -> dict[str, str]:
    """Behaviors that fall because others are lost, each with the one that it needs. What has begun is finished."""
    needing: dict[str, list[str]] = {}
    for id, chain in chains.items():
        for needed in chain.behavior.needs if id not in begun else ():
            needing.setdefault(needed, []).append(id)
    found: dict[str, str] = {}
    todo = list(lost) if needing else []
    for needed in todo:  # it grows
        fresh = [id for id in needing.get(needed, ()) if id not in found]
        found |= dict.fromkeys(fresh, needed)
        todo += fresh
    return found


def events_needing(lost: str, block: Block) -> list[Event]:
    """Connection events of the block that need a behavior: they are withdrawn with it, even if they have begun."""
    return [each for each in block.behaviors if isinstance(each, Event) and lost in each.needs]


def unknown(behavior: Unknown) -> tuple[WarningKind, str]:
    """Kind and reason of the warning about a behavior that nobody here knows, or that does not say what to do."""
    if behavior.namespace:
        return "CUSTOM_BEHAVIOR_NOT_SUPPORTED", f"<{behavior.element}> is of namespace {behavior.namespace!r}"
    if behavior.lacks:
        return (
            "CANNOT_CREATE_BEHAVIOR",
            f"<{behavior.element}> has no {behavior.lacks}, so there is nothing to perform",
        )
    return "BEHAVIOR_TYPE_NOT_SUPPORTED", unperformed(behavior.element)


def kind_of(warning: str) -> WarningKind:
    """Kind of the warning that a body gives as the reason why it cannot do a behavior."""
    return warning if warning in get_args(WarningKind) else "CANNOT_CREATE_BEHAVIOR"  # type: ignore[return-value]


def refused(estimate: Estimate, block: str) -> tuple[WarningKind, str, str]:
    """Kind, reason and advice of the warning about a behavior that the body cannot do."""
    fault = estimate.fault or Fault(reason="the body cannot do it")
    return kind_of(estimate.warning), replace(fault, advice="").within(block, estimate.behavior), fault.advice


def remaining(
    relations: Relations, chains: Mapping[str, Chain], dropped: Container[str], block: str
) -> tuple[Relations, Classes]:
    """Relations of the behaviors that are not dropped, and the classes of their points.

    Raises BlockRefused: they contradict each other. block: its id.
    """

    def is_left(term: Term) -> bool:
        return term.point.behavior not in dropped

    timed = partial(_timed, chains)
    equals = [
        Equal(tuple(map(timed, kept)), equal.behavior)
        for equal in relations.equals
        if (kept := tuple(filter(is_left, equal.terms))) and (len(kept) > 1 or len(equal.terms) == 1)
    ]
    classes = _classes(chains, equals, block)
    equals += [equal for equal in _left_over(relations, chains, dropped) if classes.tie_if_possible(equal)]
    orders = [each for each in relations.orders if is_left(each.earlier) and is_left(each.later)]
    present = Relations(
        tuple(equals),
        tuple([Order(timed(each.earlier), timed(each.later), each.placed) for each in orders]),
        frozen(id for id in relations.required if id not in dropped),
        untied=relations.untied,
    )
    return present, classes


def untied(relations: Relations, points: Container[Point]) -> Relations:
    """The relations without what they say of these points of other blocks."""
    equals = [
        (equal, tuple([term for term in equal.terms if not _is_of_others(term, points)]))
        for equal in relations.equals
    ]
    orders = [
        each for each in relations.orders if not any(_is_of_others(end, points) for end in (each.earlier, each.later))
    ]
    given_up = [term.point for equal, left in equals if left != equal.terms for term in left]
    given_up += [end.point for each in {*relations.orders} - {*orders} for end in (each.earlier, each.later)]
    return replace(
        relations,
        equals=tuple([replace(equal, terms=left) for equal, left in equals if left == equal.terms or len(left) > 1]),
        orders=tuple(orders),
        untied=frozen(point for point in given_up if not is_foreign(point.behavior)),
    )


def _is_of_others(term: Term, points: Container[Point]) -> bool:
    return is_foreign(term.point.behavior) and term.point in points


def _left_over(relations: Relations, chains: Mapping[str, Chain], dropped: Container[str]) -> list[Equal]:
    """Ties through points of dropped behaviors: they stay, unless they could not have been kept."""
    timed = partial(_timed, chains)
    torn = [
        Equal(tuple(map(timed, equal.terms)))
        for equal in relations.equals
        if equal.behavior not in dropped  # a dropped behavior's own timing is dropped, too
        and any(term.point.behavior in dropped for term in equal.terms)
    ]
    through = Classes()
    for equal in sorted(torn, key=lambda equal: [term.text for term in equal.terms]):
        through.tie_if_possible(equal)
    survivors = {
        term.point: term
        for equal in torn
        for term in equal.terms
        if term.point != ORIGIN and term.point.behavior not in dropped
    }
    first: dict[Point, Term] = {}
    found = []
    for point, term in sorted(survivors.items()):
        through.add(point)  # Nothing is tied to it where that contradicts the rest.
        root, offset = through.find(point)
        here = replace(term, offset=-offset, stroke=0)
        if root in first:
            found.append(Equal((first[root], here)))
            continue
        first[root] = here
        if (at := through.at(point)) is not None:
            found.append(Equal((here, Term(ORIGIN, at - offset, term.text, term.line))))
    return found


def _timed(chains: Mapping[str, Chain], term: Term) -> Term:
    """The term of a later stroke: a point of its own if the body tells of it, otherwise an offset to stroke 1."""
    if term.stroke < 2 or (movement := chains.get(term.point.behavior)) is None:
        return term
    later = Point(term.point.behavior, f"{term.point.sync}:{term.stroke}")
    if later in movement.points:
        return replace(term, point=later, stroke=0)
    assert isinstance(movement.behavior, Head)
    strokes = next(each.natural for each in movement.segments if each.since == "stroke")
    share = (term.stroke - 1) / movement.behavior.repetition
    return replace(term, offset=term.offset + share * strokes, stroke=0)


def _classes(chains: Mapping[str, Chain], equals: Collection[Equal], block: str) -> Classes:
    classes = Classes()
    for each in chains.values():
        for syncs in TYPES[each.type].one_instant:
            classes.tie(Equal(tuple([Term(Point(each.behavior.id, sync), 0.0, sync) for sync in syncs])), "")
    for equal in equals:
        classes.tie(equal, block)
    return classes

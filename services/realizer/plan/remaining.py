"""Relations of the behaviors that are left when others are dropped."""

from collections.abc import Collection, Container, Mapping
from functools import partial

from msgspec.structs import replace

from engage_hri.schemas.behavior_types import TYPES
from engage_hri.schemas.behaviors import Head
from engage_hri.services.realizer.plan.instants import Classes
from engage_hri.services.realizer.plan.known import is_foreign
from engage_hri.services.realizer.plan.phases import Chain
from engage_hri.services.realizer.plan.relations import Equal, Order, Relations, Term
from engage_hri.services.realizer.points import ORIGIN, Point, frozen


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

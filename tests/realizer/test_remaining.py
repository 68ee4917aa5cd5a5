"""Relations of the behaviors that are left when others are dropped: what was tied through these stays tied."""

from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Head
from engage_hri.schemas.body import Phase
from engage_hri.services.realizer.plan.phases import Chain, chain
from engage_hri.services.realizer.plan.relations import Equal, Order, Relations, Term
from engage_hri.services.realizer.plan.remaining import remaining, untied
from engage_hri.services.realizer.points import ORIGIN, Point
from tests.random_cases import share_of
from tests.realizer.oracle import estimate

IDS = "abcd"
POINTS = [Point(id, sync) for id in IDS for sync in ("start", "stroke", "end")]


def chained(id: str, *, strokes: bool = False) -> Chain:
    """A nod, or three in a row: then with an estimate for each stroke, or for all of them."""
    nods = Head(id=id, lexeme="NOD", repetition=3)
    found = estimate(nods)
    if strokes:
        syncs = ("stroke", "stroke:2", "stroke:3", "stroke_end")
        each = tuple(Phase(since=a, to=b, shortest=0.1, natural=0.25, longest=None) for a, b in pairwise(syncs))
        number = next(n for n, phase in enumerate(found.phases) if phase.since == "stroke")
        found = replace(found, phases=(*found.phases[:number], *each, *found.phases[number + 1 :]))
    return chain(nods, found)


@st.composite
def ties(draw: st.DrawFn, at: dict[Point, float]) -> list[Equal]:
    """Ties of points that are all at known times, so that none contradicts another."""
    found = []
    for number in range(draw(st.integers(0, 5))):
        size = draw(st.integers(1, 3))
        points = draw(st.lists(st.sampled_from([*POINTS, ORIGIN]), min_size=size, max_size=size, unique=True))
        instant = draw(st.sampled_from((0.0, 1.5)))
        terms = tuple(Term(each, instant - at[each], f"{each}@{number}", number) for each in points)
        by = points[0].behavior if size == 2 and draw(st.booleans()) else ""
        found.append(Equal(terms, by))
    return found


@settings(max_examples=share_of(120), deadline=None)
@given(st.data())
def test_what_was_tied_through_a_dropped_behavior_stays_tied(data: st.DataObject) -> None:
    at = {each: data.draw(st.sampled_from((0.0, 0.25, 1.0, 3.0))) for each in POINTS} | {ORIGIN: 0.0}
    equals = data.draw(ties(at))
    dropped = data.draw(st.sets(st.sampled_from(IDS), max_size=3))
    ends = st.sampled_from(POINTS)
    orders = tuple(
        Order(Term(data.draw(ends), 0.5, "one"), Term(data.draw(ends), 0.0, "other"), data.draw(st.sampled_from(IDS)))
        for _ in range(data.draw(st.integers(0, 3)))
    )
    required = frozenset(data.draw(st.sets(st.sampled_from(IDS))))
    relations = Relations(tuple(equals), orders, required)
    chains = {id: chained(id) for id in IDS if id not in dropped}
    present, classes = remaining(relations, chains, dropped, "b")

    groups = [{each.point for each in equal.terms} for equal in equals if equal.behavior not in dropped]
    left = [each for each in POINTS if each.behavior not in dropped]
    for point in left:
        classes.add(point)
    tied = {point: together(groups, point) for point in left}
    for point in left:
        assert classes.at(point) == (pytest.approx(at[point]) if ORIGIN in tied[point] else None)
        for other in left:
            if other in tied[point] or ORIGIN in tied[point] & tied[other]:
                assert classes.offset_between(point, other) == pytest.approx(at[other] - at[point])
            else:
                assert classes.offset_between(point, other) is None
    whole = tuple(each for each in equals if all(term.point.behavior not in dropped for term in each.terms))
    assert set(whole) <= set(present.equals)
    assert all(term.point.behavior not in dropped for each in present.equals for term in each.terms)
    assert present.orders == tuple(
        each for each in orders if not {each.earlier.point.behavior, each.later.point.behavior} & dropped
    )
    assert present.required == required - dropped


def together(groups: list[set[Point]], point: Point) -> set[Point]:
    """What is tied to the point, but not by way of the block's start."""
    tied = {point}
    for _ in POINTS:
        for group in groups:
            if group & tied - {ORIGIN}:
                tied |= group
    return tied


def test_what_could_not_have_been_kept_does_not_contradict_what_is_left() -> None:
    """Through c, which is dropped, b would be a second after a; but a and b are one instant."""
    a, b, c = (Point(id, "start") for id in "abc")
    same = Equal((Term(a, 0.0, "a"), Term(b, 0.0, "b")))
    through = (Equal((Term(a, 1.0, "a+1"), Term(c, 0.0, "c"))), Equal((Term(b, 0.0, "b"), Term(c, 0.0, "c"))))
    relations = Relations((*through, same), (), frozenset())

    present, classes = remaining(relations, {id: chained(id) for id in "ab"}, {"c"}, "b")
    assert present.equals == (same,)
    assert classes.offset_between(a, b) == 0.0


@pytest.mark.parametrize("strokes", [True, False])
def test_a_later_stroke_is_a_point_that_is_told_or_a_share_of_all_strokes(strokes: bool) -> None:
    chains = {"a": chained("a", strokes=strokes), "b": chained("b", strokes=strokes)}
    terms = [Term(Point("a", "stroke"), 0.5, f"a:stroke:{n}", stroke=n) for n in (0, 1, 2, 3)]
    other = Term(Point("b", "end"), 0.0, "b:end")
    relations = Relations(
        tuple(Equal((each,)) for each in terms), tuple(Order(each, other) for each in terms), frozenset()
    )

    present, _ = remaining(relations, chains, (), "b")
    found = [each.terms[0] for each in present.equals]
    assert [each.earlier for each in present.orders] == found
    points = ("stroke", "stroke", "stroke:2", "stroke:3") if strokes else ("stroke",) * 4
    assert [each.point for each in found] == [Point("a", sync) for sync in points]
    shares = [0.0, 0.0, 0.0, 0.0] if strokes else [0.0, 0.0, 0.25 / 3, 0.5 / 3]
    assert [each.offset - 0.5 for each in found] == pytest.approx(shares)


@settings(max_examples=share_of(100), deadline=None)
@given(st.data())
def test_what_is_untied_from_other_blocks_says_nothing_of_these_points(data: st.DataObject) -> None:
    points = [Point("a", "start"), Point("b", "end"), Point("o:x", "start"), Point("o:y", "end"), Point("p:x", "end")]
    away = data.draw(st.sets(st.sampled_from(points)))
    term = st.sampled_from([Term(each, 0.0, str(each)) for each in points])
    equals = [
        Equal(tuple(data.draw(st.lists(term, min_size=1, max_size=3))), data.draw(st.sampled_from(("", "a"))))
        for _ in range(3)
    ]
    orders = [Order(data.draw(term), data.draw(term), "a") for _ in range(3)]
    gone = {each for each in away if ":" in each.behavior}

    found = untied(Relations(tuple(equals), tuple(orders), frozenset("a")), away)
    expected = []
    for each in equals:
        left = tuple(it for it in each.terms if it.point not in gone)
        if len(left) > 1 or left == each.terms:
            expected.append(Equal(left, each.behavior))
    assert list(found.equals) == expected
    assert list(found.orders) == [each for each in orders if not {each.earlier.point, each.later.point} & gone]
    assert found.required == {"a"}

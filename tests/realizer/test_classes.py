"""Points that are one instant: random ties against distances in a graph, and what a contradiction tells."""

import re
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.services.realizer.plan.instants import Classes, instants
from engage_hri.services.realizer.plan.relations import BlockRefused, Equal, Term
from engage_hri.services.realizer.points import ORIGIN, Point
from tests.random_cases import share_of

POINTS = [Point("b", f"p{number}") for number in range(7)]
Graph = dict[Point, dict[Point, tuple[float, int]]]
"""Neighbors of each point, with the seconds to them and the line that says so."""

Said = tuple[int, int, float, float]
"""Two points by number (one less than 0 is the block's start), and the offsets that they are written with."""


def point(number: int) -> Point:
    return ORIGIN if number < 0 else POINTS[number]


def term(number: int, offset: float, line: int) -> Term:
    return Term(point(number), offset, f"{point(number)}{offset:+g}", line)


def _point(text: str) -> Point:
    """The point of a term as `term` writes it."""
    return next(each for each in (*POINTS, ORIGIN) if re.fullmatch(rf"{each}[+-].*", text))


def ways(graph: Graph, start: Point) -> dict[Point, tuple[float, list[int]]]:
    """Seconds and lines from a point to all that it is tied to, but not by way of the block's start."""
    found: dict[Point, tuple[float, list[int]]] = {start: (0.0, [])}
    todo = [start]
    for here in todo:
        if here == ORIGIN and len(found) > 1:
            continue
        for there, (seconds, line) in graph.get(here, {}).items():
            if there not in found:
                found[there] = (found[here][0] + seconds, [*found[here][1], line])
                todo.append(there)
    return found


def clock(graph: Graph, one: Point) -> float | None:
    """Seconds from the block's start to the point, if it is tied to that."""
    known = ways(graph, one).get(ORIGIN)
    return None if known is None else -known[0]


def between(graph: Graph, one: Point, other: Point) -> float | None:
    tied = ways(graph, one)
    if other in tied:
        return tied[other][0]
    since, to = clock(graph, one), clock(graph, other)
    return None if since is None or to is None else to - since


TIES = st.lists(
    st.tuples(
        st.integers(-1, 6), st.integers(0, 6), st.sampled_from((-1.0, 0.0, 0.5)), st.sampled_from((0.0, 0.25, 2.0))
    ).filter(lambda each: each[0] != each[1]),
    max_size=10,
)


@settings(max_examples=share_of(300), deadline=None)
@given(TIES, st.booleans())
def test_what_is_tied_is_so_far_apart_and_a_contradiction_tells_how_far_and_why(
    said: list[Said], is_tried: bool
) -> None:
    classes, graph = Classes(), dict[Point, dict[Point, tuple[float, int]]]()
    for each in POINTS:
        classes.add(each)
    for line, (first, second, here, there) in enumerate(said, 1):
        since, to, apart = point(first), point(second), here - there
        known = between(graph, since, to)
        equal = Equal((term(first, here, line), term(second, there, line)))
        if known is None or known == apart:
            assert not is_tried or classes.tie_if_possible(equal)
            if not is_tried:
                classes.tie(equal, "block")
            if to not in graph.get(since, {}):
                graph.setdefault(since, {})[to] = (apart, line)
                graph.setdefault(to, {})[since] = (-apart, line)
            continue
        if is_tried:
            assert not classes.tie_if_possible(equal)
            continue
        with pytest.raises(BlockRefused) as refusal:
            classes.tie(equal, "block")
        check_contradiction(refusal.value, graph, (since, to), known, line)
    for one in POINTS:
        assert classes.at(one) == clock(graph, one)
        for other in POINTS:
            assert classes.offset_between(one, other) == between(graph, one, other)
    assert classes.at(ORIGIN) == 0.0


def check_contradiction(
    refused: BlockRefused, graph: Graph, ends: tuple[Point, Point], known: float, line: int
) -> None:
    """Ends: the points of the tie, the block's start last."""
    since, to = ends if ends[0] != ORIGIN else ends[::-1]
    known = known if ends[0] != ORIGIN else -known
    assert refused.kind == "IMPOSSIBLE_TO_SCHEDULE"
    fault = refused.fault
    assert fault.where == "block"
    sooner, later = (since, to) if known >= 0 else (to, since)
    form = r"cannot be one instant: (\S+) is already (?:(\S+) s after|the same instant as) (\S+) \("
    told = re.search(form, fault.reason)
    assert told is not None
    assert (told[1], told[3], float(told[2] or 0)) == (str(later), str(sooner), abs(known))
    assert fault.advice.startswith("leave one of them out")
    named = [int(each) for each in re.findall(r"\d+", fault.advice)] or [line]
    assert named == sorted(set(named))
    assert (line in named, fault.line) == (True, line)
    said_so = re.search(r" \((.*)\)$", fault.reason)
    assert said_so is not None
    way = [[_point(name) for name in each.split(" = ")] for each in said_so[1].split(", ")]
    assert (way[0][0], way[-1][1]) == (since, to)
    assert all(one[1] == other[0] for one, other in pairwise(way))
    said = [graph[one][other][1] for one, other in way]
    assert named == sorted({*said, line})


@settings(max_examples=share_of(200), deadline=None)
@given(TIES)
def test_instants_are_points_at_no_distance_and_the_lines_between_lead_there(said: list[Said]) -> None:
    classes, graph = Classes(), dict[Point, dict[Point, tuple[float, int]]]()
    for line, (first, second, here, there) in enumerate(said, 1):
        if classes.tie_if_possible(Equal((term(first, here, line), term(second, there, line)))):
            graph.setdefault(point(first), {}).setdefault(point(second), (here - there, line))
            graph.setdefault(point(second), {}).setdefault(point(first), (there - here, line))

    found = instants(classes, POINTS)
    assert sorted(each for instant in found for each in instant.points) == POINTS
    for instant in found:
        earliest = instant.points[0]
        tied = {each: at for each, (at, _) in ways(graph, earliest).items() if each != ORIGIN}
        assert instant.points == tuple(each for each in POINTS if tied.get(each) == 0.0)
        assert instant.at == clock(graph, earliest)
        assert instant.offset == -min(tied.values())
        mates = {each.points[0] for each in found if each.class_id == instant.class_id}
        assert mates == {each.points[0] for each in found if each.points[0] in tied}
    for one in POINTS:
        for other in POINTS:
            check_way(graph, one, other, classes.lines(one, other))


def check_way(graph: Graph, one: Point, other: Point, told: set[int]) -> None:
    """The lines that are told tie the two, and are as few as can be."""
    reached, steps, layer = {one}, 0, {one}
    while other not in reached and layer:
        layer = {to for each in layer for to in graph.get(each, {})} - reached
        reached |= layer
        steps += 1
    if other not in reached:
        assert told == set()
        return
    assert len(told) <= steps
    tied = {one}
    for _ in told:
        tied |= {to for each in tied for to, (_, line) in graph.get(each, {}).items() if line in told}
    assert other in tied


def test_three_points_of_one_tie_are_tied_two_by_two_and_ties_without_a_line_tell_none() -> None:
    classes = Classes()
    classes.tie(Equal((Term(ORIGIN, 2.0, "2", 7), Term(POINTS[0], 0.0, "a"), Term(POINTS[1], -1.0, "b", 7))), "b")

    assert (classes.at(POINTS[0]), classes.at(POINTS[1])) == (2.0, 3.0)
    assert classes.lines(POINTS[0], POINTS[1]) == {7}
    assert classes.lines(POINTS[0], ORIGIN) == {7}
    assert classes.lines(POINTS[0], POINTS[2]) == set()


def test_instants_that_differ_by_less_than_a_microsecond_are_one() -> None:
    classes = Classes()
    for number, seconds in ((1, 0.9e-6), (2, 1.2e-6), (3, 2.0e-6)):
        classes.tie(Equal((Term(POINTS[0], seconds, "x"), Term(POINTS[number], 0.0, "y"))), "b")

    found = instants(classes, POINTS[:4][::-1])
    assert [each.points for each in found] == [(POINTS[1], POINTS[0]), (POINTS[3], POINTS[2])]
    assert classes.tie_if_possible(Equal((Term(POINTS[0], 0.9e-6, "x"), Term(POINTS[0], 0.0, "y"))))
    assert not classes.tie_if_possible(Equal((Term(POINTS[0], 1.1e-6, "x"), Term(POINTS[0], 0.0, "y"))))

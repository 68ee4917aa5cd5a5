"""In which order references are made: topological in the constraints, document order for ties (decision B12)."""

from itertools import permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import (
    After,
    Before,
    Constraint,
    FragmentBehavior,
    Gaze,
    Speech,
    Synchronize,
    Timing,
)
from engage_hri.services.generation.block.ordering import ordered
from tests.generation.tables import option, refer


def speech(id: str, **timing: str) -> Speech:
    return Speech(id=id, text=id, timing=tuple(Timing(sync, ref) for sync, ref in timing.items()))


def gaze(id: str, **timing: str) -> Gaze:
    return Gaze(id=id, target="x", timing=tuple(Timing(sync, ref) for sync, ref in timing.items()))


def order(behaviors: list[FragmentBehavior], *operators: Synchronize | After | Before) -> str:
    constraints = [Constraint(operators=(operator,)) for operator in operators]
    return " ".join(behavior.id for behavior in ordered(behaviors, constraints, "me"))


def same(*syncs: str) -> Synchronize:
    return Synchronize(syncs=syncs)


def test_without_constraints_the_document_orders() -> None:
    assert order([speech("b"), speech("a"), speech("c")]) == "b a c"


def test_fig_3_2_is_in_order_however_it_is_written() -> None:
    """speech-1, ref-1, speech-3, ref-2: three synchronizations order them all."""
    written = [speech("s1"), refer("r1", "t", 0.85, option("it")), speech("s3"), refer("r2", "t", 0.85, option("it"))]
    ties = [same("s1:end", "r1:start"), same("r1:end", "s3:start"), same("s3:end", "r2:start")]

    assert {order(list(each), *ties) for each in permutations(written)} == {"s1 r1 s3 r2"}


@pytest.mark.parametrize(
    ("operators", "expected"),
    [
        ([After(ref="c:end", syncs=("a:start",))], "b c a"),
        ([Before(ref="a:start", syncs=("c:end",))], "b c a"),
        ([After(ref="me:c:end", syncs=("a:start", "b:start"))], "c a b"),
        ([Synchronize(ref="c:end", syncs=("b:start",)), same("b:end", "a:start")], "c b a"),
        ([After(ref="b:end", syncs=("a:end",))], "b a c"),  # the voice says one thing at a time
        ([same("c:start", "b:end+1")], "a b c"),
        ([same("c:end+0.5", "a:start")], "b c a"),
        ([same("c:start", "a:start")], "a b c"),  # a tie
        ([After(ref="other:c:end", syncs=("a:start",))], "a b c"),  # another block's c
    ],
)
def test_constraints_order_and_ties_are_broken_by_the_document(
    operators: list[Synchronize | After | Before], expected: str
) -> None:
    assert order([speech("a"), speech("b"), speech("c")], *operators) == expected


def test_what_begins_with_a_behavior_comes_before_what_follows_it() -> None:
    """b starts with the gaze, and a with the gaze's end: no constraint names both a and b."""
    behaviors = [speech("a", start="g:end"), speech("b", start="g:start"), gaze("g")]

    assert order(behaviors) == "b g a"


def test_times_on_one_clock_order_by_their_offsets() -> None:
    assert order([speech("a", start="3"), speech("b", start="1.5")]) == "b a"
    assert order([speech("a", start="g:stroke+2"), speech("b", start="g:stroke+0.5"), gaze("g")]) == "g b a"


def test_a_gaze_that_lasts_into_a_speech_still_comes_first() -> None:
    """By behaviors this is a circle; by instants it is not."""
    behaviors = [speech("s"), gaze("g")]

    assert order(behaviors, After(ref="g:stroke", syncs=("s:start",)), After(ref="s:end", syncs=("g:end",))) == "g s"


def test_a_mark_lies_within_its_speech() -> None:
    behaviors = [speech("b", start="a:word"), speech("c", end="a:word"), speech("a")]

    assert order(behaviors) == "c a b"


def test_a_circle_is_left_in_document_order() -> None:
    circle = [After(ref="a:end", syncs=("b:start",)), After(ref="b:end", syncs=("a:start",))]

    assert order([speech("c"), speech("a"), speech("b")], *circle) == "c a b"
    assert order([speech("c"), speech("b"), speech("a")], *circle, same("b:end", "c:start")) == "c b a"


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_the_order_obeys_every_constraint_and_moves_nothing_without_need(data: st.DataObject) -> None:
    """Constraints drawn along a hidden order: the answer is the least topological order by the document."""
    ids = [f"s{number}" for number in range(data.draw(st.integers(1, 7)))]
    hidden = data.draw(st.permutations(ids))
    pairs = [(one, other) for place, one in enumerate(hidden) for other in hidden[place + 1 :]]
    chosen = data.draw(st.lists(st.sampled_from(pairs), max_size=6)) if pairs else []
    operators = [After(ref=f"{one}:end", syncs=(f"{other}:start",)) for one, other in chosen]

    expected: list[str] = []
    while len(expected) < len(ids):
        blocked = {other for one, other in chosen if one not in expected}
        expected.append(next(id for id in ids if id not in expected and id not in blocked))

    assert order([speech(id) for id in ids], *operators).split() == expected

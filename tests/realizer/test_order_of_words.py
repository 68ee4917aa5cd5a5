"""The order of the speeches of a block: the document's, unless constraints ask for another; no needless loss.

The oracle tries every order of the speeches: each gives inequalities between points, which are relaxed one by one.
"""

from itertools import pairwise, permutations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.behaviors import After, BlockBehavior, Constraint, Gesture, Head, Speech, Timing
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused
from engage_hri.services.realizer.points import Point
from tests.random_cases import share_of
from tests.realizer.oracle import consult, estimate, relaxed

DEPENDENTS = (
    lambda id, to: Head(id=id, lexeme="NOD", timing=(Timing("start", to),)),
    lambda id, to: Head(id=id, lexeme="NOD", timing=(Timing("stroke", to),)),
    lambda id, to: Gesture(id=id, lexeme="BEAT", timing=(Timing("stroke_end", f"{to}+0.3"),)),
)


def planned(block: Block) -> Plan | None:
    """The plan with one voice for all speeches, and a part of its own for everything else."""
    estimates = [
        replace(estimate(each), parts=("voice",)) if isinstance(each, Speech) else estimate(each)
        for each in block.behaviors
    ]
    try:
        return plan_block(block, estimates)
    except BlockRefused:
        return None


def spoken(plan: Plan) -> list[str]:
    """The speeches in the order in which they are said."""
    speeches = [each.id for each in plan.behaviors if isinstance(each, Speech)]
    return sorted(speeches, key=lambda id: plan.predicted(Point(id, "start")))


def possible_orders(block: Block) -> list[tuple[str, ...]]:
    """Every order of the speeches, one after another, that keeps what is asked for."""
    asked = consult(block)
    speeches = [each.id for each in block.behaviors if isinstance(each, Speech)]
    return [
        order
        for order in permutations(speeches)
        if relaxed(asked.times, asked.extreme + [(f"{a}:end", f"{b}:start", 0.0) for a, b in pairwise(order)])
    ]


def are_tied(block: Block) -> bool:
    """True if a sentence begins so long after another: whether both can be said is for the voice to tell."""
    return any(":" in timing.ref for each in block.behaviors if isinstance(each, Speech) for timing in each.timing)


@st.composite
def sentences(draw: st.DrawFn, *, timed: bool) -> Block:
    """Two to four sentences with nods and beats that depend on them, at any place of the document.

    timed: some sentences begin at a time, or so long after another.
    """
    count = draw(st.integers(2, 4))
    behaviors: list[BlockBehavior] = []
    for number in range(count):
        ref = draw(st.sampled_from(("0", "1.5", *(f"s{other}:end" for other in range(count) if other != number))))
        gap = draw(st.sampled_from((0.0, 0.25, 1.5)))
        timing = (Timing("start", f"{ref}+{gap}" if ":" in ref else str(float(ref) + gap)),)
        timing = timing if timed and draw(st.booleans()) else ()
        behaviors.append(Speech(id=f"s{number}", text="words", timing=timing))
    for number in range(draw(st.integers(0, 3))):
        to = f"s{draw(st.integers(0, count - 1))}:{draw(st.sampled_from(('start', 'end')))}"
        one = draw(st.sampled_from(DEPENDENTS))(f"n{number}", to)
        behaviors.insert(draw(st.integers(0, len(behaviors))), one)
    constraints = ()
    if draw(st.booleans()):
        behaviors.append(Head(id="after", lexeme="NOD"))
        to = f"s{draw(st.integers(0, count - 1))}:end"
        constraints = (Constraint(operators=(After(ref=to, syncs=("after:start",)),)),)
    return Block(id="b", behaviors=tuple(behaviors), constraints=constraints)


@settings(max_examples=share_of(200), deadline=None)
@given(sentences(timed=False))
def test_sentences_come_in_the_order_of_the_document_whatever_depends_on_them(block: Block) -> None:
    plan = planned(block)

    assert plan is not None
    assert plan.dropped == ()
    assert spoken(plan) == [each.id for each in block.behaviors if isinstance(each, Speech)]


@settings(max_examples=share_of(300), deadline=None)
@given(sentences(timed=True))
def test_nothing_is_dropped_that_some_order_can_serve(block: Block) -> None:
    orders = possible_orders(block)
    plan = planned(block)

    if orders:
        assert plan is not None
        assert (plan.dropped, plan.given_up) == ((), {})
        assert tuple(spoken(plan)) in orders
        document = tuple(each.id for each in block.behaviors if isinstance(each, Speech))
        assert document not in orders or tuple(spoken(plan)) == document
    if plan is not None and not (plan.dropped or plan.given_up) and not are_tied(block):
        assert orders


@settings(max_examples=share_of(200), deadline=None)
@given(sentences(timed=True))
def test_words_are_never_dropped_for_a_time(block: Block) -> None:
    plan = planned(block)

    if plan is not None:
        sentences_of_it = {each.id for each in block.behaviors if isinstance(each, Speech)}
        assert not sentences_of_it & set(plan.dropped)
        assert set(plan.given_up) <= sentences_of_it
        assert {each.behavior for each in plan.problems} == {*plan.dropped, *plan.given_up}


SAID = '<speech id="a"><text>First of all the words.</text></speech><speech id="c"><text>Second.</text></speech>'


@pytest.mark.parametrize(
    ("more", "order"),
    [
        ('<head id="n" lexeme="NOD" start="c:end"/>', "ac"),
        ('<head id="n" lexeme="NOD" start="c:start"/>', "ac"),
        ('<gesture id="g" lexeme="BEAT" stroke="c:end"/>', "ac"),
        ('<speech id="d" start="c:end"><text>Third.</text></speech>', "acd"),
        ('<speech id="d" start="c:end+1"><text>Third.</text></speech>', "acd"),
        ('<speech id="d"><text>Third.</text></speech><head id="n" lexeme="NOD" start="a:end"/>', "acd"),
        ('<constraint><after ref="c:end"><sync ref="a:start"/></after></constraint>', "ca"),
    ],
)
def test_what_foreign_authors_write_is_said_in_their_order(more: str, order: str) -> None:
    block = decode_xml(f'<bml id="b">{SAID}{more}</bml>')
    assert isinstance(block, Block)
    plan = planned(block)

    assert plan is not None
    assert plan.dropped == ()
    assert "".join(spoken(plan)) == order


def sentence(number: int, **timing: str) -> Speech:
    return Speech(id=f"s{number}", text="words", timing=tuple(Timing(sync, ref) for sync, ref in timing.items()))


def test_the_last_of_many_sentences_comes_first_and_the_others_stay_where_they_are() -> None:
    last_first = Constraint(operators=(After(ref="s49:end", syncs=("s0:start",)),))
    plan = planned(Block(id="b", behaviors=tuple(map(sentence, range(50))), constraints=(last_first,)))

    assert plan is not None
    assert plan.problems == ()
    assert spoken(plan) == ["s49", *(f"s{number}" for number in range(49))]


@pytest.mark.parametrize("count", [7, 30])
def test_many_sentences_that_begin_as_later_ones_end_are_all_on_time(count: int) -> None:
    tied = [sentence(number, start=f"s{number + count}:end") for number in range(count)]
    plan = planned(Block(id="b", behaviors=(*tied, *map(sentence, range(count, 2 * count)))))

    assert plan is not None
    assert plan.problems == ()
    assert spoken(plan) == [f"s{number}" for pair in range(count) for number in (pair + count, pair)]


def test_many_sentences_that_have_to_wait_for_others_come_in_document_order_but_for_that() -> None:
    count = 18
    awaited = {each: (each * 7 + 3) % count for each in range(0, count, 2)}
    waits = [After(ref=f"s{other}:end", syncs=(f"s{each}:start",)) for each, other in awaited.items()]
    constraints = tuple(Constraint(operators=(each,)) for each in waits)
    plan = planned(Block(id="b", behaviors=tuple(map(sentence, range(count))), constraints=constraints))

    assert plan is not None
    assert plan.problems == ()
    expected: dict[int, None] = {}
    for each in range(count):
        expected |= dict.fromkeys([awaited[each], each] if each in awaited else [each])
    assert spoken(plan) == [f"s{number}" for number in expected]

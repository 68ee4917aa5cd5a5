"""What a block says about its points: random constraints and timing, whose meaning is known beforehand."""

import re
from typing import NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.behaviors import (
    After,
    Before,
    BlockBehavior,
    Constraint,
    Gaze,
    Head,
    Mark,
    Speech,
    Synchronize,
    Timing,
    Unknown,
    Wait,
)
from engage_hri.schemas.blocks import Block, Unread
from engage_hri.services.realizer.plan.relations import (
    BlockRefused,
    Equal,
    Order,
    Problem,
    Relations,
    Term,
    extent,
    needing,
    relations_of,
)
from engage_hri.services.realizer.points import ORIGIN, Point
from tests.random_cases import share_of


class Ref(NamedTuple):
    """A reference as it is written, and what it means. wrong: of a behavior that has no such point."""

    text: str
    point: Point
    offset: float = 0.0
    stroke: int = 0
    wrong: str = ""


BEHAVIORS: tuple[BlockBehavior, ...] = (
    Gaze(id="g", target="a", line=3),
    Head(id="h", lexeme="NOD", repetition=3),
    Speech(id="s", text="one two", marks=(Mark("m", 3), Mark("m-1", 3)), line=5),
    Wait(id="w", duration=1.0, line=6),
    Unknown(id="u", element="foo", line=7),
)
REFS = (
    Ref("g:stroke", Point("g", "stroke")),
    Ref("g:strokeEnd-0.5", Point("g", "stroke_end"), -0.5),
    Ref("h:stroke:3+1", Point("h", "stroke"), 1.0, 3),
    Ref("h:start", Point("h", "start")),
    Ref("s:m", Point("s", "m")),
    Ref("s:m-1", Point("s", "m-1")),
    Ref("s:m+2", Point("s", "m"), 2.0),
    Ref("b:w:end", Point("w", "end")),
    Ref("u:anything", Point("u", "anything")),
    Ref("1.5", ORIGIN, 1.5),
    Ref("bml:start+2", ORIGIN, 2.0),
    Ref("other:x:stroke", Point("other:x", "stroke")),
    Ref("other:t:k+1", Point("other:t", "k"), 1.0),
    Ref("other:bml:end", Point("other:bml", "end")),
    Ref("other:v:whatever", Point("other:v", "whatever")),
    Ref("dark:y:nobody_knows-1", Point("dark:y", "nobody_knows"), -1.0),
)
WRONG = (
    Ref("g:nowhere", Point("g", ""), wrong="gaze has no sync point 'g:nowhere'"),
    Ref("h:stroke:4", Point("h", ""), wrong="head has no sync point 'h:stroke:4'"),
    Ref("w:stroke", Point("w", ""), wrong="wait has no sync point 'w:stroke'"),
)
OTHERS = {
    "other": Block(
        id="other",
        behaviors=(
            Gaze(id="x", target="a"),
            Speech(id="t", text="a b", marks=(Mark("k", 1),)),
            Unknown(id="v", element="bar"),
            Head(id="n", lexeme="NOD", repetition=2),
        ),
    ),
    "dark": None,
}

KINDS: tuple[type[Synchronize] | type[After] | type[Before], ...] = (Synchronize, After, Before)


class Said(NamedTuple):
    block: Block
    relations: Relations


ADVICE = re.compile(r" \((did you mean|known: )[^()]*\)")
"""What was probably meant by a sync point that is not there."""


@st.composite
def said(draw: st.DrawFn) -> Said:
    """A block without anything that refuses it, and its relations."""
    equals: list[Equal] = []
    orders: list[Order] = []
    constraint_problems: list[Problem] = []
    constraints = []
    required: set[str] = set()
    for number in range(1, draw(st.integers(0, 3)) + 1):
        is_required, line = draw(st.booleans()), draw(st.sampled_from((0, 20 + number)))
        name = draw(st.sampled_from(("", f"c{number}")))
        operators: list[Synchronize | After | Before] = []
        for place in range(draw(st.integers(1, 2))):
            known = REFS if is_required else (*REFS, *WRONG)
            refs = draw(st.lists(st.sampled_from(known), min_size=2, max_size=4, unique=True))
            own = draw(st.sampled_from((0, 40 + place)))
            kind = draw(st.sampled_from(KINDS))
            terms = {
                each.text: Term(each.point, each.offset, each.text, own or line, each.stroke)
                for each in refs
                if not each.wrong
            }
            for each in refs:
                if each.wrong:
                    at = f"line {own or line}: " if own or line else ""
                    words = f"{at}{name or f'constraint {number}'}: {each.wrong}; it is ignored"
                    constraint_problems.append(Problem("PARSING_FAILURE", words))
                elif is_required and each.point.behavior in {behavior.id for behavior in BEHAVIORS}:
                    required.add(each.point.behavior)
            is_plain = kind is Synchronize and draw(st.booleans())
            texts = tuple(each.text for each in refs)
            ref, syncs = ("", texts) if is_plain else (texts[0], texts[1:])
            operators.append(kind(ref=ref, syncs=syncs, line=own))
            if kind is Synchronize:
                equals += [Equal(tuple(terms.values()))] if terms else []
            elif ref in terms:
                for sync in syncs:
                    if sync in terms:
                        ends = (terms[ref], terms[sync]) if kind is After else (terms[sync], terms[ref])
                        placed = terms[ref] if terms[sync].point == ORIGIN else terms[sync]
                        orders.append(Order(*ends, placed.point.behavior))
        constraints.append(Constraint(operators=tuple(operators), id=name, required=is_required, line=line))
    behaviors = list(BEHAVIORS)
    problems: list[Problem] = []
    unusable: set[str] = set()
    for number, behavior in enumerate(BEHAVIORS):
        timing = []
        own_equals: list[Equal] = []
        lost = False
        own_syncs = {"g": "strokeStart", "h": "relax", "s": "m", "w": "end", "u": "x"}
        for _ in range(draw(st.integers(0, 2))):
            other = draw(st.sampled_from((*REFS, *WRONG)))
            sync = draw(st.sampled_from((own_syncs[behavior.id], "start", "middle")))
            timing.append(Timing(sync, other.text))
            kind_name = str(behavior.__struct_config__.tag)
            wrong = ""
            if sync == "middle" and behavior.id != "u":
                wrong = f"{kind_name} has no sync point 'middle'"
            elif other.wrong:
                wrong = f"{behavior.id}: {other.wrong}"
            at = f"line {behavior.line}: " if behavior.line else ""
            if lost:
                continue
            if wrong and behavior.id == "s" and "s" not in required:
                problems.append(Problem("PARSING_FAILURE", f"{at}{wrong}; it is ignored", "s"))
            elif wrong:
                lost = True
                problems.append(Problem("PARSING_FAILURE", f"{at}{wrong}; the behavior is dropped", behavior.id))
                unusable.add(behavior.id)
            else:
                point = Point(behavior.id, "stroke_start" if sync == "strokeStart" else sync)
                here = Term(point, 0.0, f"{behavior.id}:{sync}", behavior.line)
                there = Term(other.point, other.offset, other.text, behavior.line, other.stroke)
                own_equals.append(Equal((here, there), behavior.id))
        behaviors[number] = replace(behavior, timing=tuple(timing))
        equals += [] if lost else own_equals
    if draw(st.booleans()):
        behaviors[1] = replace(behaviors[1], required=True)
        required.add("h")
    unread = (Unread(message="strange", behavior="g", kind="PARSING_FAILURE"),)
    block = Block(id="b", behaviors=tuple(behaviors), constraints=tuple(constraints), unread=unread)
    told = (Problem("PARSING_FAILURE", "strange", "g"), *constraint_problems, *problems)
    return Said(block, Relations(tuple(equals), tuple(orders), frozenset(required), told, frozenset(unusable)))


@settings(max_examples=share_of(200), deadline=None)
@given(said())
def test_what_a_block_says_is_read_as_it_was_meant(case: Said) -> None:
    found = relations_of(case.block, OTHERS)

    assert found.equals == case.relations.equals
    assert found.orders == case.relations.orders
    assert found.required == case.relations.required
    lacking = [each.message for each in found.problems if "has no sync point" in each.message]
    assert all(len(ADVICE.findall(each)) == 1 for each in lacking)
    without_advice = [replace(each, message=ADVICE.sub("", each.message)) for each in found.problems]
    assert without_advice == list(case.relations.problems)
    assert found.unusable == case.relations.unusable
    instants = [[term.point for term in each.terms] for each in found.equals]
    shared = {point for each in instants if len(set(each)) > 1 for point in each}
    assert found.held == shared | {each.later.point for each in found.orders}
    assert found.constrained == found.held | {each.earlier.point for each in found.orders}
    assert found.named == found.constrained | {point for each in instants for point in each}
    said_of = {each.behavior or point.behavior for each in found.equals for point in (t.point for t in each.terms)}
    assert found.placed == said_of | {each.placed for each in found.orders}
    elements = len(case.block.behaviors) + 2 + sum(len(each.timing) for each in case.block.behaviors)
    for constraint in case.block.constraints:
        elements += sum(1 + len(each.syncs) for each in constraint.operators)
    assert extent(case.block) == elements


@settings(max_examples=share_of(100), deadline=None)
@given(said())
def test_what_needs_a_point_of_another_block_is_required_and_tied_to_it(case: Said) -> None:
    points = [Point("other:x", "stroke"), Point("dark:y", "nobody_knows")]
    relations = case.relations
    ties = [[term.point for term in each.terms] for each in relations.equals]
    ties += [[each.earlier.point, each.later.point] for each in relations.orders]
    expected = {
        (one.behavior, other)
        for each in ties
        for one in each
        for other in each
        if one.behavior in relations.required and other in points
    }
    assert set(needing(case.block, OTHERS, points)) == expected


LIVE = "a block is known from its request until 60 s after its end; {}"


@pytest.mark.parametrize(
    ("ref", "reason", "advice"),
    [
        ("nobody:start", "unknown behavior 'nobody'", "known: g, h, s, u, w"),
        ("bml:end-1", "'bml:end-1': nothing in a block can wait for its own end", ""),
        ("x:strat", "unknown behavior 'x'", "known: g, h, s, u, w"),
    ],
)
def test_a_reference_to_nothing_refuses_the_block_with_place_and_line(ref: str, reason: str, advice: str) -> None:
    for block, where, line in naming(ref):
        with pytest.raises(BlockRefused) as refusal:
            relations_of(block, OTHERS)
        fault = refusal.value.fault
        assert (fault.reason, fault.where, fault.line) == (reason, f"b: {where}", line)
        assert fault.advice == advice
        assert refusal.value.kind == "PARSING_FAILURE"


def naming(ref: str, *, required: bool = False) -> tuple[tuple[Block, str, int], ...]:
    """Two blocks that name this point, in a constraint and in an attribute, each with its place."""
    plain = Constraint(
        operators=(After(ref="g:start", syncs=("h:start",)), After(ref=ref, syncs=("w:start",), line=9))
    )
    tied, named = BEHAVIORS[3], replace(BEHAVIORS[3], required=required)
    inline = replace(tied, timing=(Timing("start", ref),), required=required)
    before, last = BEHAVIORS[:3], BEHAVIORS[4]
    return (
        (
            Block(id="b", behaviors=(*before, named, last), constraints=(plain, replace(plain, id="c"))),
            "constraint 1",
            9,
        ),
        (Block(id="b", behaviors=(*before, inline, last)), "w", 6),
    )


ABSENT = [
    (
        "other:x:nowhere",
        "'other:x:nowhere': gaze 'x' of block 'other' has no sync point 'nowhere'",
        "known: end, ready, relax, start, stroke, stroke_end, stroke_start",
    ),
    (
        "other:x:strok",
        "'other:x:strok': gaze 'x' of block 'other' has no sync point 'strok'",
        "did you mean 'stroke'?",
    ),
    ("other:t:kk", "'other:t:kk': speech 't' of block 'other' has no sync point 'kk'", "did you mean 'k'?"),
    (
        "other:n:stroke:2",
        "'other:n:stroke:2': of head 'n' of block 'other' only the first stroke can be named",
        "leave out the number, or put both into one block",
    ),
    ("other:z:start", "'other:z:start': block 'other' has no behavior 'z'", "known: n, t, v, x"),
    ("gone:z:start", "'gone:z:start': no block is known as 'gone'", LIVE.format("known: dark, other")),
    ("gone:bml:end", "'gone:bml:end': no block is known as 'gone'", LIVE.format("known: dark, other")),
    ("othr:bml:end", "'othr:bml:end': no block is known as 'othr'", LIVE.format("did you mean 'other'?")),
]


@pytest.mark.parametrize(("ref", "reason", "advice"), ABSENT)
def test_what_another_block_does_not_have_costs_the_tie_and_is_told(ref: str, reason: str, advice: str) -> None:
    for block, where, line in naming(ref):
        without = replace(
            block,
            behaviors=tuple(replace(each, timing=()) if each.id == "w" else each for each in block.behaviors),
            constraints=tuple(replace(each, operators=each.operators[:1]) for each in block.constraints),
        )
        found, expected = relations_of(block, OTHERS), relations_of(without, OTHERS)
        told = [each for each in found.problems if each not in expected.problems]

        # That a wait has no end is the second thing that is told of it.
        assert (found.equals, found.orders, found.unusable) == (expected.equals, expected.orders, frozenset())
        assert {each.kind for each in told} == {"PARSING_FAILURE"}
        assert told[0].message == f"line {line}: {where}: {reason} ({advice}); it is ignored"


@pytest.mark.parametrize(("ref", "reason", "advice"), ABSENT)
def test_what_another_block_does_not_have_refuses_what_is_required(ref: str, reason: str, advice: str) -> None:
    for block, where, line in naming(ref, required=True):
        with pytest.raises(BlockRefused) as refusal:
            relations_of(block, OTHERS)

        fault = refusal.value.fault
        assert (fault.reason, fault.where, fault.line) == (reason, f"b: {where}", line)
        assert fault.advice == f"what is required is tied to it; {advice}"


def test_a_reference_in_a_block_without_behaviors_says_so() -> None:
    empty = Block(id="b", behaviors=(), constraints=(Constraint(operators=(Synchronize(syncs=("x:end",)),)),))

    with pytest.raises(BlockRefused, match="the block has no behaviors"):
        relations_of(empty)


def test_a_required_constraint_may_not_name_what_is_not_there() -> None:
    wrong = Constraint(operators=(After(ref="g:nowhere", syncs=("h:start",)),), id="c", required=True, line=8)

    with pytest.raises(BlockRefused) as refusal:
        relations_of(Block(id="b", behaviors=BEHAVIORS, constraints=(wrong,)))
    fault = refusal.value.fault
    known = "end, ready, relax, start, stroke, stroke_end, stroke_start"
    reason = f"gaze has no sync point 'g:nowhere' (known: {known})"
    assert (fault.reason, fault.where, fault.line) == (reason, "b: c", 8)
    assert fault.advice == "the constraint is required"


@pytest.mark.parametrize(
    ("timing", "duration", "operators", "is_told"),
    [
        ((), None, (), True),
        ((), 0.0, (), False),
        ((Timing("end", "3"),), None, (), False),
        ((Timing("start", "3"),), None, (), True),
        ((), None, (After(ref="w:end", syncs=("g:start",)),), True),
        ((), None, (After(ref="g:start", syncs=("w:end",)),), False),
    ],
)
def test_a_wait_that_nothing_ends_ends_at_once_with_a_warning(
    timing: tuple[Timing, ...], duration: float | None, operators: tuple[After, ...], is_told: bool
) -> None:
    wait = Wait(id="w", duration=duration, timing=timing, line=4)
    constraints = (Constraint(operators=operators),) if operators else ()
    block = Block(id="b", behaviors=(BEHAVIORS[0], wait), constraints=constraints)

    told = Problem("PARSING_FAILURE", "line 4: wait has neither a duration nor an end; it ends at once", "w")
    assert relations_of(block).problems == ((told,) if is_told else ())


def test_bml_1_0_has_fewer_points_of_a_gaze_and_spells_them_otherwise() -> None:
    advice = {"g:strokeStart": "did you mean 'start'?", "g:strokeEnd": "known: end, ready, relax, start"}
    for ref, sync in (("g:ready", "stroke"), ("g:relax", "relax"), ("g:strokeStart", None), ("g:strokeEnd", None)):
        constraint = Constraint(operators=(Synchronize(ref=ref, syncs=("w:end",)),))
        block = Block(id="b", behaviors=BEHAVIORS, constraints=(constraint,), dialect="bml-1.0")
        found = relations_of(block)
        points = [term.point for term in found.equals[0].terms]
        assert points == [*([Point("g", sync)] if sync else []), Point("w", "end")]
        words = f"constraint 1: gaze has no sync point {ref!r} ({advice.get(ref)}); it is ignored"
        assert [each.message for each in found.problems] == ([] if sync else [words])

"""What is said of behaviors that cannot be on time: which is lost, what takes how long, and which words are kept."""

import re
from itertools import pairwise, permutations

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from engage_hri.schemas.behaviors import BlockBehavior, Gaze, Head, Pointing, Posture, Speech, Timing, Wait
from engage_hri.schemas.blocks import Block
from engage_hri.schemas.documents.xml_decode import decode_xml
from engage_hri.services.realizer.plan.known import Holder, Known, qualified
from engage_hri.services.realizer.plan.losses import Times, clashes
from engage_hri.services.realizer.plan.phases import Chain, chain
from engage_hri.services.realizer.plan.planner import Plan, plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused, Classes, Equal, Order, Relations, Term
from engage_hri.services.realizer.points import ORIGIN, Point
from tests.random_cases import share_of
from tests.realizer.oracle import SEVEN, estimate, phases_of, points_of, relaxed
from tests.realizer.way_round import closed, read

BEHAVIORS: tuple[BlockBehavior, ...] = (
    Head(id="x", lexeme="NOD"),
    Pointing(id="x", target="a"),
    Gaze(id="x", target="a"),
    Posture(id="x", lexeme="LEAN"),
    Speech(id="x", text="one two"),
)


def planned(block: Block) -> Plan:
    """Everything has a part of its own, but all speeches one voice."""
    known = [estimate(each) for each in block.behaviors]
    known = [
        replace(each, parts=("voice",)) if isinstance(it, Speech) else each
        for each, it in zip(known, block.behaviors, strict=True)
    ]
    return plan_block(block, known)


# -- too little time ---------------------------------------------------------------------------------------------


@settings(max_examples=share_of(120), deadline=None)
@given(st.data())
def test_what_takes_too_long_is_told_with_both_times_and_the_way_round(data: st.DataObject) -> None:
    """Two points of one behavior are so close together that its phases, as short as can be, take longer."""
    behavior = data.draw(st.sampled_from(BEHAVIORS))
    points, shortest = points_of(behavior), [each.shortest for each in phases_of(behavior)]
    ends = st.integers(0, len(points) - 1)
    first, last = data.draw(st.tuples(ends, ends).filter(lambda each: sum(shortest[each[0] : each[1]]) > 0.25))
    needed, time = sum(shortest[first:last]), data.draw(st.sampled_from((0.0, 0.125, 0.25)))
    anchor, seconds = data.draw(st.sampled_from((("", 2.0), ("", 1.5), ("w:start", 2.0), ("w:end", 2.0))))
    refs = (f"{anchor}+{seconds}", f"{anchor}+{seconds + time}") if anchor else (f"{seconds}", f"{seconds + time}")
    timing = tuple(Timing(points[each], ref) for each, ref in zip((first, last), refs, strict=True))
    line = data.draw(st.sampled_from((0, 12)))
    timed: tuple[BlockBehavior, ...] = (Wait(id="w", duration=1.0), replace(behavior, timing=timing, line=line))
    made = planned(Block(id="b", behaviors=timed))

    (problem,) = made.problems
    assert (problem.kind, problem.behavior) == ("IMPOSSIBLE_TO_SCHEDULE", "x")
    told = re.fullmatch(
        r"(line 12: )?cannot be on time: from (.+) to (.+) it takes (\S+) s at least, and there are (\S+) s: "
        r"(.*); (.*)",
        problem.message,
    )
    assert told is not None, problem.message
    assert bool(told[1]) == bool(line)
    assert (told[2], told[3]) == (f"x:{points[first]}", f"x:{points[last]}")
    assert (told[4], told[5]) == (f"{needed:.2f}", f"{time:.2f}")
    if is_one := re.fullmatch("(.+) is one instant", told[6]):
        assert {told[2], told[3]} <= {*is_one[1].split(" = ")}
        assert not time
    else:
        way = closed(read(told[6]))
        assert sum(seconds for *_, seconds in way) == pytest.approx(needed - time, abs=2e-3 * len(way))
    if isinstance(behavior, Speech):
        assert (made.dropped, tuple(made.given_up)) == ((), ("x",))
        assert told[7] == f"x:{points[last]} = {refs[1]} is given up, so that the words are said"
    else:
        assert (made.dropped, tuple(made.given_up)) == (("x",), ())
        assert told[7] == "the behavior is dropped (give it more time, or leave out one of its times)"


LOST = {
    "whose phase cannot last so long, if none is too long": (
        '<wait id="w" duration="1"/><head id="n" lexeme="NOD" start="w:start" ready="w:start+1"/>'
        '<wait id="v" duration="1" start="w:start"/>',
        ("n",),
    ),
    "whose phase is too long, not whose cannot last so long": (
        '<wait id="w" duration="3" start="n:start" end="n:ready"/><head id="n" lexeme="NOD"/>',
        ("w",),
    ),
    "who waits for itself": (
        '<wait id="v" duration="1" start="n:start"/><head id="n" lexeme="NOD"/>'
        '<constraint><after ref="n:stroke+1"><sync ref="n:stroke"/></after></constraint>',
        ("n",),
    ),
    "nobody more where one who is lost anyway has to do with it": (
        '<head id="a" lexeme="NOD" start="1"/><head id="b" lexeme="NOD" start="1" stroke="a:start+0.1" end="5.1"/>'
        '<head id="c" lexeme="NOD" start="5" end="b:end"/>',
        ("b",),
    ),
    "of two that are timed, the later in the document": (
        '<head id="n" lexeme="NOD" start="1"/><head id="m" lexeme="NOD" start="1" end="n:start+0.3"/>',
        ("m",),
    ),
    "whose phase is too long, not who waits for it": (
        '<wait id="w" duration="3" start="0"/><head id="n" lexeme="NOD" start="1"/>'
        '<constraint><before ref="n:start"><sync ref="w:end"/></before></constraint>',
        ("w",),
    ),
    "the one that may be lost": (
        '<head id="n" lexeme="NOD" start="0" end="c:start"/><head id="c" lexeme="NOD" required="true" start="0.2"/>',
        ("n",),
    ),
    "of two phases in a row, that of the later": (
        '<wait id="v" duration="2" start="0"/><wait id="w" duration="2" start="v:end" end="3"/>',
        ("w",),
    ),
    "a nod, not the words": (
        '<head id="n" lexeme="NOD" start="s:start" end="s:end"/>'
        '<speech id="s" start="1" end="1.5"><text>a</text></speech>',
        ("n",),
    ),
    "a nod, not the words that follow it": (
        '<head id="n" lexeme="NOD" start="0"/><speech id="s" start="n:end" end="0.7"><text>a</text></speech>',
        ("n",),
    ),
    "each of two circles, one behavior": (
        '<head id="n" lexeme="NOD" start="1" end="1.2"/><head id="m" lexeme="NOD" start="3" end="3.2"/>',
        ("n", "m"),
    ),
    "one of two circles that share a behavior": (
        '<wait id="w" duration="5" start="0" end="1"/><wait id="v" duration="3" start="w:end" end="w:end"/>',
        ("v", "w"),
    ),
}


@pytest.mark.parametrize("rule", LOST)
def test_who_is_lost(rule: str) -> None:
    document, lost = LOST[rule]
    block = decode_xml(f'<bml id="b">{document}</bml>')
    assert isinstance(block, Block)

    assert planned(block).dropped == lost


# -- waits that cannot be ------------------------------------------------------------------------------------------


PAIRS = (("a", "b"), ("b", "c"), ("a", "c"), ("b", "a"), ("c", "a"))


def is_too_late(earlier: Chain, sync: str, later: Chain, ties: list[tuple[str, str, float]]) -> bool:
    """Is there no time for `later` to begin when `earlier` is at `sync` (or ever), with phases as short as can be?"""
    names = {str(point): 0.0 for each in (earlier, later) for point in each.points} | {"0": -1e9}
    names |= {name: 0.0 for one, other, _ in ties for name in (one, other)}
    lags = [(f"{earlier.behavior.id}:{sync}", f"{later.behavior.id}:start", 0.0)] if sync else []
    for each in (earlier, later):
        pairs = zip(pairwise(each.points), each.segments, strict=True)
        lags += [(str(since), str(to), segment.shortest) for (since, to), segment in pairs]
    for one, other, seconds in ties:
        lags += [(one, other, seconds), (other, one, -seconds)]
    return relaxed(names, lags) is None


@settings(max_examples=share_of(150), deadline=None)
@given(st.data())
def test_who_cannot_wait_for_a_part_is_lost_or_who_has_it_and_then_the_other_keeps_it(data: st.DataObject) -> None:
    draw = data.draw
    kinds: tuple[BlockBehavior, ...] = (BEHAVIORS[0], BEHAVIORS[1], BEHAVIORS[4])
    chosen = [replace(draw(st.sampled_from(kinds)), id=id) for id in "abc"]
    chains = {each.id: chain(each, estimate(each)) for each in chosen}
    classes, ties = Classes(), list[tuple[str, str, float]]()
    for each in chains.values():
        for point in each.points:
            classes.add(point)
    for one, other in draw(st.lists(st.sampled_from(PAIRS[:4]), max_size=3)):
        ends = [draw(st.sampled_from(chains[id].points)) for id in (one, other)]
        seconds = draw(st.sampled_from((-1.0, 0.0, 0.25, 1.0, 2.0)))
        equal = Equal((Term(ends[0], seconds, ""), Term(ends[1], 0.0, "")))
        if classes.tie_if_possible(equal):
            ties.append((str(ends[0]), str(ends[1]), seconds))
    turns = {
        (later, draw(st.sampled_from(chains[earlier].points[1:])))
        for earlier, later in draw(st.sets(st.sampled_from(PAIRS)))
    }
    required = draw(st.sets(st.sampled_from("abc")))
    assume(not any(is_too_late(one, "", other, ties) for one, other in permutations(chains.values(), 2)))

    lost: dict[str, tuple[str, str]] = {}
    keeps: dict[str, str] = {}
    for later, point in sorted(turns, key=lambda each: (each[0], each[1].behavior)):
        earlier = keeps.get(point.behavior, point.behavior)
        syncs = [each.sync for each in chains[earlier].points]
        sync = point.sync if earlier == point.behavior or point.sync in syncs else "end"
        free = {earlier, later} - required
        if free and later not in lost and is_too_late(chains[earlier], sync, chains[later], ties):
            lost[max(free)] = (later, f"{earlier}:{sync}")
            keeps[max(free)] = earlier if max(free) == later else later
    found = clashes(turns, chains, required, classes)
    assert [each.behavior for each in found] == list(lost)
    for it in found:
        later, awaited = lost[it.behavior]
        earlier = awaited.partition(":")[0]
        parts = [each for each in chains[later].parts if each in chains[earlier].parts]
        has = f"{earlier} has the {parts[0].replace('_', ' ')} until {awaited}" if parts else ""
        if not parts:
            assert it.reason == f"cannot be on time: {later} would have to wait for {awaited}"
        elif it.behavior == later:
            assert it.reason == f"cannot be on time: {has}"
        else:
            assert it.reason == f"cannot be on time: {has}, and {later} cannot wait for that"
        assert it.points == chains[it.behavior].points
        assert it.among == {*chains[earlier].points, *chains[later].points}
        assert it.turn == (later, Point(*awaited.split(":", 1)))


def test_of_two_speeches_that_begin_at_once_the_later_gives_its_time_up() -> None:
    speeches = "".join(f'<speech id="{id}" start="1"><text>one</text></speech>' for id in "st")
    block = decode_xml(f'<bml id="b">{speeches}</bml>')
    assert isinstance(block, Block)
    made = planned(block)

    assert (made.dropped, tuple(made.given_up)) == ((), ("t",))
    assert made.problems[0].message.endswith("; t:start = 1 is given up, so that the words are said")
    assert "s has the voice until s:end: s:start is 1 s after bml:start" in made.problems[0].message


# -- parts that other blocks have -----------------------------------------------------------------------------------


def others(*behaviors: BlockBehavior, times: dict[str, float]) -> Known:
    """A block that has the parts of these behaviors, with the times of some of its points."""
    holders = {}
    for each in behaviors:
        parts = chain(each, estimate(each))
        points = tuple(qualified("other", point) for point in parts.points)
        renamed = replace(parts, points=points)
        holders[f"other:{each.id}"] = Holder(renamed, is_natural=False, kept=frozenset(points))
    points_known = {Point(*name.rsplit(":", 1)): at for name, at in times.items()}
    content = {"other": Block(id="other", behaviors=behaviors)}
    return Known(blocks=content, points=points_known, holders=holders)


THEIRS = Pointing(id="x", target="a", mode="BOTH_HANDS")
TIMES = {f"other:x:{sync}": at for sync, at in zip(SEVEN, (-1.0, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0), strict=True)}


@pytest.mark.parametrize(
    ("theirs", "mode", "name", "remedy"),
    [
        ("BOTH_HANDS", "LEFT_HAND", "left arm", ""),
        ("BOTH_HANDS", "BOTH_HANDS", "left arm and right arm", ""),
        ("RIGHT_HAND", "BOTH_HANDS", "right arm", 'use one hand with mode="LEFT_HAND", or '),
        ("RIGHT_HAND", "RIGHT_HAND", "right arm", 'use the other hand with mode="LEFT_HAND", or '),
    ],
)
def test_who_has_no_time_to_wait_for_another_block_is_told_what_that_has_and_until_when(
    theirs: str, mode: str, name: str, remedy: str
) -> None:
    ours = Pointing(id="p", target="a", mode=mode, timing=(Timing("start", "1"),), line=4)  # type: ignore[arg-type]
    known = others(replace(THEIRS, mode=theirs), times=TIMES)
    made = plan_block(Block(id="b", behaviors=(ours,)), [estimate(ours)], known=known)

    assert [(each.kind, each.behavior, each.message) for each in made.problems] == [
        (
            "IMPOSSIBLE_TO_SCHEDULE",
            "p",
            f"line 4: cannot be on time: other:x has the {name} until other:x:end, 5.00 s after the start of the "
            f"block; the behavior is dropped ({remedy}let one of the two begin later)",
        )
    ]


def test_a_point_of_another_block_that_comes_after_a_fixed_time_is_told_with_its_own() -> None:
    ours = Head(
        id="n", lexeme="NOD", timing=(Timing("start", "1"), Timing("end", "other:s:end"), Timing("relax", "2"))
    )
    speech = Speech(id="s", text="so")
    known = Known(
        blocks={"other": Block(id="other", behaviors=(speech,))},
        points={Point("other:s", "end"): 7.0, Point("other:s", "start"): 1.0},
    )
    made = plan_block(Block(id="b", behaviors=(ours,)), [estimate(ours)], known=known)

    (broken,) = made.broken
    assert (broken.point, broken.direction, broken.said) == (Point("n", "end"), "earlier", "n:end = other:s:end")
    assert broken.seconds == pytest.approx(7.0 - made.predicted(Point("n", "end")))
    assert made.predicted(Point("n", "start")) == 1.0


# -- words that are kept -----------------------------------------------------------------------------------------

NAMES = ("s", "t", "n", "")


def term(draw: st.DrawFn, number: int) -> Term:
    behavior = draw(st.sampled_from(NAMES))
    point = Point(behavior, draw(st.sampled_from(("start", "end")))) if behavior else ORIGIN
    return Term(point, 0.0, f"{point}@{number}")


@st.composite
def relations(draw: st.DrawFn) -> Relations:
    equals = []
    for number in range(draw(st.integers(0, 4))):
        terms = tuple(term(draw, number) for _ in range(draw(st.integers(1, 3))))
        equals.append(Equal(terms, draw(st.sampled_from(("", terms[0].point.behavior)))))
    orders = [Order(term(draw, 9), term(draw, 8)) for _ in range(draw(st.integers(0, 3)))]
    return Relations(tuple(equals), tuple(orders), frozenset(draw(st.sets(st.sampled_from(("s", "n"))))))


def points_in(relation: Equal | Order) -> list[Point]:
    terms = relation.terms if isinstance(relation, Equal) else (relation.earlier, relation.later)
    return [each.point for each in terms]


def may_go(known: Relations, relation: Equal | Order, point: Point) -> bool:
    """Does it name the point, and is it not said by a behavior that is required?"""
    by = relation.behavior if isinstance(relation, Equal) else ""
    return point in points_in(relation) and by not in known.required


@settings(max_examples=share_of(150), deadline=None)
@given(
    relations(),
    st.lists(st.sampled_from([Point(id, sync) for id in "st" for sync in ("start", "end")]), max_size=3, unique=True),
    st.frozensets(st.sampled_from([ORIGIN, *(Point(id, sync) for id in "stn" for sync in ("start", "end"))])),
    st.sampled_from(((), ("n",), ("t",))),
)
def test_a_time_of_a_speech_is_given_up_the_nearest_of_the_last_point_first(
    known: Relations, points: list[Point], among: frozenset[Point], dropped: tuple[str, ...]
) -> None:
    """Again and again, until there is none left: what goes each time is chosen from a plain list, by the rules."""
    times = Times(known, {"s", "t"})
    equals: list[Equal | None] = list(known.equals)
    orders: list[Order | None] = list(known.orders)
    while True:
        candidates = []
        for far in range(3):  # what is tied to it through what is dropped goes last
            for last in range(len(points) - 1, -1, -1):
                point = points[last]
                for is_order, group in ((False, equals), (True, orders)):
                    for number, each in enumerate(group):
                        if each is None or not may_go(known, each, point):
                            continue
                        others = {one for one in points_in(each) if one != point}
                        left_there = {one for one in others if one.behavior not in dropped}
                        if (left_there & among, left_there, others)[far]:
                            is_own = isinstance(each, Equal) and each.behavior == point.behavior
                            candidates.append((far, -last, is_order, not is_own, number, point))
        found = times.give_up(points, among, dropped)
        if not candidates:
            assert found is None
            break
        _, _, is_order, _, number, point = min(candidates, key=lambda each: each[:5])
        if is_order:
            order, orders[number] = orders[number], None
            assert order is not None
            assert found == (point, f"{order.earlier.text} <= {order.later.text}")
        else:
            equal = equals[number]
            assert equal is not None
            assert found == (point, " = ".join(each.text for each in equal.terms))
            rest = tuple(each for each in equal.terms if each.point != point)
            equals[number] = Equal(rest) if len(rest) > 1 and not equal.behavior else None
    left = times.left
    assert left.equals == tuple(each for each in equals if each is not None)
    assert left.orders == tuple(each for each in orders if each is not None)
    assert left.required == known.required


def test_what_a_required_behavior_says_is_not_given_up_but_the_block() -> None:
    document = (
        '<head id="n" lexeme="NOD" required="true" start="1" end="s:start+0.1"/>'
        '<speech id="s" start="1"><text>a</text></speech>'
    )
    block = decode_xml(f'<bml id="b">{document}</bml>')
    assert isinstance(block, Block)

    assert tuple(planned(block).given_up) == ("s",)
    fixed: tuple[BlockBehavior, ...] = tuple(replace(each, required=True) for each in block.behaviors)
    with pytest.raises(BlockRefused, match=r"cannot be on time.*it is required"):
        planned(replace(block, behaviors=fixed))

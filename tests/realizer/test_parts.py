"""Several behaviors of one block that move the same part."""

from itertools import pairwise
from typing import Any

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import FaceLexeme, FaceShift, Gaze, Gesture, Head, Speech
from engage_hri.services.realizer.plan import planner
from engage_hri.services.realizer.plan.deadlocks import clashes
from engage_hri.services.realizer.plan.instants import Classes
from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.phases import chain
from engage_hri.services.realizer.plan.plan import Plan
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import Equal, Term
from engage_hri.services.realizer.plan.schedule import Solution
from engage_hri.services.realizer.points import Point
from tests.realizer.fake_body import FakeBody
from tests.realizer.planning import GAZE, LEFT, LEFT_TOO, OTHER, SPEECH, at, plan, timed, warnings
from tests.realizer.stage import after, block, together


def test_who_starts_later_takes_the_arm_over_and_the_earlier_ends_there() -> None:
    made = plan(block((LEFT, LEFT_TOO), after("p:stroke_end", "q:start")))

    assert made.problems == ()
    assert at(made, "p:stroke_end") == at(made, "q:start") == 1.5
    assert at(made, "p:relax") == at(made, "p:end") == 1.5


def test_two_fixed_windows_on_one_arm_cost_the_later_in_the_document() -> None:
    made = plan(block((timed(LEFT, start="0", end="5"), timed(LEFT_TOO, start="2", end="7"))))

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "q")]


def test_of_two_fixed_windows_on_one_arm_the_required_stays() -> None:
    must = replace(timed(LEFT_TOO, start="2", end="7"), required=True)
    made = plan(block((timed(LEFT, start="0", end="5"), must)))

    assert made.dropped == ("p",)


def test_who_may_come_later_waits_until_the_arm_is_no_longer_asked_for() -> None:
    made = plan(block((timed(LEFT, stroke_end="5"), LEFT_TOO, SPEECH), after("s:start", "q:start")))

    assert made.problems == ()
    assert at(made, "q:start") == at(made, "p:stroke_end") == 5.0


def test_a_gesture_that_names_no_hand_takes_the_arm_that_is_free() -> None:
    beat = timed(Gesture(id="q", lexeme="BEAT"), start="2", end="7")
    right = replace(LEFT, mode="RIGHT_HAND")
    made = plan(block((timed(right, start="0", end="5"), beat)))

    assert made.problems == ()
    assert [getattr(each, "mode", None) for each in made.behaviors] == ["RIGHT_HAND", "LEFT_HAND"]
    assert made.block.behaviors == made.behaviors


def test_a_gesture_that_names_no_hand_finds_none_free() -> None:
    beat = timed(Gesture(id="q", lexeme="BEAT"), start="2", end="7")
    both = timed(Gesture(id="p", lexeme="BEAT", mode="BOTH_HANDS"), start="0", end="5")
    made = plan(block((both, beat)))

    assert made.dropped == ("q",)


def test_arms_take_turns_where_one_alone_would_keep_words_waiting() -> None:
    words = [Speech(id=f"s{number}", text="one") for number in range(25)]
    beats = [timed(Gesture(id=f"g{number}", lexeme="BEAT"), stroke=f"s{number}:start") for number in range(25)]
    made = plan(block((*words, *beats)))

    assert made.problems == ()
    assert [at(made, f"s{number}:start") for number in range(25)] == [1.25 + number for number in range(25)]
    hands = [each.mode for each in made.block.behaviors if isinstance(each, Gesture)]
    assert all(one != other for one, other in pairwise(hands[1:]))


def test_a_gesture_that_nobody_asked_for_now_waits_for_the_arm() -> None:
    made = plan(block((LEFT, Gesture(id="q", lexeme="BEAT", mode="LEFT_HAND"))))

    assert at(made, "q:start") == at(made, "p:end") == 2.25


def test_a_nod_is_on_top_of_the_gaze() -> None:
    made = plan(block((GAZE, Head(id="n", lexeme="NOD"))))

    assert at(made, "n:start") == at(made, "g:start") == 0.0
    assert at(made, "g:relax") == at(made, "n:end") == 1.0


def test_a_gaze_that_must_last_is_not_taken_over_before() -> None:
    made = plan(block((timed(GAZE, end="5"), Gaze(id="h", target="cup"), SPEECH), together("h:start", "s:start")))

    assert at(made, "h:start") == at(made, "s:start") >= 4.5


@pytest.mark.parametrize("tie", [{}, {"start": "p:stroke_start"}])
def test_who_has_begun_waits_for_nobody_any_more(tie: dict[str, str]) -> None:
    one, other = Gesture(id="p", lexeme="BEAT", mode="LEFT_HAND"), Gesture(id="q", lexeme="BEAT", mode="LEFT_HAND")
    example = block((one, timed(other, **tie)))
    points = {Point("p", "start"): 0.0, Point("q", "start"): 0.1}
    known = Known(points=points, begun=frozenset({"p", "q"}))

    made = plan_block(example, [FakeBody().estimate(each) for each in example.behaviors], known=known)

    assert (made.dropped, made.problems) == ((), ())


def test_who_has_begun_uses_the_arm_that_it_has() -> None:
    """The other is for the right arm only. Had the first not begun, it would take the left one."""
    one, other = Gesture(id="p", lexeme="BEAT"), timed(Gesture(id="q", lexeme="BEAT", mode="RIGHT_HAND"), start="0.3")
    estimates = [FakeBody().estimate(each) for each in (one, other)]
    points = {Point("p", "start"): 0.0}

    free, bound = (
        plan_block(block((one, other)), estimates, known=Known(points=points, begun=begun))
        for begun in (frozenset(), frozenset({"p"}))
    )

    assert [each.chains["p"].parts for each in (free, bound)] == [("left_arm",), ("right_arm",)]


def test_who_has_begun_keeps_its_arm_for_its_stroke_though_nobody_says_when_it_comes() -> None:
    """The other has a time, so it would come first, had the first not begun."""
    example = block((LEFT, LEFT_TOO, timed(SPEECH, start="0.25")), after("s:end", "q:start"))
    known = Known(points={Point("p", "start"): 0.0, Point("q", "start"): 0.5}, begun=frozenset({"p"}))

    made = plan_block(example, [FakeBody().estimate(each) for each in example.behaviors], known=known)

    assert (made.dropped, made.turns) == ((), frozenset({("q", Point("p", "stroke_end"))}))
    assert at(made, "p:stroke_end") == at(made, "q:start") == 1.5


def test_who_has_begun_loses_no_stroke_because_its_other_arm_would_have_been_free() -> None:
    """It names no hand, and cannot change by now; the other, which names one, has no time to wait."""
    one, other = Gesture(id="p", lexeme="BEAT"), timed(Gesture(id="q", lexeme="BEAT", mode="RIGHT_HAND"), start="0.3")
    known = Known(points={Point("p", "start"): 0.0}, begun=frozenset({"p"}))

    made = plan_block(block((one, other)), [FakeBody().estimate(each) for each in (one, other)], known=known)

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "q")]
    assert at(made, "p:end") == 2.25


def test_who_keeps_the_part_of_a_lost_one_may_be_without_its_points() -> None:
    """A shift has no stroke, which the third was to wait for."""
    smile = FaceLexeme(id="g", lexeme="SMILE")
    faces = (FaceShift(id="f", lexeme="SMILE"), smile, replace(smile, id="h"))
    chains = {each.id: chain(each, FakeBody().estimate(each)) for each in faces}
    classes = Classes()
    for point in (point for each in chains.values() for point in each.points):
        classes.add(point)
    classes.tie(Equal((Term(Point("f", "end"), 0.0, ""), Term(Point("g", "stroke"), 0.0, ""))), "b")

    losses = clashes([("g", Point("f", "end")), ("h", Point("g", "stroke"))], chains, (), classes)

    assert [each.behavior for each in losses] == ["g"]


def nodding(order: tuple[int, ...]) -> Plan:
    """The plan of sentences, and of as many nods, in document order each at the end of the sentence that is named."""
    sentences = [Speech(id=f"s{number}", text="Hi, you there.") for number in range(len(order))]
    nods = [timed(Head(id=f"n{i}", lexeme="NOD"), stroke=f"s{sentence}:end") for i, sentence in enumerate(order)]
    return plan(block((*sentences, *nods)))


@pytest.mark.parametrize("order", [(8, 1, 3, 6, 7, 9, 5, 0, 4, 2), tuple(range(9, -1, -1)), (1, 0, 3, 2, 5, 4)])
def test_nods_are_made_in_the_order_of_the_sentences_that_they_are_tied_to(order: tuple[int, ...]) -> None:
    made = nodding(order)

    assert made.problems == ()
    starts = [at(made, f"s{number}:start") for number in range(len(order))]
    assert starts == sorted(starts)


def test_of_nods_in_disorder_few_plans_are_made(monkeypatch: pytest.MonkeyPatch) -> None:
    plans = 0
    solve = planner.predict

    def counted(*args: Any) -> Solution:
        nonlocal plans
        plans += 1
        return solve(*args)

    monkeypatch.setattr(planner, "predict", counted)
    nodding(tuple(number * 17 % 30 for number in range(30)))

    assert plans < 60


def test_who_is_in_nobodys_way_keeps_the_place_that_the_document_gives_it() -> None:
    sentences = (SPEECH, OTHER)
    early = timed(Head(id="early", lexeme="NOD"), end="9")
    nods = [timed(Head(id=id, lexeme="NOD"), stroke=to) for id, to in (("later", "t:end"), ("first", "s:end"))]
    made = plan(block((*sentences, early, *nods)))

    assert made.problems == ()
    assert at(made, "early:start") < at(made, "first:start") < at(made, "later:start")


def test_a_turn_to_begin_with_is_let_go_if_there_is_no_time_for_it() -> None:
    late, soon = (timed(Head(id=id, lexeme="NOD"), stroke=to) for id, to in (("late", "t:end"), ("soon", "s:end")))
    example = block((SPEECH, OTHER, late, soon))
    turn = ("soon", Point("late", "stroke_end"))
    made = plan_block(example, [FakeBody().estimate(each) for each in example.behaviors], turns=frozenset((turn,)))

    assert made.problems == ()
    assert at(made, "s:start") < at(made, "t:start")
    assert turn not in made.turns

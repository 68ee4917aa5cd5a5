"""Times of speeches that are given up: which first, where several could be; and what is kept by that."""

import pytest
from msgspec.structs import replace

from engage_hri.schemas.behaviors import Gesture, Speech
from engage_hri.services.realizer.plan.given_up import Times
from engage_hri.services.realizer.plan.known import Known
from engage_hri.services.realizer.plan.planner import plan_block
from engage_hri.services.realizer.plan.relations import BlockRefused, Equal, Relations, Term
from engage_hri.services.realizer.points import ORIGIN, Point
from tests.realizer.fake_body import FakeBody
from tests.realizer.planning import at, plan, timed, warnings
from tests.realizer.stage import block

END, NOD = Point("s", "end"), Point("n", "end")


def test_a_tie_through_what_is_dropped_is_given_up_last_even_if_it_is_in_the_way() -> None:
    """What is in the way is the tie to the nod; but that was dropped, and the tie stands for others behind it."""
    through = Equal((Term(END, 0.0, "s:end"), Term(NOD, 0.0, "n:end")))
    time = Equal((Term(END, 0.0, "s:end"), Term(ORIGIN, 2.0, "2")), "s")
    times = Times(Relations((through, time), (), frozenset()), {"s"})

    assert times.give_up([END], {NOD}, {"n"}) == (END, "s:end = 2")
    assert times.give_up([END], {NOD}, {"n"}) == (END, "s:end = n:end")
    assert times.give_up([END], {NOD}, {"n"}) is None


def test_what_is_in_the_way_is_given_up_before_what_is_not() -> None:
    through = Equal((Term(END, 0.0, "s:end"), Term(NOD, 0.0, "n:end")))
    time = Equal((Term(END, 0.0, "s:end"), Term(ORIGIN, 2.0, "2")), "s")
    times = Times(Relations((through, time), (), frozenset()), {"s"})

    assert times.give_up([END], {NOD}, ()) == (END, "s:end = n:end")


def test_of_two_times_of_one_point_the_own_one_is_given_up_first_wherever_it_stands() -> None:
    through = Equal((Term(END, 0.0, "s:end"), Term(NOD, 0.0, "n:end")))
    time = Equal((Term(END, 0.0, "s:end"), Term(ORIGIN, 2.0, "2")), "s")
    for relations in ((through, time), (time, through)):
        times = Times(Relations(relations, (), frozenset()), {"s"})

        assert times.give_up([END], (), ()) == (END, "s:end = 2")


def test_what_one_speech_has_given_up_the_other_cannot_give_up_again() -> None:
    other = Point("t", "end")
    tie = Equal((Term(END, 0.0, "s:end"), Term(other, 0.0, "t:end")))
    times = Times(Relations((tie,), (), frozenset()), {"s", "t"})

    assert times.give_up([END], (), ()) == (END, "s:end = t:end")
    assert times.give_up([other], (), ()) is None


WORDS, MORE = timed(Speech(id="s", text="one"), start="0"), timed(Speech(id="t", text="two"), start="0.5")
BEAT = Gesture(id="g", lexeme="BEAT", mode="RIGHT_HAND")
"""It takes 1.25 s to its stroke."""


@pytest.mark.parametrize("place", range(3))
def test_what_depends_on_a_time_that_is_given_up_is_not_dropped_for_it(place: int) -> None:
    """The voice is taken until 1 s, so the words come later; by then the gesture has time enough."""
    behaviors = [WORDS, MORE]
    behaviors.insert(place, timed(BEAT, stroke="t:start"))
    made = plan(block(behaviors))

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "t")]
    assert "t:start = 0.5 is given up" in made.problems[0].message
    assert at(made, "g:stroke") == at(made, "t:start") == 1.25
    assert list(made.chains) == [each.id for each in behaviors]


def test_what_cannot_be_on_time_either_way_is_dropped_once() -> None:
    made = plan(block((WORDS, MORE, timed(BEAT, start="0", stroke="t:start", end="2"))))

    assert warnings(made) == [("IMPOSSIBLE_TO_SCHEDULE", "t"), ("IMPOSSIBLE_TO_SCHEDULE", "g")]
    assert (made.dropped, at(made, "t:start")) == (("g",), 1.0)


def test_a_time_that_can_be_kept_is_not_given_up_for_what_depends_on_it() -> None:
    made = plan(block((MORE, timed(BEAT, stroke="t:start"))))

    assert (made.dropped, at(made, "t:start")) == (("g",), 0.5)


def test_of_required_words_it_is_said_that_without_that_they_give_up_their_time() -> None:
    example = block((timed(Speech(id="x", text="one", required=True), start="0", end="0.1"),))
    with pytest.raises(BlockRefused) as refused:
        plan(example)

    assert refused.value.fault.advice == (
        "give it more time, or leave out one of its times; "
        "it is required: without `required` x:end = 0.1 would be given up, and its words said"
    )
    made = plan(replace(example, behaviors=(replace(example.behaviors[0], required=False),)))
    assert (made.dropped, list(made.given_up["x"])) == ((), ["x:end = 0.1"])


def test_of_a_required_movement_it_is_said_that_without_that_it_is_dropped() -> None:
    example = block((timed(replace(BEAT, required=True), start="0", end="0.1"),))
    with pytest.raises(BlockRefused) as refused:
        plan(example)

    assert refused.value.fault.advice == (
        "give it more time, or leave out one of its times; it is required: without `required` it would be dropped"
    )
    assert plan(replace(example, behaviors=(replace(example.behaviors[0], required=False),))).dropped == ("g",)


def test_a_speech_that_has_begun_late_takes_its_time_though_one_of_its_times_is_given_up() -> None:
    """When it began is doubted at first, as its end would be too late for that; not once the end is given up."""
    words = timed(Speech(id="s", text="one two three four"), end="0.5")
    written = block((words, Speech(id="t", text="one")))
    estimates = [FakeBody().estimate(each) for each in written.behaviors]
    known = Known(points={Point("s", "start"): 0.75}, begun=frozenset({"s"}))
    made = plan_block(written, estimates, known=known)

    assert made.given_up["s"]
    assert at(made, "s:start") == 0.75
    assert at(made, "t:start") == at(made, "s:end") == 0.75 + estimates[0].phases[0].natural

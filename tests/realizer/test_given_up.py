"""Times of speeches that are given up: which first, where several could be."""

from engage_hri.services.realizer.plan.given_up import times_of
from engage_hri.services.realizer.plan.relations import Equal, Relations, Term
from engage_hri.services.realizer.plan.steps import finished
from engage_hri.services.realizer.points import ORIGIN, Point

END, NOD = Point("s", "end"), Point("n", "end")


def test_a_tie_through_what_is_dropped_is_given_up_last_even_if_it_is_in_the_way() -> None:
    """What is in the way is the tie to the nod; but that was dropped, and the tie stands for others behind it."""
    through = Equal((Term(END, 0.0, "s:end"), Term(NOD, 0.0, "n:end")))
    time = Equal((Term(END, 0.0, "s:end"), Term(ORIGIN, 2.0, "2")), "s")
    times = finished(times_of({"s"}, Relations((through, time), (), frozenset())))

    assert times.give_up([END], {NOD}, {"n"}) == ("s", "s:end = 2")
    assert times.give_up([END], {NOD}, {"n"}) == ("s", "s:end = n:end")
    assert times.give_up([END], {NOD}, {"n"}) is None


def test_what_is_in_the_way_is_given_up_before_what_is_not() -> None:
    through = Equal((Term(END, 0.0, "s:end"), Term(NOD, 0.0, "n:end")))
    time = Equal((Term(END, 0.0, "s:end"), Term(ORIGIN, 2.0, "2")), "s")
    times = finished(times_of({"s"}, Relations((through, time), (), frozenset())))

    assert times.give_up([END], {NOD}, ()) == ("s", "s:end = n:end")


def test_of_two_times_of_one_point_the_own_one_is_given_up_first_wherever_it_stands() -> None:
    through = Equal((Term(END, 0.0, "s:end"), Term(NOD, 0.0, "n:end")))
    time = Equal((Term(END, 0.0, "s:end"), Term(ORIGIN, 2.0, "2")), "s")
    for relations in ((through, time), (time, through)):
        times = finished(times_of({"s"}, Relations(relations, (), frozenset())))

        assert times.give_up([END], (), ()) == ("s", "s:end = 2")


def test_what_one_speech_has_given_up_the_other_cannot_give_up_again() -> None:
    other = Point("t", "end")
    tie = Equal((Term(END, 0.0, "s:end"), Term(other, 0.0, "t:end")))
    times = finished(times_of({"s", "t"}, Relations((tie,), (), frozenset())))

    assert times.give_up([END], (), ()) == ("s", "s:end = t:end")
    assert times.give_up([other], (), ()) is None

"""The paired test against samples worked by hand, and against a slow count of all signs."""

from itertools import product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.services.study.permutation import DRAWS, EXACT, Paired, holm, paired, separate


def test_three_differences_of_one_sign_could_still_be_chance():
    test = paired([1.0, 2.0, 3.0])

    # Of the eight choices of signs only all + and all - give a sum as far from 0 as 6.
    assert (test.n, test.mean, test.p) == (3, 2.0, 2 / 8)
    assert test.effect == pytest.approx(2.0)
    assert (test.low, test.high) == (None, None)  # even these could not be significant


def test_the_interval_is_what_the_test_does_not_reject():
    test = paired([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])

    assert test.p == 2 / 64
    # Less than 1 leaves all six on one side (p = 2/64); just above, one is free to be either (p = 4/64).
    assert test.low == pytest.approx(1.0)
    assert test.high == pytest.approx(6.0)


def test_signs_that_cancel_are_no_difference():
    test = paired([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])

    assert (test.mean, test.p, test.effect) == (0.0, 1.0, 0.0)
    assert test.low is not None
    assert test.high is not None
    assert test.low < 0.0 < test.high


def test_equal_values_give_numbers_and_no_effect_size():
    test = paired([0.0] * 8)

    assert (test.mean, test.p, test.effect) == (0.0, 1.0, None)
    assert (test.low, test.high) == (pytest.approx(0.0, abs=1e-8), pytest.approx(0.0, abs=1e-8))


def test_the_same_difference_in_every_pair_is_certain_but_has_no_spread():
    test = paired([0.1 + 0.2, 0.3, 0.3, 0.3, 0.3, 0.3])  # the first differs by rounding alone

    assert test.p == 2 / 64
    assert test.effect is None
    assert (test.low, test.high) == (pytest.approx(0.3), pytest.approx(0.3))


def test_one_pair_says_nothing():
    assert paired([5.0]) == Paired(n=1, mean=5.0, p=1.0)


def test_no_pair_says_less():
    assert paired([]) == Paired(n=0)


def test_many_pairs_are_tested_by_drawing():
    clear, none = paired([1.0] * (EXACT + 1)), paired([1.0, -1.0] * EXACT)

    # All + or all - comes once in 16384.
    assert clear.p is not None
    assert 0.0 < clear.p < 10 / DRAWS  # the sample itself is counted
    assert none.p == 1.0


def test_many_divisions_of_two_samples_are_tested_by_drawing():
    clear, none = separate([0.0] * 20, [1.0] * 20), separate([0.0, 1.0] * 10, [1.0, 0.0] * 10)

    # Of 1.4e11 divisions two are as extreme.
    assert clear.p is not None
    assert 0.0 < clear.p < 10 / DRAWS  # the sample itself is counted
    assert none.p == 1.0


def test_drawing_agrees_with_counting_all():
    few = [0.3, -0.2, 0.9, 0.4, -0.1, 0.8, 0.2, -0.4, 0.5, 0.1, 0.6, -0.3, 0.2, 0.4]
    counted = paired(few)
    drawn = paired([*few, 0.0])  # a pair without a difference changes no sum

    assert len(few) == EXACT
    assert drawn.p == pytest.approx(counted.p, abs=0.01)


@given(st.lists(st.integers(-20, 20), min_size=1, max_size=9))
@settings(max_examples=60)
def test_p_is_the_share_of_signs_that_go_as_far(whole: list[int]):
    sums = [
        abs(sum(s * d for s, d in zip(signs, whole, strict=True))) for signs in product((1, -1), repeat=len(whole))
    ]

    test = paired([d / 10 for d in whole])

    assert test.p == pytest.approx(sum(far >= abs(sum(whole)) for far in sums) / len(sums))
    if test.low is not None and test.high is not None and test.mean is not None and test.p is not None:
        assert test.low - 1e-9 <= test.mean <= test.high + 1e-9
        assert (test.p >= 0.05) == (test.low <= 0.0 <= test.high)


def test_holm_corrects_for_the_questions_that_were_asked():
    assert holm([0.01, 0.04, None, 0.03]) == pytest.approx([0.03, 0.06, None, 0.06])
    assert holm([0.9, 0.8]) == [1.0, 1.0]
    assert holm([]) == []

"""Receipts of orders: each number is taken once and in order, and news are told until they were drawn."""

from hypothesis import given
from hypothesis import strategies as st

from engage_hri.services.console.web.frames import NEWS_KEPT, Receipts


@given(st.lists(st.integers(1, 9), max_size=60))
def test_each_number_is_taken_once_and_none_before_the_one_that_precedes_it(numbers: list[int]) -> None:
    receipts = Receipts()
    taken = [number for number in numbers if receipts.take(number)]

    assert taken == list(range(1, len(taken) + 1))
    assert receipts.taken == len(taken)


@given(st.lists(st.sampled_from(["news", "frame", "drawn"]), max_size=60))
def test_news_are_in_every_frame_until_one_that_has_them_was_drawn(steps: list[str]) -> None:
    receipts, told, drawn, shown = Receipts(), 0, 0, 0
    for step in steps:
        match step:
            case "news":
                told += 1
                receipts.tell("part", str(told))
            case "frame":
                assert [each.text for each in receipts.news()] == [str(each) for each in range(drawn + 1, told + 1)]
                shown = told
            case "drawn":
                receipts.confirm()
                drawn = max(drawn, shown)


def test_a_page_that_draws_no_news_may_give_no_more_orders() -> None:
    receipts = Receipts()
    for _ in range(NEWS_KEPT):
        receipts.tell("part", "no")

    assert receipts.is_full
    receipts.news()
    receipts.confirm()
    assert not receipts.is_full

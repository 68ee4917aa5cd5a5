"""The time line of an utterance."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from services.control.voice import utter


def test_words_take_time_by_their_letters_and_pauses_by_their_punctuation():
    one, two, three = utter("Okay, let's start.").words

    assert (one.start, one.end) == pytest.approx((0.0, 0.12 + 4 * 0.05))
    assert two.start == pytest.approx(one.end + 0.2)
    assert three.start == pytest.approx(two.end)
    assert (one.position, two.position, three.position) == (5, 11, 18)


def test_an_ordinary_sentence_has_about_three_words_a_second():
    text = "We are going to use the pieces on the table to make a picture together."

    assert utter(text).seconds / len(text.split()) == pytest.approx(0.35, abs=0.05)


def test_a_mark_before_a_word_is_reached_as_the_word_begins():
    utterance = utter("Well, this can.")

    assert utterance.said_by(6) == utterance.words[1].start
    assert utterance.said_by(5) == utterance.words[0].end
    assert utterance.said_by(0) == 0.0
    assert utterance.said_by(15) == utterance.seconds


def test_a_mark_inside_a_word_is_reached_in_between():
    utterance = utter("triangles")

    assert utterance.said_by(3) == pytest.approx(utterance.seconds / 3)


def test_nothing_to_say_takes_no_time():
    assert utter("").seconds == utter(" … ").seconds == 0.0
    assert utter("").words == ()


def test_a_slow_voice_is_slow_throughout():
    assert utter("one, two", 2.0).seconds == pytest.approx(2 * utter("one, two").seconds)


@settings(max_examples=100)
@given(text=st.text(alphabet="ab ,.—'", max_size=40))
def test_time_never_runs_backwards(text: str):
    utterance = utter(text)
    times = [utterance.said_by(position) for position in range(len(text) + 1)]

    assert times == sorted(times)
    assert all(0.0 <= time <= utterance.seconds for time in times)
    assert all(text[: word.position].endswith(word.text) for word in utterance.words)

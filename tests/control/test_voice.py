"""The time line of an utterance."""

import asyncio
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.behaviors import Mark, Speech
from engage_hri.services.control.contract.body import MovementAuthority, Spoke
from engage_hri.services.control.voice.speaking import speak
from engage_hri.services.control.voice.timeline import utter
from engage_hri.services.runtime.virtual_time import VirtualTimeLoop, run_virtual
from tests.random_cases import share_of


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


@pytest.mark.parametrize(
    ("text", "slowest", "quickest"),
    [
        ("你好请把蓝色的方块放在桌子的左边然后再把红色的方块给我谢谢你的帮助", 33 / 4, 33 / 5),
        ("今日はとても良い天気ですから一緒に公園まで歩いて行きましょうか", 36 / 6, 36 / 8),  # of its moras
        ("วันนี้อากาศดีมากเราไปเดินเล่นที่สวนสาธารณะกันเถอะ", 18 / 4, 18 / 5),  # of its syllables
    ],
)
def test_a_script_without_spaces_takes_as_long_as_with_people_and_can_be_cut_everywhere(
    text: str, slowest: float, quickest: float
):
    utterance = utter(text)

    assert quickest <= utterance.seconds <= slowest
    assert max(word.end - word.start for word in utterance.words) < 0.25
    assert sum(map(utterance.is_gap, range(len(text)))) == len(utterance.words)


def test_wide_punctuation_gives_pauses():
    one, two, three = utter("好，来！吧。").words

    assert two.start == pytest.approx(one.end + 0.2)
    assert three.start == pytest.approx(two.end + 0.35)
    assert utter("好，来！吧。").seconds == three.end


def test_a_mark_between_two_characters_is_reached_as_the_second_begins():
    utterance = utter("好，来吧")

    assert utterance.said_by(2) == utterance.words[1].start
    assert utterance.said_by(3) == utterance.words[1].end == utterance.words[2].start


def test_an_emoji_is_among_what_was_said_and_takes_no_time():
    plain, smiling = utter("Hello there. Bye"), utter("Hello there. 😊 Bye 😊")

    assert [word.text for word in smiling.words] == ["Hello", "there.", "😊", "Bye", "😊"]
    assert smiling.seconds == plain.seconds
    assert smiling.words[-1].position == len("Hello there. 😊 Bye 😊")


SPOKEN = st.text(st.sampled_from(list("ab ,.—'世界。，！「」かきゃー한ขไม้😊3")), max_size=40)


@settings(max_examples=200)
@given(text=SPOKEN)
def test_what_has_been_said_is_always_a_beginning_of_the_text(text: str):
    words = utter(text).words

    said = ""
    for word in words:
        said += word.text
        assert said == "".join(text[: word.position].split())
    assert not words or said == "".join(text.split())


@settings(max_examples=share_of(200))
@given(text=SPOKEN, more=SPOKEN)
def test_more_text_never_takes_less_time(text: str, more: str):
    assert utter(text + more).seconds >= utter(text).seconds - 1e-9
    utterance = utter(text + more)
    times = [utterance.said_by(position) for position in range(len(text + more) + 1)]

    assert times == sorted(times)


@pytest.mark.parametrize("tenths", range(8))
def test_a_voice_that_is_ended_where_it_waits_says_no_word_twice(tenths: int) -> None:
    """Whatever is rounded: the mark is where the word before it ends."""

    async def said() -> list[str]:
        await asyncio.sleep(0.1 * tenths)
        authority = MovementAuthority(speech := Speech(id="s", text="This one here.", marks=(Mark("m", 5),)), "start")
        asyncio.get_running_loop().call_later(3.9, authority.revoke)
        return [each.word async for each in speak(speech, authority) if isinstance(each, Spoke)]

    assert run_virtual(said()) == ["This"]


class Creeping(VirtualTimeLoop):
    """A clock that goes on while code runs, and timers that ring a little early, as those of uvloop do."""

    step, crept = 0.0, 0.0

    def time(self) -> float:
        self.crept += self.step
        return super().time() + self.crept

    def call_at(self, when: float, *rest: Any, **context: Any) -> asyncio.TimerHandle:
        return super().call_at(when - 0.0009, *rest, **context)


@pytest.mark.parametrize("step", [0.00005, 0.0001, 0.00015, 0.0002, 0.00025, 0.0003, 0.0004, 0.0005])
def test_what_becomes_due_while_it_looks_is_not_missed(step: float):
    """Marks and ends of words are so near to one another that the clock often passes one between two looks at it."""
    text = "a b c d e f g h i j k l m n o p q r s t u v w x y z"
    speech = Speech(id="s", text=text, marks=tuple(Mark(f"m{at}", at) for at in range(0, len(text), 3)))

    async def said() -> list[str]:
        told = [each async for each in speak(speech, MovementAuthority(speech, "end"), pace=0.2)]
        return [each.word for each in told if isinstance(each, Spoke)]

    with asyncio.Runner(loop_factory=Creeping) as runner:
        runner.get_loop().step = step  # type: ignore[attr-defined]
        assert runner.run(said()) == text.split()

"""Recognizers: what each understands of spoken phrases, and what it says where something is missing."""

import re
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from engage_hri.schemas.faults import InputRefused
from engage_hri.services.commandline.look import small_talk
from engage_hri.services.perception.hearing.listening import Order
from engage_hri.services.perception.hearing.recognizing import (
    Desk,
    KnownWords,
    Listening,
    NotUnderstood,
    RecognizerSettings,
    SpeechOrder,
    SpeechRecognizer,
    SpeechWords,
    Whole,
)
from engage_hri.services.perception.hearing.voice import Samples
from tests.perception.spoken import PHRASES, VOICES, spoken

OTHER = ("would you like some coffee", "my name is peter", "where is the train station", "happy birthday to you")


def found(name: str, settings: RecognizerSettings) -> SpeechRecognizer:
    return Order(name, settings).made()


class Counting(Listening):
    """Knows how many samples it has heard; `99` break it."""

    def __init__(self) -> None:
        self.heard = 0

    def hear(self, samples: Samples) -> str:
        if len(samples) == 99:
            raise RuntimeError("oops")
        self.heard += len(samples)
        return f"  {self.heard // 10 * 10}"

    def end(self) -> SpeechWords:
        return SpeechWords(f"{self.heard} in  all", 0.5)


class Counters(SpeechRecognizer):
    def listen(self) -> Listening:
        return Counting()


def sound(count: int) -> bytes:
    return bytes(2 * count)


def test_words_are_told_when_they_change_and_in_the_end_for_good():
    desk = Desk(Counters(RecognizerSettings()))

    assert [*desk.take(SpeechOrder(1, sound(10)))] == [KnownWords(1, SpeechWords("10"), final=False)]
    assert [*desk.take(SpeechOrder(1, sound(3)))] == []
    assert [*desk.take(SpeechOrder(2, sound(20)))] == [KnownWords(2, SpeechWords("20"), final=False)]
    assert [*desk.take(SpeechOrder(1, b""))] == [KnownWords(1, SpeechWords("13 in all", 0.5), final=True)]
    assert [*desk.take(SpeechOrder(2, b""))] == [KnownWords(2, SpeechWords("20 in all", 0.5), final=True)]


def test_a_speech_at_which_an_engine_fails_is_given_up_and_the_next_is_heard():
    desk = Desk(Counters(RecognizerSettings()))

    [failed] = desk.take(SpeechOrder(1, sound(99)))
    assert isinstance(failed, NotUnderstood)
    assert failed.fault.reason == "the recognizer fails: RuntimeError: oops"
    assert [*desk.take(SpeechOrder(1, sound(10))), *desk.take(SpeechOrder(1, b""))] == []
    assert [*desk.take(SpeechOrder(2, b""))] == [KnownWords(2, SpeechWords("0 in all", 0.5), final=True)]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (SpeechWords("so", np.float32(0.5)), SpeechWords("so", 0.5)),  # type: ignore[arg-type]
        (SpeechWords("s\udc80"), SpeechWords("s?")),
        (SpeechWords("so", 2.0), "a confidence of 2: expected 0 to 1"),
        (SpeechWords("so", float("nan")), "a confidence of nan: expected 0 to 1"),
        (None, "'NoneType' object has no attribute"),
    ],
)
def test_what_an_engine_answers_is_words_that_can_be_told_or_has_failed(words: Any, told: SpeechWords | str):
    class Odd(SpeechRecognizer):
        def listen(self) -> Listening:
            return Whole(lambda samples: words)

    [answer] = Desk(Odd(RecognizerSettings())).take(SpeechOrder(1, b""))
    if isinstance(answer, NotUnderstood):
        assert isinstance(told, str)
        assert told in answer.fault.reason
    else:
        assert answer == KnownWords(1, told, final=True)  # type: ignore[arg-type]
        assert type(answer.words.confidence) is float


def test_a_whole_speech_is_understood_at_its_end():
    whole = Whole(lambda samples: SpeechWords(str(len(samples))))

    assert whole.hear(np.zeros(5, np.int16)) == whole.hear(np.zeros(7, np.int16)) == ""
    assert whole.end() == SpeechWords("12")
    assert Whole(lambda samples: SpeechWords(str(len(samples)))).end() == SpeechWords("0")


def test_a_recognizer_of_another_package_is_found_by_its_name(install):
    text = "from tests.perception.test_recognizing import Counters\n"
    install("acme-ears", "[engage.recognizers]\nacme = acme_ears:Counters\n", acme_ears=text)

    assert type(found("acme", RecognizerSettings())).__name__ == "Counters"
    with pytest.raises(InputRefused, match=r"no recognizer 'acne'.*acme"):
        found("acne", RecognizerSettings())


@pytest.mark.parametrize(
    ("name", "settings", "reason"),
    [
        ("whisper", RecognizerSettings(), r"no Whisper model|No module"),
        ("whisper", RecognizerSettings(model="base"), "no Whisper model in 'base'|No module"),
        ("vosk", RecognizerSettings(model="nowhere"), "no Vosk model in 'nowhere'|No module"),
        ("sherpa", RecognizerSettings(model="nowhere"), "no model for sherpa-onnx in 'nowhere'|No module"),
        ("endpoint", RecognizerSettings(address="there"), "no address of a server"),
    ],
)
def test_what_is_missing_is_told_with_what_to_do(name: str, settings: RecognizerSettings, reason: str):
    with pytest.raises(InputRefused, match=reason) as refused:
        found(name, settings)
    assert refused.value.fault.advice


@cache
def for_phrases() -> SpeechRecognizer:
    return found("sphinx", RecognizerSettings(phrases=tuple(phrase.capitalize() + "!" for phrase in PHRASES)))


class TestSphinx:
    @pytest.fixture
    def sphinx(self) -> SpeechRecognizer:
        pytest.importorskip("pocketsphinx", reason="pip install pocketsphinx")
        return for_phrases()

    def understood(self, sphinx: SpeechRecognizer, text: str, variant: str, noise: float | None = None) -> str:
        said = spoken(text, variant, before=0.3, after=0.3, noise=noise)
        listening = sphinx.listen()
        listening.hear(said.samples)
        return listening.end().text

    def test_known_phrases_are_understood_as_they_are_written_in_the_settings(self, sphinx: SpeechRecognizer):
        for variant in VOICES:
            assert [self.understood(sphinx, text, variant) for text in PHRASES] == [
                phrase.capitalize() + "!" for phrase in PHRASES
            ]

    def test_of_other_sentences_nothing_is_made_up(self, sphinx: SpeechRecognizer):
        assert [self.understood(sphinx, text, "") for text in OTHER] == [""] * len(OTHER)

    def test_in_noise_most_phrases_are_understood(self, sphinx: SpeechRecognizer):
        wrong = [text for text in PHRASES if text not in self.understood(sphinx, text, "", 10.0).lower()]
        assert len(wrong) <= 2

    def test_it_needs_phrases_of_words_that_it_knows(self, sphinx: SpeechRecognizer):
        with pytest.raises(InputRefused, match="needs the phrases"):
            found("sphinx", RecognizerSettings())
        with pytest.raises(InputRefused, match="the dictionary has no 'xqzzy'"):
            found("sphinx", RecognizerSettings(phrases=("hello", "say xqzzy")))

    def test_what_visitors_are_told_to_say_is_understood_of_every_voice(self, sphinx: SpeechRecognizer):
        page = (Path(__file__).parents[2] / "docs/talk.md").read_text(encoding="utf-8")
        first = re.findall(r"\*([a-z ]+)\*", page[page.index("and say *") :].partition(". ")[0])
        talk = found("sphinx", RecognizerSettings(phrases=small_talk.PHRASES))
        said = [*first, *small_talk.EXAMPLES]
        assert len(first) == 4
        for variant in ("", "f1", "f2", "f3", "f4", "f5", "m3", "m7"):
            assert [self.understood(talk, text, variant) for text in said] == said

    def test_who_wants_the_robot_to_be_still_is_understood_by_nearly_all_voices(self, sphinx: SpeechRecognizer):
        talk = found("sphinx", RecognizerSettings(phrases=small_talk.PHRASES))
        variants = ("", "f1", "f2", "f3", "f4", "f5", "m3", "m7")
        heard = [self.understood(talk, text, variant) for text in small_talk.STILL for variant in variants]
        print(heard)
        assert sum(each in small_talk.STILL for each in heard) >= 0.85 * len(heard)
        assert {*heard} <= {"", *small_talk.STILL}

    @pytest.mark.parametrize("language", ["de", "klingon"])
    def test_it_knows_english_alone(self, sphinx: SpeechRecognizer, language: str):
        with pytest.raises(InputRefused, match=f"English alone, and no '{language}'") as refused:
            found("sphinx", RecognizerSettings(language=language, phrases=("hello",)))
        assert refused.value.fault.advice
        assert found("sphinx", RecognizerSettings(language="en_GB", phrases=("hello",)))

    def test_silence_and_next_to_no_sound_have_no_words(self, sphinx: SpeechRecognizer):
        for count in (0, 1, 100, 16000):
            listening = sphinx.listen()
            listening.hear(np.zeros(count, np.int16))
            assert listening.end() == SpeechWords("")


def test_a_recognizer_that_is_no_package_of_python_is_refused_by_path(tmp_path: Path):
    with pytest.raises(InputRefused, match="no recognizer"):
        found(str(tmp_path / "mine.py"), RecognizerSettings())

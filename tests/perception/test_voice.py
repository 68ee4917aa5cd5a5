"""When voices begin and end: what a judge's likelihoods make, and how far off it is on spoken sound."""

from collections.abc import Iterable
from statistics import median

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from engage_hri.services.perception.hearing.own_voice import Canceller, CautiousJudge, OwnVoice
from engage_hri.services.perception.hearing.voice import (
    BEFORE,
    LATE,
    LENGTH,
    LONGEST,
    RATE,
    WINDOW,
    VoiceBegan,
    VoiceEar,
    VoiceEnded,
    VoiceEvent,
    VoiceSound,
    silero,
)
from tests.perception.spoken import PHRASES, VOICES, spoken

PAUSE = 0.3
QUIET = [0.0] * 12


def edges(told: Iterable[VoiceEvent]) -> list[VoiceEvent]:
    return [event for event in told if not isinstance(event, VoiceSound)]


def judged(likelihoods: list[float], pause: float = PAUSE) -> list[VoiceEvent]:
    """What an ear tells of windows with these likelihoods, one piece each; the sound of a window is its number."""
    rest = iter(likelihoods)
    ear = VoiceEar(lambda window: next(rest), pause)
    told = []
    for number in range(len(likelihoods)):
        told += ear.feed(np.full(WINDOW, number, np.int16), number * LENGTH)
    return told


def test_a_voice_has_begun_where_the_judge_began_to_waver_and_ended_where_it_was_last_sure():
    told = judged([*QUIET, 0.3, 0.6, 0.9, 1.0, 1.0, 0.6, 0.2, *QUIET])

    assert edges(told) == [VoiceBegan(pytest.approx(12 * LENGTH)), VoiceEnded(pytest.approx(17 * LENGTH - LATE))]


def test_a_knock_is_no_voice_and_a_stop_between_two_words_no_end():
    assert judged([*QUIET, 0.9, 0.1, 0.1, 0.9, *QUIET]) == []
    told = judged([*QUIET, *[1.0] * 9, *[0.0] * 8, *[1.0] * 9, *QUIET])
    assert [type(event) for event in edges(told)] == [VoiceBegan, VoiceEnded]


def test_what_flutters_between_the_limits_changes_nothing():
    assert judged([*QUIET, *[0.4, 0.45] * 9]) == []
    assert len(edges(judged([*QUIET, *[1.0] * 5, *[0.4] * 30]))) == 1


def test_a_recognizer_gets_the_sound_from_before_the_onset_to_the_end_without_a_gap():
    told = judged([*QUIET, 1.0, 1.0, 1.0, 1.0, *QUIET])

    sound = np.concatenate([event.samples for event in told if isinstance(event, VoiceSound)])
    numbers = sound[::WINDOW].tolist()
    assert numbers == [*range(14 - BEFORE, numbers[-1] + 1)]
    assert numbers[-1] >= 16


def test_a_voice_without_end_is_told_as_several():
    told = edges(judged([*QUIET, *[1.0] * round(2.5 * LONGEST / LENGTH)]))

    assert [type(event) for event in told] == [VoiceBegan, VoiceEnded, VoiceBegan, VoiceEnded, VoiceBegan]
    assert told[1].at == told[2].at == pytest.approx(told[0].at + LONGEST, abs=LENGTH)


def test_where_sound_is_missing_a_voice_has_ended_and_nothing_is_heard_across_the_gap():
    ear = VoiceEar(lambda window: 1.0, PAUSE)
    told = ear.feed(np.zeros(5 * WINDOW + 100, np.int16), 0.0)
    assert edges(told) == [VoiceBegan(0.0)]

    told = edges(ear.feed(np.zeros(3 * WINDOW, np.int16), 2.0))
    assert told == [VoiceEnded(pytest.approx(5 * LENGTH - LATE), "gap"), VoiceBegan(2.0)]
    assert edges(ear.lose()) == [VoiceEnded(pytest.approx(2.0 + 3 * LENGTH - LATE), "lost")]
    assert ear.lose() == []


@given(st.lists(st.integers(1, 3 * WINDOW), min_size=1, max_size=30))
def test_it_does_not_matter_how_sound_is_cut_into_pieces(sizes: list[int]):
    rng = np.random.default_rng(len(sizes))
    sound = rng.integers(-9, 9, 40 * WINDOW).astype(np.int16)
    sound[9 * WINDOW : 22 * WINDOW] *= 1000

    def loudness(window: np.ndarray) -> float:
        return float(np.abs(window).max() > 0.01)

    whole, cut = VoiceEar(loudness, PAUSE), VoiceEar(loudness, PAUSE)
    told, at = [], 0
    for size in [*sizes, len(sound)]:
        told += cut.feed(sound[at : at + size], at / RATE)
        at = min(len(sound), at + size)
    assert [(type(one), round(one.at, 6)) for one in edges(told)] == [
        (type(one), round(one.at, 6)) for one in edges(whole.feed(sound, 0.0))
    ]


def test_a_voice_over_the_robots_counts_once_there_was_silence_where_the_robots_was_for_sure():
    canceller = Canceller(OwnVoice())
    canceller.sounds = True
    likely = [0.0]
    judge = CautiousJudge(lambda _: likely[0], canceller)

    def told(likelihood: float, windows: int, *, sure: bool = True) -> list[float]:
        likely[0], canceller.is_sure = likelihood, sure
        return [judge(np.zeros(WINDOW, np.float32)) for _ in range(windows)]

    silence_that_may_be_before_the_voice = told(0.05, 100, sure=False)
    assert {*silence_that_may_be_before_the_voice, *told(0.9, 100)} == {0.0}
    told(0.05, 15)
    assert told(0.9, 3) == [0.9, 0.0, 0.0]
    told(0.05, 60)
    assert told(0.9, 100) == [0.9] * 100


@pytest.mark.parametrize("noise", [None, 10.0, 5.0])
def test_onsets_and_ends_of_spoken_phrases_are_where_they_can_be_heard(noise: float | None):
    """Also that each is heard once, and known soon; the numbers of docs/hearing.md are of more phrases and voices."""
    onsets, ends, known = [], [], []
    for variant in VOICES:
        for text in PHRASES:
            sound = spoken(text, variant, noise=noise)
            ear, told = VoiceEar(silero(), PAUSE), []
            for at in range(0, len(sound.samples), 320):
                fed = edges(ear.feed(sound.samples[at : at + 320], at / RATE))
                known += [(at + 320) / RATE - sound.since for event in fed if isinstance(event, VoiceBegan)]
                told += fed
            assert [type(event) for event in told] == [VoiceBegan, VoiceEnded], text
            onsets.append(abs(told[0].at - sound.since))
            ends.append(abs(told[1].at - sound.until))

    assert median(onsets) < 0.040
    assert median(known) < 0.150
    assert median(ends) < 0.060


def test_no_voice_is_heard_in_silence_and_noise():
    from tests.perception.spoken import pink

    ear = VoiceEar(silero(), PAUSE)
    assert ear.feed(np.zeros(5 * RATE, np.int16), 0.0) == []
    assert ear.feed((pink(20 * RATE) * 3000).astype(np.int16), 5.0) == []

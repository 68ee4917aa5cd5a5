"""From voice levels to speech: onset, bridged dropouts, lost streams; exact times."""

from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engage_hri.schemas.perception import ActionBegan
from engage_hri.services.recognition.config import RecognitionConfig
from engage_hri.services.recognition.perceive.attention import Attention
from tests.recognition.observations import HUMAN, ROBOT
from tests.recognition.raw import Watch, voice


@pytest.mark.parametrize(("last", "told"), [(1.099, []), (1.1, [("speak", "", 1.0)])])
def test_speech_is_a_sound_that_lasts_from_its_beginning_on(last, told):
    watch = Watch()
    watch.hears(True, 1.0, 1.05, last)

    assert watch.told == told


@pytest.mark.parametrize(("again", "speech"), [(1.549, 1), (1.55, 2)])
def test_a_dropout_shorter_than_the_pause_is_bridged(again, speech):
    watch = Watch()
    watch.hears(True, 1.0, 1.2)
    watch.hears(False, 1.3)
    watch.hears(True, again, again + 0.1)

    assert [told for told in watch.told if told[0] == "speak"] == [("speak", "", 1.0), ("speak", "", again)][:speech]


def test_speech_ends_after_the_pause_from_the_beginning_of_the_silence_on():
    watch = Watch()
    watch.hears(True, 1.0, 1.2)
    watch.hears(False, 1.3, 1.4)
    deadline = watch.attention.deadline
    watch.until(1.549)
    before = watch.of("speak ends")
    watch.until(1.55)

    assert deadline == pytest.approx(1.55)
    assert before == []
    assert watch.of("speak ends") == [("speak ends", "", 1.3)]
    assert watch.attention.deadline is None


def test_speech_ends_with_the_last_that_was_heard_of_it():
    watch = Watch()
    watch.hears(True, 1.0, 1.2)
    watch.until(1.699)
    before = watch.of("speak ends")
    watch.until(1.7)

    assert before == []
    assert watch.of("speak ends") == [("speak ends", "", 1.2)]


def test_a_voice_is_as_sure_as_the_least_sure_level_of_its_onset():
    watch = Watch()
    for at, confidence in ((1.0, 0.9), (1.05, 0.3), (1.06, 0.6), (1.1, 0.8), (1.2, 0.5)):
        watch.hears(True, at, confidence=confidence)
    (speech,) = watch.actions

    assert isinstance(speech, ActionBegan)
    assert speech.confidence == 0.6


def test_a_voice_alone_is_never_lost():
    watch = Watch()
    watch.hears(True, 1.0, 1.2)
    watch.until(100.0)

    assert [told[0] for told in watch.told] == ["speak", "speak ends"]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6), st.integers(1, 200))
def test_speech_of_any_stream_alternates_and_pauses_at_least_as_long_as_the_pause(seed, length):
    random, config = Random(seed), RecognitionConfig()
    attention = Attention(ROBOT, config)
    arrivals, at = [], 0.0
    for _ in range(length):
        at += random.choice((0.02, 0.02, 0.1, 0.3, 0.7))
        one = voice(random.random() < 0.6, at, confidence=random.choice((1.0, 0.7, 0.1)))
        arrivals += [(at + random.choice((0.0, 0.0, 0.1)), at, one)] * random.choice((0, 1, 1, 2))
    actions = []
    for arrival, at, one in sorted(arrivals, key=lambda arrival: arrival[0]):
        actions += attention.advance(arrival)
        actions += attention.feed(one, at)
    actions += attention.advance(1000.0)

    assert [isinstance(action, ActionBegan) for action in actions] == [True, False] * (len(actions) // 2)
    times = [action.at.seconds for action in actions]
    assert times == sorted(times)
    assert all(action.actor == HUMAN for action in actions)
    assert attention.deadline is None
    assert attention.undecided == []
